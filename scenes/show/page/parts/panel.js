// What the panel says of the mesh and of what is shown: modes, legend, range of w, the other scheme, the slider, a vertex.

const AS_BAKED = { low: 0, high: 1, strength: 1 };

function showPanel(page, mode, shown) {
  const { state } = page;
  for (const radio of at("modes").querySelectorAll("input")) radio.checked = radio.value === mode;
  at("scheme").textContent = page.scheme === "dark" ? "Light" : "Dark";
  at("split").value = 1000 * state.split;
  at("line").style.left = `${100 * state.split}%`;
  at("comparison").classList.toggle("whole", mode === "difference");
  at("tone").hidden = !["clay", "w", "colour"].includes(mode);
  for (const name of Object.keys(AS_BAKED)) {
    at(name).value = state[name];
    at(`${name}Value`).textContent = Number(state[name]).toFixed(2);
  }
  at("legend").hidden = ["clay", "colour"].includes(mode);
  at("legend").className = mode;
  at("scale").style.background = gradient(scaleOf(page, mode).colours);
  const ticks = (...texts) => at("ticks").replaceChildren(...texts.map((text) => span(text)));
  if (mode === "w") ticks(state.low > 0 ? `≤ ${state.low}` : "0 closed", "w", state.high < 1 ? `≥ ${state.high}` : "1 open");
  else if (mode === "error") ticks("0", "standard error of w", `≥ ${short(shown)}`);
  else if (mode === "difference") ticks(`−${short(shown)}`, "second − first", `+${short(shown)}`);
  else if (mode === "flags") {
    at("ticks").replaceChildren(...page.about.flags.map(([name, colour], bit) => flagRow(page, name, colour, 1 << bit)));
  } else if (mode === "bent") ticks("red x, green y, blue z, each from −1 to 1");
}

// The colours of a mode's numbers from `low` to `high`.
function scaleOf({ about, state, shown }, mode) {
  if (mode === "error") return { name: "error", low: 0, high: shown, colours: about.look.heat };
  if (mode === "difference") return { name: "difference", low: -shown, high: shown, colours: about.look.difference };
  const colours = Array.from({ length: 17 }, (_, i) => grey((i / 16) ** state.strength));
  return { name: "w", low: state.low, high: state.high, colours };
}

const gradient = (colours) => `linear-gradient(to right, ${colours.join(", ")})`;

// The range that all but a hundredth of w above and below lies in.
function fittedRange({ bakes }) {
  const counts = new Uint32Array(101);
  for (const { w, textures } of bakes) {
    if (textures.length) textures.forEach(({ texels }) => texels.forEach((code) => counts[Math.round(code / 2.55)]++));
    else w.forEach((code) => counts[Math.round(code / 655.35)]++);
  }
  const all = counts.reduce((sum, count) => sum + count, 0);
  let [sum, low, high] = [0, 0, 100];
  counts.forEach((count, step) => {
    if (sum <= 0.01 * all) low = step;
    if (sum < 0.99 * all) high = step;
    sum += count;
  });
  low = Math.min(low, 95);
  return { low: low / 100, high: Math.max(high, low + 5) / 100 };
}

function flagRow(page, name, colour, bit) {
  const row = span("");
  const dot = span("");
  dot.className = "dot";
  dot.style.background = colour;
  const counts = page.mesh.bakes.map(({ flags }) => grouped(flags.reduce((sum, each) => sum + Boolean(each & bit), 0)));
  row.append(dot, `${name}: ${counts.join(" | ")}`);
  return row;
}

function span(text) {
  return Object.assign(document.createElement("span"), { textContent: text });
}

function grey(light) {
  const value = Math.round(255 * encodedSrgb(light));
  return `rgb(${value}, ${value}, ${value})`;
}

function describe(page) {
  const { count, faces, bakes } = page.mesh;
  const rmse = bakes.filter((bake) => bake.error).map((bake) => short(bake.rmse));
  const error = rmse.length ? `\nRMSE ${rmse.join(" | ")}` : "";
  const sizes = bakes.flatMap(({ textures }) => textures.map(({ width, height }) => `${width} × ${height}`));
  const texels = sizes.length ? `\nw in textures: ${[...new Set(sizes)].join(", ")} texels` : "";
  at("facts").textContent = `${grouped(count)} vertices, ${grouped(faces.length / 3)} faces${texels}${error}`;
  at("warning").textContent = bakes.map(({ warning }) => warning).join("");
  at("warning").hidden = !at("warning").textContent;
  at("vertex").max = count - 1;
  if (page.mesh.bakes.length > 1) {
    at("comparison").hidden = false;
    ["left", "right"].forEach((side, number) => (at(side).textContent = page.mesh.bakes[number].name));
  }
}

function addModes(page) {
  for (const [mode, { number, label }] of Object.entries(MODES)) {
    const reason = page.missing(mode);
    if (reason === "" || (reason && mode === "difference")) continue;
    const radio = Object.assign(document.createElement("input"), { type: "radio", name: "mode", value: mode });
    const row = document.createElement("label");
    radio.disabled = Boolean(reason);
    row.title = reason ?? `key ${number + 1}`;
    row.append(radio, label);
    if (reason) row.append(` (${reason})`);
    radio.addEventListener("change", () => page.set({ mode }));
    at("modes").append(row);
  }
}

function valueOf(page, bake, vertex) {
  const w = (bake.w[vertex] / 65535).toFixed(4);
  const error = bake.error && bake.w === bake.asBaked ? ` ± ${short(bake.errorTop * (bake.error[vertex] / 255) ** 2)}` : "";
  const flags = page.about.flags.filter((_, bit) => bake.flags?.[vertex] & (1 << bit)).map(([name]) => name);
  return `w ${w}${error}${flags.length ? `, ${flags.join(", ")}` : ""}`;
}

function showMark(page) {
  const { vertex } = page.state;
  const place = vertex === null ? null : page.camera.project(page.position(vertex), page.aspect);
  const mark = at("mark");
  mark.hidden = !place;
  if (place) {
    mark.style.left = `${50 * (place[0] + 1)}%`;
    mark.style.top = `${50 * (1 - place[1])}%`;
  }
  const { bakes } = page.mesh;
  const name = ({ name }) => (bakes.length > 1 ? `${name}: ` : "");
  const values = vertex === null ? [] : bakes.map((bake) => name(bake) + valueOf(page, bake, vertex));
  at("picked").textContent = values.length ? values.join("\n") : page.unknown ?? "Click the mesh, or type a number.";
  page.unknown = undefined;
  if (document.activeElement !== at("vertex")) at("vertex").value = vertex ?? "";
}
