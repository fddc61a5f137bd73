#version 300 es
precision highp float;

uniform sampler2D texels;
uniform vec3 placeU;     // rows of the texture's transform
uniform vec3 placeV;
uniform float exposure;
uniform float brightest; // largest exposed value
uniform mat3 toSrgb;     // from the scene's primaries
uniform float curve[6];  // y = x (a x + b) / (x (c x + d) + e), and where it is 1

in vec3 irradianceHere;
in vec3 tintHere;
in vec3 radianceHere;
in vec2 uvHere;
out vec4 shown;

void main() {
  vec3 uv = vec3(uvHere, 1.0);
  vec3 radiance = irradianceHere * tintHere;
#ifdef TEXTURED
  radiance *= texture(texels, vec2(dot(placeU, uv), dot(placeV, uv))).rgb;
#endif
  vec3 exposed = clamp((radiance + radianceHere) * exposure, 0.0, brightest);
  vec3 x = max(toSrgb * exposed, 0.0);
  // The curve of the smallest and the largest channel; hue stays (tone.rs).
  x *= min(curve[5] / max(max(x.r, max(x.g, x.b)), 1e-30), 1.0);
  vec2 ends = vec2(min(x.r, min(x.g, x.b)), max(x.r, max(x.g, x.b)));
  vec2 y = clamp(ends * (curve[0] * ends + curve[1]) / (ends * (curve[2] * ends + curve[3]) + curve[4]), 0.0, 1.0);
  x = y.x + (x - ends.x) * ((y.y - y.x) / max(ends.y - ends.x, 1e-30));
  vec3 bent = 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055;
  shown = vec4(mix(bent, 12.92 * x, lessThanEqual(x, vec3(0.0031308))), 1.0);
}
