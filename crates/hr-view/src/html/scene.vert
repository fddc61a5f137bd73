#version 300 es
precision highp float;
precision highp int;

uniform vec3 eye;      // relative to the mesh's origin
uniform vec4 right;    // unit; w: horizontal scale, cotangent of half the field of view
uniform vec4 up;       // unit; w: vertical scale
uniform vec4 forward;  // unit; w: distance of the near plane

in vec3 place;
in uint irradiance;
in uint tint;
in uint emission;
in vec2 uv;
in vec3 glossy;

out vec3 irradianceHere;
out vec3 tintHere;
out vec3 radianceHere;
out vec2 uvHere;

// Three channels of nine bits over a common exponent.
vec3 color(uint word) {
  return vec3(word & 511u, word >> 9u & 511u, word >> 18u & 511u) * exp2(float(word >> 27u) - 24.0);
}

void main() {
  vec3 to = place - eye;
  float depth = dot(to, forward.xyz);
  // No far plane: −1 at the near plane, toward 1 far away.
  gl_Position = vec4(dot(to, right.xyz) * right.w, dot(to, up.xyz) * up.w, depth - 2.0 * forward.w, depth);
  irradianceHere = color(irradiance);
  tintHere = color(tint);
  radianceHere = color(emission) + glossy;
  uvHere = uv;
}
