#version 300 es
// A pixel of the mesh in one of the modes; colours of light are linear until `encoded`.
precision highp float;
const int CLAY = 0, W = 1, ERROR = 2, FLAGS = 3, BENT = 4, DIFFERENCE = 5, COLOUR = 6;
uniform int mode;
uniform vec3 clay, towardsKey, ramp[5];
uniform float ambient, key, shown;
uniform vec3 tone;  // the w shown as none and as all light, and an exponent
uniform sampler2D page, otherPage, image;
uniform bvec3 paged;  // whether w is that of a texture, and the other bake's, and the base colour
centroid in vec3 normalHere, bentHere, baseHere;
centroid in vec2 placeHere, otherPlaceHere, baseUvHere;
centroid in float wHere, otherHere, errorHere, alphaHere;
out vec4 colour;

vec3 encoded(vec3 light) {  // sRGB, IEC 61966-2-1
  light = clamp(light, 0.0, 1.0);
  return mix(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, 12.92 * light, lessThanEqual(light, vec3(0.0031308)));
}

vec3 ramped(float share) {
  float place = clamp(share, 0.0, 1.0) * 4.0;
  int step = min(int(place), 3);
  return mix(ramp[step], ramp[step + 1], place - float(step));
}

float ownW() {
  return paged.x ? texture(page, placeHere).r : wHere;
}

float shownW() {
  if (mode == FLAGS) return ownW();
  return pow(clamp((ownW() - tone.x) / (tone.y - tone.x), 0.0, 1.0), tone.z);
}

vec3 lit(vec3 albedo) {  // (12.75) in the form that weights ambient and diffuse light by w
  vec3 n = normalize(normalHere) * (gl_FrontFacing ? 1.0 : -1.0);
  return albedo * shownW() * (ambient + key * max(dot(n, towardsKey), 0.0));
}

// What is there of the surface at a pixel shows, by a pattern that is even over a few: nothing needs to be sorted.
bool isThrough() {
  float alpha = paged.z ? alphaHere * texture(image, baseUvHere).a : alphaHere;
  return alpha <= fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
}

void main() {
  if (isThrough()) discard;
  vec3 shade = vec3(0.0);
  if (mode == CLAY) shade = encoded(lit(clay));
  if (mode == COLOUR) shade = encoded(lit(paged.z ? baseHere * texture(image, baseUvHere).rgb : baseHere));
  if (mode == W) shade = encoded(vec3(shownW()));
  if (mode == ERROR) shade = ramped(errorHere / shown);
  if (mode == FLAGS) shade = encoded(vec3(0.5 * dot(lit(clay), vec3(0.2126, 0.7152, 0.0722))));
  if (mode == BENT) shade = dot(bentHere, bentHere) > 0.0 ? 0.5 + 0.5 * normalize(bentHere) : vec3(0.0);
  if (mode == DIFFERENCE) {
    float other = paged.y ? texture(otherPage, otherPlaceHere).r : otherHere;
    shade = ramped(0.5 + 0.5 * (other - ownW()) / shown);
  }
  colour = vec4(shade, 1.0);
}
