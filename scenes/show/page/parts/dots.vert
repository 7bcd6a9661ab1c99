#version 300 es
// A dot on a flagged vertex, a little in front of the surface.
uniform mat4 toClip;
uniform vec3 eye;
uniform float size;
in vec3 position, colour;
out vec3 colourHere;

void main() {
  vec3 towards = eye - position;
  gl_Position = toClip * vec4(position + towards * 0.003, 1.0);
  gl_PointSize = size;
  colourHere = colour;
}
