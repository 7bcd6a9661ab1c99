// The page: its state, and what follows from it.

const MODES = {
  clay: { number: 0, label: "clay × w" },
  w: { number: 1, label: "w" },
  colour: { number: 6, label: "base colour × w" },
  error: { number: 2, label: "error" },
  flags: { number: 3, label: "flags" },
  bent: { number: 4, label: "bent normals" },
  difference: { number: 5, label: "difference" },
};
const WAIT = 150; // milliseconds after a move before the address changes

const at = (id) => document.getElementById(id);
const grouped = (number) => number.toLocaleString("en-US");
const short = (number) => String(Number(number.toPrecision(2)));

class Page {
  constructor(about, mesh) {
    this.about = about;
    this.mesh = mesh;
    this.canvas = at("view");
    this.camera = new Camera(about);
    this.surface = new Surface(this.canvas, mesh, about);
    this.state = { mode: "clay", up: about.up, split: 0.5, vertex: null, scheme: null, distance: null, ...AS_BAKED };
    this.distance = new Distance(this);
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    describe(this);
    addModes(this);
    this.connect();
    this.resize();
    this.frame();
    readAddress(this);
    this.draw();
  }

  get aspect() {
    return this.canvas.width / this.canvas.height;
  }

  get scheme() {
    return this.state.scheme ?? (this.dark.matches ? "dark" : "light");
  }

  // Why a mode has nothing to show; null if it has.
  missing(mode) {
    const { bakes } = this.mesh;
    if (mode === "colour") return this.mesh.base ? null : this.about.baseMissing ?? "";
    if (mode === "difference") return bakes.length > 1 ? null : "there is one bake only";
    const needed = { error: "error", flags: "flags", bent: "bent" }[mode];
    return !needed || bakes.every((bake) => bake[needed]) ? null : "the file does not hold them";
  }

  connect() {
    listen(this.canvas, this.camera, {
      moved: (held) => this.moved(held),
      released: () => this.released(),
      hover: (x, y) => hover(this, x, y),
      pick: (x, y) => this.pick(x, y),
      turnAbout: (x, y) => this.turnAbout(x, y),
      key: (key) => this.key(key),
    });
    listenToPanel(at("panel"), this.canvas);
    listenToPanel(at("comparison"), this.canvas);
    listenToLine(at("line"), (split) => this.slide(split, true), () => this.released());
    for (const name of Object.keys(AS_BAKED)) at(name).addEventListener("input", () => this.setTone(name, Number(at(name).value)));
    at("fit").addEventListener("click", () => this.set(fittedRange(this.mesh)));
    at("baked").addEventListener("click", () => this.set(AS_BAKED));
    at("save").addEventListener("click", () => this.save());
    at("vertex").addEventListener("change", () => this.pickNumber(at("vertex").value));
    at("up").append(...Object.keys(this.about.ups).map((name) => new Option(name)));
    at("up").addEventListener("change", () => {
      this.stand(at("up").value);
      this.home();
    });
    at("home").addEventListener("click", () => this.home());
    at("scheme").addEventListener("click", () => this.toggleScheme());
    at("split").addEventListener("input", () => this.slide(at("split").value / 1000, false));
    this.dark.addEventListener("change", () => this.changed());
    addEventListener("hashchange", () => {
      readAddress(this);
      this.changed();
    });
    new ResizeObserver(() => {
      this.resize();
      if (JSON.stringify(this.camera) === this.framed) this.frame();
      this.draw();
    }).observe(this.canvas);
  }

  key(key) {
    const mode = Object.keys(MODES).find((each) => MODES[each].number === Number(key) - 1);
    const actions = {
      0: () => this.home(),
      Enter: () => this.pickAt(0, 0),
      "[": () => this.nextFlagged(-1),
      "]": () => this.nextFlagged(1),
      b: () => this.toggleScheme(),
      p: () => this.save(),
      f: () => this.state.vertex !== null && this.centreOn(this.position(this.state.vertex)),
    };
    const action = mode ? () => this.missing(mode) ?? this.set({ mode }) : actions[key.toLowerCase()] ?? actions[key];
    if (action) action();
    return Boolean(action);
  }

  set(change) {
    Object.assign(this.state, change);
    this.said = undefined; // a control may show what is no longer so before anything is drawn
    this.changed();
  }

  changed() {
    this.waiting ??= requestAnimationFrame(() => this.draw());
    clearTimeout(this.writing);
    this.writing = setTimeout(() => this.rest(), this.coarse ? 2 * WAIT : WAIT);
  }

  rest() {
    writeAddress(this);
    if (!(this.coarse || this.hasty) || this.held) return;
    this.coarse = this.hasty = false;
    this.draw();
  }

  // The camera or a slider has moved; while that goes on, slow pictures are hasty and small, of large meshes coarse. held: by a
  // pointer that is down.
  moved(held) {
    this.held = held;
    this.hasty = Boolean(held && this.slow);
    this.coarse = Boolean(this.slow && this.mesh.faces.length >= 3 * MANY);
    this.changed();
  }

  released() {
    this.held = false;
    if (this.coarse || this.hasty) this.changed();
  }

  slide(split, held) {
    this.state.split = split;
    this.moved(held);
  }

  // Black stays below white.
  setTone(name, value) {
    const tone = { ...this.state, [name]: value };
    if (name === "low") tone.high = Math.max(tone.high, value + 0.05);
    if (name === "high") tone.low = Math.min(tone.low, value - 0.05);
    this.set({ low: Number(tone.low.toFixed(2)), high: Number(tone.high.toFixed(2)), strength: tone.strength });
  }

  // The picture as a PNG file, whole.
  save() {
    this.coarse = this.hasty = this.held = false;
    this.draw();
    this.canvas.toBlob((blob) => {
      const link = Object.assign(document.createElement("a"), { download: `${this.about.title}.png`, href: URL.createObjectURL(blob) });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  // Everything in view, and again when the window changes, until the camera moves.
  frame() {
    this.camera.frame(this.mesh.positions, this.aspect);
    this.framed = JSON.stringify(this.camera);
  }

  home() {
    this.frame();
    this.changed();
  }

  stand(up) {
    if (up !== this.state.up) this.camera.stand(...this.about.ups[up]);
    this.state.up = at("up").value = up;
  }

  toggleScheme() {
    this.set({ scheme: this.scheme === "dark" ? "light" : "dark" });
  }

  resize() {
    const ratio = (devicePixelRatio || 1) / (this.hasty ? 3 : 1);
    this.small = this.hasty;
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
  }

  // ---- picking

  inPicture(x, y) {
    const box = this.canvas.getBoundingClientRect();
    return [(2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height];
  }

  pick(x, y) {
    this.pickAt(...this.inPicture(x, y));
  }

  sideAt(x) {
    return this.mesh.bakes.length > 1 && (x + 1) / 2 > this.state.split ? 1 : 0;
  }

  pickAt(...place) {
    const { flags } = this.mesh.bakes[this.sideAt(place[0])];
    const reach = 20 / this.canvas.clientHeight;
    let vertex = this.state.mode === "flags" ? dotAt(this.mesh, flags, this.camera, ...place, this.aspect, reach) : null;
    vertex ??= vertexAt(this.mesh, this.camera, ...place, this.aspect)?.vertex ?? null;
    this.set({ vertex });
  }

  pickNumber(text) {
    const number = Number(text);
    const known = text !== "" && Number.isInteger(number) && number >= 0 && number < this.mesh.count;
    this.set({ vertex: known ? number : null });
    if (text !== "" && !known) this.unknown = `No vertex ${text}: 0 to ${this.mesh.count - 1}.`;
  }

  nextFlagged(step) {
    const flagged = (vertex) => this.mesh.bakes.some((bake) => bake.flags?.[vertex]);
    const { count } = this.mesh;
    let vertex = this.state.vertex ?? (step > 0 ? -1 : count);
    for (let tried = 0; tried < count; tried++) {
      vertex = (vertex + step + count) % count;
      if (flagged(vertex)) return this.set({ vertex });
    }
  }

  turnAbout(x, y) {
    const hit = vertexAt(this.mesh, this.camera, ...this.inPicture(x, y), this.aspect);
    if (hit) this.centreOn(hit.point);
  }

  centreOn(point) {
    this.camera.target = point;
    this.changed();
  }

  position(vertex) {
    return [...this.mesh.positions.subarray(3 * vertex, 3 * vertex + 3)];
  }

  // ---- showing

  draw() {
    this.waiting = undefined;
    const { mode } = this.state;
    const { look } = this.about;
    const shown = this.shown = mode === "error" ? Math.max(...this.mesh.bakes.map((bake) => bake.errorShown)) : this.about.differenceShown;
    const ramp = mode === "difference" ? look.difference : look.heat;
    document.documentElement.dataset.scheme = this.scheme;
    hover(this);
    this.distance.show();
    if (this.small !== this.hasty) this.resize();
    const state = { ...this.state, coarse: this.coarse, hasty: this.hasty, mode: MODES[mode].number, shown, ramp, scheme: this.scheme };
    if (this.coarse || this.hasty) this.surface.draw(this.camera, state);
    else this.surface.timed(this.camera, state).then((took) => (this.slow = took > SLOW));
    const { split, low, high, strength } = this.state;
    const said = [mode, this.scheme, split, low, high, strength].join();
    if (said !== this.said) showPanel(this, mode, shown);
    this.said = said;
    showMark(this);
    const { dataset } = document.documentElement;
    dataset.coarse = Boolean(this.coarse);
    dataset.triangles = this.surface.triangles;
    dataset.firstPicture ??= Math.round(performance.now()); // milliseconds since the page was opened
  }

}

function fail(reason) {
  at("failure").textContent = `This page cannot be shown: ${reason}`;
  at("failure").hidden = false;
}

async function open() {
  try {
    const about = JSON.parse(at("about").textContent);
    new Page(about, await readMesh(about, at("data").textContent));
  } catch (failure) {
    fail(failure.message);
    console.error(failure);
  }
}

at("view").addEventListener("webglcontextlost", () => fail("the browser has taken the graphics card away. Load it again."));
open();
