#version 300 es
precision highp float;

uniform sampler2D texels;
uniform vec3 placeU;     // rows of the texture's transform
uniform vec3 placeV;
uniform float exposure;
uniform float brightest; // largest exposed value
uniform mat3 toSrgb;     // from the scene's primaries
uniform float curve[6];  // y = x (a x + b) / (x (c x + d) + e), and where it is 1

#ifdef TEXTURED
in vec3 diffuseHere;
in vec3 otherHere;
in vec2 uvHere;
#else
in vec3 exposedHere;
#endif
out vec4 shown;

void main() {
#ifdef TEXTURED
  vec3 uv = vec3(uvHere, 1.0);
  vec3 radiance = diffuseHere * texture(texels, vec2(dot(placeU, uv), dot(placeV, uv))).rgb + otherHere;
  vec3 exposedHere = toSrgb * clamp(radiance * exposure, 0.0, brightest);
#endif
  vec3 x = max(exposedHere, 0.0);
  // The curve of the smallest and the largest channel; hue stays (tone.rs).
  x *= min(curve[5] / max(max(x.r, max(x.g, x.b)), 1e-30), 1.0);
  vec2 ends = vec2(min(x.r, min(x.g, x.b)), max(x.r, max(x.g, x.b)));
  vec2 y = clamp(ends * (curve[0] * ends + curve[1]) / (ends * (curve[2] * ends + curve[3]) + curve[4]), 0.0, 1.0);
  x = y.x + (x - ends.x) * ((y.y - y.x) / max(ends.y - ends.x, 1e-30));
  // 1.055 x^(1/2.4) − 0.055 to a tenth of a code of 255, as in scene.wgsl: a power costs several times as much where the
  // processor draws.
  vec3 root = sqrt(x);
  vec3 bent = 0.83372968 * root + 0.29813416 * sqrt(root) - 0.0553148 * x - 0.07691036;
  shown = vec4(mix(bent, 12.92 * x, lessThanEqual(x, vec3(0.0031308))), 1.0);
}
