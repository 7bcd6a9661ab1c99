#version 300 es
precision highp float;
uniform float opacity;
in vec3 colourHere;
out vec4 colour;

void main() {
  float away = length(gl_PointCoord - 0.5);
  if (away > 0.5) discard;
  vec3 rim = away > 0.38 ? vec3(0.0) : colourHere;
  colour = vec4(rim * opacity, opacity);
}
