// Mouse and touch on the canvas and keys of the page, as turns and moves of the camera and calls of `actions`.

const TURN = 0.008; // radians a pixel
const KEY_TURN = Math.PI / 36;
const KEY_MOVE = 0.05;
const STILL = 4; // pixels that a click may move

function listen(canvas, camera, actions) {
  const pointers = new Map();
  let travelled = 0;

  const point = (event) => [event.clientX, event.clientY];
  const middle = () => [0, 1].map((i) => [...pointers.values()].reduce((sum, p) => sum + p[i], 0) / pointers.size);
  const spreadOf = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    actions.hover();
    if (!pointers.size) travelled = 0;
    pointers.set(event.pointerId, point(event));
  });

  canvas.addEventListener("pointermove", (event) => {
    if (!pointers.size && event.pointerType === "mouse") actions.hover(...point(event));
    if (!pointers.has(event.pointerId)) return;
    const two = pointers.size === 2;
    const before = middle();
    const apart = two ? spreadOf() : 1;
    pointers.set(event.pointerId, point(event));
    const now = middle();
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    travelled += two ? STILL : Math.hypot(dx, dy);
    if (two) camera.zoom(apart / spreadOf());
    if (two || event.shiftKey || event.buttons & 6) camera.move(-dx / canvas.clientHeight, dy / canvas.clientHeight);
    else camera.turn(-TURN * dx, TURN * dy);
    actions.moved(true);
  });

  const lift = (event) => {
    const held = pointers.delete(event.pointerId);
    if (held && !pointers.size) actions.released();
    if (held && !pointers.size && event.type === "pointerup" && event.button === 0 && travelled <= STILL) {
      actions.pick(...point(event));
    }
  };
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("pointerleave", () => actions.hover());
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", (event) => actions.turnAbout(...point(event)));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : event.ctrlKey ? 8 : 1; // Ctrl: a trackpad's pinch
    camera.zoom(Math.exp(Math.max(-240, Math.min(240, event.deltaY * unit)) * 0.0015));
    actions.moved();
  }, { passive: false });

  const moves = {
    ArrowLeft: [-1, 0],
    ArrowRight: [1, 0],
    ArrowUp: [0, 1],
    ArrowDown: [0, -1],
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || keepsKey(event)) return;
    if (moves[event.key]) {
      const [x, y] = moves[event.key];
      event.shiftKey ? camera.move(KEY_MOVE * x, KEY_MOVE * y) : camera.turn(KEY_TURN * x, KEY_TURN * y);
      actions.moved();
    } else if (event.key === "+" || event.key === "=") {
      camera.zoom(1 / 1.15);
      actions.moved();
    } else if (event.key === "-") {
      camera.zoom(1.15);
      actions.moved();
    } else if (!actions.key(event.key)) return;
    event.preventDefault();
  });
}

// Whether a key is for what has the focus: any in a field for text, those of a control to which the Tab key led.
function keepsKey({ target, key }) {
  if (target.matches("input[type=number], input[type=text]")) return true;
  return key.length > 1 && target.matches("input:focus-visible, select:focus-visible, button:focus-visible, summary:focus-visible");
}

// A line that the pointer moves anywhere along it: `moved` gets its place, a share of the width.
function listenToLine(line, moved, released) {
  line.addEventListener("pointerdown", (event) => line.setPointerCapture(event.pointerId));
  line.addEventListener("pointermove", (event) => {
    if (!line.hasPointerCapture(event.pointerId)) return;
    const { left, width } = line.parentElement.getBoundingClientRect();
    moved(Math.min(1, Math.max(0, (event.clientX - left) / width)));
  });
  line.addEventListener("lostpointercapture", released);
}

// Controls give the focus back once the mouse has used them, so that arrows turn the mesh again.
function listenToPanel(panel, canvas) {
  const giveBack = () => document.activeElement.matches("input[type=number], select") || canvas.focus();
  panel.addEventListener("click", (event) => event.detail && giveBack()); // 0 of a click by a key
  panel.addEventListener("pointerup", () => setTimeout(giveBack)); // a label's control gets the focus later
}
