#version 300 es
// A vertex of the mesh with its values.
uniform mat4 toClip;
in vec3 position, normal, bent, base;
in vec2 place, otherPlace, baseUv;
in float w, otherW, error, alpha;
centroid out vec3 normalHere, bentHere, baseHere;  // within the face also where it covers a part of a pixel
centroid out vec2 placeHere, otherPlaceHere, baseUvHere;
centroid out float wHere, otherHere, errorHere, alphaHere;

void main() {
  gl_Position = toClip * vec4(position, 1.0);
  normalHere = normal;
  bentHere = bent;
  placeHere = place;
  otherPlaceHere = otherPlace;
  baseUvHere = baseUv;
  baseHere = mix(pow((base + 0.055) / 1.055, vec3(2.4)), base / 12.92, lessThanEqual(base, vec3(0.04045)));  // linear
  alphaHere = alpha;
  wHere = w;
  otherHere = otherW;
  errorHere = error * error;  // stored as the square root of its share of the most
}
