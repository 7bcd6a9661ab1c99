#version 300 es
// A vertex of the mesh with its values.
uniform mat4 toClip;
in vec3 position, normal, bent;
in vec2 place, otherPlace;
in float w, otherW, error;
centroid out vec3 normalHere, bentHere;  // within the face also where it covers a part of a pixel
centroid out vec2 placeHere, otherPlaceHere;
centroid out float wHere, otherHere, errorHere;

void main() {
  gl_Position = toClip * vec4(position, 1.0);
  normalHere = normal;
  bentHere = bent;
  placeHere = place;
  otherPlaceHere = otherPlace;
  wHere = w;
  otherHere = otherW;
  errorHere = error * error;  // stored as the square root of its share of the most
}
