#version 300 es
precision highp float;

uniform sampler2D texels;
uniform vec3 placeU;     // rows of the texture's transform
uniform vec3 placeV;
uniform float exposure;
uniform float brightest; // largest exposed value
uniform mat3 toSrgb;     // from the scene's primaries
uniform float curve[5];  // y = x (a x + b) / (x (c x + d) + e)

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
  x = clamp(x * (curve[0] * x + curve[1]) / (x * (curve[2] * x + curve[3]) + curve[4]), 0.0, 1.0);
  vec3 bent = 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055;
  shown = vec4(mix(bent, 12.92 * x, lessThanEqual(x, vec3(0.0031308))), 1.0);
}
