// The address: what is shown, and the camera in the file's coordinates.

function readAddress(page) {
  const { mesh, state } = page;
  const given = new URLSearchParams(location.hash.slice(1));
  const up = given.get("up") ?? page.about.up;
  if (Object.hasOwn(page.about.ups, up)) page.stand(up);
  const point = (name) => {
    const numbers = (given.get(name) ?? "").split(",").map(Number);
    return numbers.length === 3 && numbers.every(Number.isFinite) ? scaled(subtract(numbers, mesh.centre), 1 / mesh.radius) : null;
  };
  const [position, target] = [point("position"), point("target")];
  if (position && target && Math.hypot(...subtract(position, target)) > 0) page.camera.place(position, target);
  const mode = given.get("mode");
  if (Object.hasOwn(MODES, mode) && page.missing(mode) === null) state.mode = mode;
  const split = Number(given.get("split") ?? NaN);
  if (split >= 0 && split <= 1) state.split = split;
  const [low, high] = (given.get("range") ?? "").split(",").map(Number);
  if (low >= 0 && high <= 1 && high - low >= 0.05) Object.assign(state, { low, high });
  const strength = Number(given.get("strength") ?? NaN);
  if (strength >= 1 && strength <= 8) state.strength = strength;
  state.distance = page.distance.read(Number(given.get("half-distance")));
  const vertex = given.get("vertex") ?? "";
  if (/^\d+$/.test(vertex) && Number(vertex) < mesh.count) state.vertex = Number(vertex);
  if (["dark", "light"].includes(given.get("scheme"))) state.scheme = given.get("scheme");
}

function writeAddress({ about, mesh, camera, state, distance }) {
  const far = Math.max(...mesh.centre.map(Math.abs)) / mesh.radius; // away from the origin digits are lost
  const digits = Math.min(17, Math.ceil(8 + Math.log10(1 + far)));
  const text = (point) => add(scaled(point, mesh.radius), mesh.centre).map((x) => Number(x.toPrecision(digits))).join(",");
  const written = [`mode=${state.mode}`, `position=${text(camera.position)}`, `target=${text(camera.target)}`];
  if (state.up !== about.up) written.push(`up=${state.up}`);
  if (mesh.bakes.length > 1) written.push(`split=${state.split}`);
  if (state.low > 0 || state.high < 1) written.push(`range=${state.low},${state.high}`);
  if (state.strength !== 1) written.push(`strength=${state.strength}`);
  if (state.distance !== null) written.push(`half-distance=${distance.text(state.distance, 1)}`);
  if (state.vertex !== null) written.push(`vertex=${state.vertex}`);
  if (state.scheme) written.push(`scheme=${state.scheme}`);
  if (location.protocol !== "about:") history.replaceState(null, "", `#${written.join("&")}`);
}
