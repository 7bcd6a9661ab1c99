// The half-distance: w of bakes with a profile follows a slider, with its histogram and the command that bakes it.

const BINS = 64;

class Distance {
  constructor(page) {
    this.page = page;
    this.all = page.mesh.bakes.filter(({ columns }) => columns);
    const [first] = this.all;
    at("falloff").hidden = !first;
    if (!first) return;
    this.steps = first.halfDistances;
    this.bakes = this.all.filter(({ halfDistances }) => String(halfDistances) === String(this.steps));
    at("distance").max = this.steps.length - 1;
    this.near = this.nearest(first);
    at("distance").addEventListener("input", () => this.set(Number(at("distance").value), true));
    at("distance").addEventListener("change", () => page.released());
    at("baked").addEventListener("click", () => this.set(null, false));
    at("copy").addEventListener("click", () => {
      at("permanent").select();
      document.execCommand("copy"); // which a page from disk and one in a frame may do, too
    });
  }

  set(step, held) {
    this.page.state.distance = step;
    this.page.moved(held);
  }

  // The step whose mean w is nearest to that of the bake, which may have another falloff.
  nearest({ w, columns, weights }) {
    const mean = (numbers) => numbers.reduce((sum, each) => sum + each, 0) / numbers.length;
    const [target, means] = [mean(w), columns.map((column) => 257 * mean(column))];
    const off = weights.map((row) => Math.abs(row.reduce((sum, weight, k) => sum + weight * means[k], -target)));
    return off.indexOf(Math.min(...off));
  }

  // As the address and the command have it, all digits at the ends of the range.
  text(step, unit) {
    const digits = step % (this.steps.length - 1) ? 3 : 9;
    return String(Number((this.steps[step] / unit).toPrecision(digits)));
  }

  read(given) {
    const off = this.steps?.map((each) => Math.abs(Math.log(each / given)));
    return off && given > 0 && Math.min(...off) < 0.1 ? off.indexOf(Math.min(...off)) : null;
  }

  show() {
    const { state, surface, mesh, scheme } = this.page;
    if (!this.steps) return;
    const step = state.distance;
    if (step !== this.step) {
      for (const bake of this.bakes) {
        bake.w = step === null ? bake.asBaked : mixed(bake.columns, bake.weights[step]);
        surface.setW(mesh.bakes.indexOf(bake), bake.w);
      }
    }
    if (step === this.step && scheme === this.scheme) return;
    [this.step, this.scheme] = [step, scheme];
    const [{ radius, permanent, w }] = this.bakes;
    at("distance").value = step ?? this.near;
    const percent = this.text(step ?? this.near, radius / 100);
    at("distanceValue").textContent = step === null ? `as baked, near ${percent} %` : `${this.text(step, 1)}, ${percent} % of the radius`;
    at("permanent").value = permanent.replace("{}", `${percent}%`);
    this.drawHistogram(w);
  }

  drawHistogram(w) {
    const counts = new Float32Array(BINS);
    for (let i = 0; i < w.length; i++) counts[(w[i] * BINS) >> 16] += 1;
    const { width, height } = at("histogram");
    const context = at("histogram").getContext("2d");
    context.clearRect(0, 0, width, height);
    context.fillStyle = getComputedStyle(at("falloff")).color;
    const [most, bar] = [Math.max(...counts), width / BINS];
    counts.forEach((count, bin) => context.fillRect(bin * bar, height, bar - 1, -height * Math.sqrt(count / most)));
  }
}

// Stored are differences to the column before, modulo 256.
function profileColumns(stored, count) {
  for (let i = count; i < stored.length; i++) stored[i] += stored[i - count];
  return Array.from({ length: stored.length / count }, (_, k) => stored.subarray(k * count, (k + 1) * count));
}

// The weighted sum of the columns, in 16 bits.
function mixed(columns, weights) {
  const sums = new Float32Array(columns[0].length).fill(0.5);
  columns.forEach((column, k) => {
    for (let i = 0; i < sums.length; i++) sums[i] += 257 * weights[k] * column[i];
  });
  return Uint16Array.from(sums, (sum) => Math.min(65535, Math.max(0, sum)));
}
