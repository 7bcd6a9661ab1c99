// A camera that turns about a target, its up axis kept upright, in the coordinates of data.js.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

const STEEPEST = Math.PI / 2 - 0.001;
const NEAREST = 0.002;
const FARTHEST = 100;

class Camera {
  // ups: of each axis by its name a vector, and the direction to look from at first. fieldOfView: vertical, in degrees.
  constructor({ up, ups, look }) {
    this.half = Math.tan((look.fieldOfView * Math.PI) / 360);
    this.target = [0, 0, 0];
    this.distance = 3;
    this.stand(...ups[up]);
  }

  stand(up, from) {
    this.up = up;
    this.from = from;
    const axis = up.findIndex(Boolean);
    const next = up[axis] > 0 ? [1, 2] : [2, 1];
    this.sideways = next.map((step) => [0, 1, 2].map((i) => (i === (axis + step) % 3 ? 1 : 0)));
    this.lookFrom(from);
  }

  lookFrom(direction) {
    const towards = unit(direction);
    this.height = Math.asin(Math.min(1, Math.max(-1, dot(towards, this.up))));
    this.angle = Math.atan2(dot(towards, this.sideways[1]), dot(towards, this.sideways[0]));
    this.turn(0, 0);
  }

  get towards() {
    const level = add(scaled(this.sideways[0], Math.cos(this.angle)), scaled(this.sideways[1], Math.sin(this.angle)));
    return add(scaled(level, Math.cos(this.height)), scaled(this.up, Math.sin(this.height)));
  }

  get position() {
    return add(this.target, scaled(this.towards, this.distance));
  }

  // Unit vectors to the right, upwards and forward.
  get axes() {
    const forward = scaled(this.towards, -1);
    const right = unit(cross(forward, this.up));
    return [right, cross(right, forward), forward];
  }

  // Everything in view, from the first direction.
  frame(positions, aspect) {
    this.lookFrom(this.from);
    this.target = [0, 0, 0];
    const [right, above, forward] = this.axes;
    let farthest = 0;
    for (let i = 0; i < positions.length; i += 3) {
      const p = [positions[i], positions[i + 1], positions[i + 2]];
      const across = Math.max(Math.abs(dot(p, right)) / aspect, Math.abs(dot(p, above)));
      farthest = Math.max(farthest, across / this.half - dot(p, forward));
    }
    this.distance = 1.05 * farthest || 1;
  }

  turn(sideways, upwards) {
    this.angle += sideways;
    this.height = Math.min(STEEPEST, Math.max(-STEEPEST, this.height + upwards));
  }

  // By shares of the picture's height.
  move(rightwards, upwards) {
    const [right, above] = this.axes;
    const height = 2 * this.half * this.distance;
    this.target = add(this.target, add(scaled(right, rightwards * height), scaled(above, upwards * height)));
  }

  zoom(factor) {
    this.distance = Math.min(FARTHEST, Math.max(NEAREST, this.distance * factor));
  }

  place(position, target) {
    this.target = target;
    this.distance = Math.min(FARTHEST, Math.max(NEAREST, Math.hypot(...subtract(position, target))));
    this.lookFrom(subtract(position, target));
  }

  // The matrix to clip space, by columns.
  toClip(aspect) {
    const [right, above, forward] = this.axes;
    const eye = this.position;
    const middle = Math.hypot(...eye);
    const near = Math.max(middle - 1.01, this.distance / 1000);
    const far = Math.max(middle + 1.01, 2 * near);
    const [x, y] = [1 / (this.half * aspect), 1 / this.half];
    const [a, b] = [(far + near) / (far - near), (-2 * far * near) / (far - near)];
    const columns = [0, 1, 2].map((i) => [x * right[i], y * above[i], a * forward[i], forward[i]]);
    const moved = [-x * dot(right, eye), -y * dot(above, eye), b - a * dot(forward, eye), -dot(forward, eye)];
    return new Float32Array([...columns.flat(), ...moved]);
  }

  // Where the ray through a point of the picture goes; x and y in [−1, 1], y upwards.
  through(x, y, aspect) {
    const [right, above, forward] = this.axes;
    return unit(add(forward, add(scaled(right, x * aspect * this.half), scaled(above, y * this.half))));
  }

  // Where a point stands in the picture, in [−1, 1], y upwards; null behind the camera.
  project(point, aspect) {
    const [right, above, forward] = this.axes;
    const offset = subtract(point, this.position);
    const depth = dot(offset, forward);
    if (depth <= 0) return null;
    return [dot(offset, right) / (depth * this.half * aspect), dot(offset, above) / (depth * this.half)];
  }
}
