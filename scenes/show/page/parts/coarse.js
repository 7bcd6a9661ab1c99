// A mesh of few triangles to turn while the whole takes long to draw: one vertex for each cell of a grid.

const CELLS = 128; // along the diagonal of the bounding box
const MANY = 200000; // triangles below which the whole is always drawn
const SLOW = 50; // milliseconds

// The faces whose corners lie in three cells, between the vertices nearest to the cells' centres. Args: draws: runs of faces.
function coarseFaces({ positions, indices, origin }, draws) {
  const along = (x) => Math.min(CELLS - 1, Math.floor(((x + 1) / 2) * CELLS));
  const nearest = new Uint32Array(CELLS ** 3);
  const away = new Float32Array(CELLS ** 3).fill(Infinity);
  const cells = new Uint32Array(positions.length / 3);
  for (let i = 0; i < cells.length; i++) {
    let [cell, distance] = [0, 0];
    for (let axis = 0; axis < 3; axis++) {
      const x = positions[3 * i + axis];
      const place = along(x);
      cell = CELLS * cell + place;
      distance += (x - (2 * (place + 0.5)) / CELLS + 1) ** 2;
    }
    cells[i] = cell;
    if (distance < away[cell]) [away[cell], nearest[cell]] = [distance, i];
  }
  const kept = new Uint32Array(indices.length);
  let [first, count] = [0, 0];
  const runs = draws.map((draw) => {
    const start = count;
    for (const end = first + draw.corners; first < end; first += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => cells[origin[indices[first + k]]]);
      if (a === b || b === c || c === a) continue;
      kept[count++] = nearest[a];
      kept[count++] = nearest[b];
      kept[count++] = nearest[c];
    }
    return { ...draw, corners: count - start };
  });
  return { indices: kept.slice(0, count), draws: runs };
}
