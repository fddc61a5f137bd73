#version 300 es
precision highp float;
precision highp int;

uniform vec3 eye;      // relative to the mesh's origin
uniform vec4 right;    // unit; w: horizontal scale, cotangent of half the field of view
uniform vec4 up;       // unit; w: vertical scale
uniform vec4 forward;  // unit; w: distance of the near plane
uniform float exposure;
uniform float brightest; // largest exposed value
uniform mat3 toSrgb;   // from the scene's primaries

in vec3 place;
in uint irradiance;
in uint tint;
in uint emission;
in vec2 uv;
in vec3 glossy;

#ifdef TEXTURED
out vec3 diffuseHere;  // that the texture multiplies
out vec3 otherHere;
out vec2 uvHere;
#else
// What of tone mapping is linear: the same before interpolation and after it.
out vec3 exposedHere;
#endif

// Three channels of nine bits over a common exponent.
vec3 color(uint word) {
  return vec3(word & 511u, word >> 9u & 511u, word >> 18u & 511u) * exp2(float(word >> 27u) - 24.0);
}

void main() {
  vec3 to = place - eye;
  float depth = dot(to, forward.xyz);
  // No far plane: −1 at the near plane, toward 1 far away.
  gl_Position = vec4(dot(to, right.xyz) * right.w, dot(to, up.xyz) * up.w, depth - 2.0 * forward.w, depth);
  vec3 diffuse = color(irradiance) * color(tint);
  vec3 other = color(emission) + glossy;
#ifdef TEXTURED
  diffuseHere = diffuse;
  otherHere = other;
  uvHere = uv;
#else
  exposedHere = toSrgb * clamp((diffuse + other) * exposure, 0.0, brightest);
#endif
}
