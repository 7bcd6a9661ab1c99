// What the panel says of what is shown: the mode, its legend, the other scheme, the slider.

function showPanel(page, mode, shown, ramp) {
  for (const radio of at("modes").querySelectorAll("input")) radio.checked = radio.value === mode;
  at("scheme").textContent = page.scheme === "dark" ? "Light" : "Dark";
  at("split").value = 1000 * page.state.split;
  at("line").style.left = `${100 * page.state.split}%`;
  at("comparison").classList.toggle("whole", mode === "difference");
  at("legend").hidden = mode === "clay";
  const scale = at("scale");
  scale.style.background = "";
  const gradient = (colours) => (scale.style.background = `linear-gradient(to right, ${colours.join(", ")})`);
  const ticks = (...texts) => at("ticks").replaceChildren(...texts.map((text) => span(text)));
  at("legend").className = mode;
  if (mode === "w") {
    gradient(Array.from({ length: 17 }, (_, i) => grey(i / 16)));
    ticks("0 closed", "w", "1 open");
  } else if (mode === "error") {
    gradient(ramp);
    ticks("0", "standard error of w", `≥ ${short(shown)}`);
  } else if (mode === "difference") {
    gradient(ramp);
    ticks(`−${short(shown)}`, "second − first", `+${short(shown)}`);
  } else if (mode === "flags") {
    at("ticks").replaceChildren(...page.about.flags.map(([name, colour], bit) => flagRow(page, name, colour, 1 << bit)));
  } else if (mode === "bent") ticks("red x, green y, blue z, each from −1 to 1");
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
