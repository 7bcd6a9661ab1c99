// What the mesh shows under the pointer: a number, and its place on the scale.

const STAY = 60; // milliseconds that the pointer stands before the mesh is asked

// The number that a mode shows where a ray hits: w, its error, or the difference of two.
function numberAt({ about, mesh }, mode, side, hit) {
  const weights = [1 - hit.u - hit.v, hit.u, hit.v];
  const corners = mesh.faces.subarray(hit.face, hit.face + 3);
  const mean = (value) => weights.reduce((sum, weight, k) => sum + weight * value(corners[k]), 0);
  const bake = mesh.bakes[side];
  if (mode === "error") return bake.errorTop * mean((vertex) => (bake.error[vertex] / 255) ** 2);
  const w = ({ uv, textures, w: stored }, number) => {
    const texture = textures[textureOf(about.draws, hit.face / 3, number)];
    return texture ? texel(texture, mean((i) => uv[2 * i]), mean((i) => uv[2 * i + 1])) : mean((i) => stored[i]) / 65535;
  };
  return mode === "difference" ? w(mesh.bakes[1], 1) - w(mesh.bakes[0], 0) : w(bake, side);
}

function textureOf(draws, face, side) {
  for (const [faces, ...textures] of draws) {
    if (face < faces) return textures[side];
    face -= faces;
  }
}

function texel({ width, height, wrap, texels }, u, v) {
  const [x, y] = [u, v].map((place, axis) => {
    if (wrap[axis] === "clamp_to_edge") return Math.min(1, Math.max(0, place));
    const share = place - Math.floor(place);
    return wrap[axis] === "mirrored_repeat" && Math.floor(place) % 2 ? 1 - share : share;
  });
  return texels[Math.min(height - 1, Math.floor(y * height)) * width + Math.min(width - 1, Math.floor(x * width))] / 255;
}

function hover(page, x, y) {
  clearTimeout(page.hovering);
  at("hover").hidden = true;
  if (x !== undefined) page.hovering = setTimeout(() => showHover(page, x, y), STAY);
}

function showHover(page, x, y) {
  const place = page.inPicture(x, y);
  const { mode } = page.state;
  const hit = firstHit(page.mesh, page.camera.position, page.camera.through(...place, page.aspect));
  if (hit.face < 0) return;
  const number = numberAt(page, mode, page.sideAt(place[0]), hit);
  const { colours, low, high, name } = scaleOf(page, mode);
  const digits = mode === "error" ? short(number) : number.toFixed(3);
  const box = page.canvas.getBoundingClientRect();
  at("hoverValue").textContent = `${name} ${digits}`;
  at("hoverScale").style.background = gradient(colours);
  at("hoverTick").style.left = `${100 * Math.min(1, Math.max(0, (number - low) / (high - low)))}%`;
  at("hoverLow").textContent = short(low);
  at("hoverHigh").textContent = short(high);
  at("hover").hidden = false;
  at("hover").style.left = `${Math.min(x - box.left + 14, box.width - at("hover").offsetWidth - 4)}px`;
  at("hover").style.top = `${Math.min(y - box.top + 18, box.height - at("hover").offsetHeight - 4)}px`;
}
