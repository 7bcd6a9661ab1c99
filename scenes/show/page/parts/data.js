// The mesh and its bakes, decoded from the page's own text. Positions are placed so that the bounding box has its centre
// at the origin and a half diagonal of 1; `centre` and `radius` lead back to the file's coordinates.

async function readMesh(about, base64) {
  const columns = splitColumns(about.columns, await decompressed(base64));
  const centre = about.low.map((low, axis) => low + 32767.5 * about.step[axis]);
  const radius = Math.hypot(...about.step.map((step) => 32767.5 * step)) || 1;
  const faces = facesOf(columns.faces);
  const bakes = about.bakes.map((bake, number) => ({
    ...bake,
    w: columns[`w${number}`],
    asBaked: columns[`w${number}`],
    columns: bake.weights && profileColumns(columns[`profile${number}`], about.vertices),
    error: columns[`error${number}`],
    flags: columns[`flags${number}`],
    bent: columns[`bent${number}`] && unitVectors(columns[`bent${number}`], 255),
    uv: bake.textures && coordinates(columns[`uv${number}`], bake),
    textures: (bake.textures ?? []).map((about, place) => ({ ...about, texels: summed(columns[`texels${number}.${place}`]) })),
  }));
  return {
    count: about.vertices,
    centre,
    radius,
    faces,
    ...drawnVertices(faces, about.vertices, columns),
    positions: placed(columns.positions, about.step, radius),
    bakes,
    base: await baseColours(about.base, columns),
  };
}

async function decompressed(base64) {
  const text = atob(base64);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Columns lie one after the other, each as planes: the lowest byte of all its numbers, then the second of all.
function splitColumns(described, bytes) {
  const columns = {};
  let start = 0;
  for (const [name, size, count] of described) {
    const column = new { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[size](count);
    for (let plane = 0; plane < size; plane++, start += count) {
      for (let i = 0; i < count; i++) column[i] |= bytes[start + i] << (8 * plane);
    }
    columns[name] = column;
  }
  return columns;
}

// Stored are the growth of each face's least vertex, and how far above it the two others lie.
function facesOf(stored) {
  const count = stored.length / 3;
  const faces = new Uint32Array(stored.length);
  let least = 0;
  for (let f = 0; f < count; f++) {
    least = (least + stored[f]) >>> 0;
    faces[3 * f] = least;
    faces[3 * f + 1] = least + stored[count + f];
    faces[3 * f + 2] = least + stored[2 * count + f];
  }
  return faces;
}

// What to draw: the file's vertices, and those at creases again for each further normal. `again` holds how far apart the
// corners are that have such a one, `further` which.
function drawnVertices(faces, count, { again, further, normals }) {
  const indices = Uint32Array.from(faces);
  const origin = Uint32Array.from({ length: normals.length / 2 }, (_, i) => i);
  let corner = 0;
  for (let i = 0; i < again.length; i++) {
    corner += again[i];
    indices[corner] = count + further[i];
    origin[indices[corner]] = faces[corner];
  }
  return { indices, origin, normals: unitVectors(normals, 65535) };
}

const coordinates = (stored, { uvLow, uvStep }) => Float32Array.from(stored, (each, i) => uvLow[i % 2] + each * uvStep[i % 2]);

// Texels are stored as the difference to the one before, modulo 256.
function summed(texels) {
  for (let i = 1; i < texels.length; i++) texels[i] += texels[i - 1];
  return texels;
}

function placed(stored, step, radius) {
  const positions = new Float32Array(stored.length);
  for (let i = 0; i < stored.length; i++) positions[i] = ((stored[i] - 32767.5) * step[i % 3]) / radius;
  return positions;
}

// From octahedral coordinates, all of the first and then all of the second; 0 stands for no vector.
function unitVectors(stored, most) {
  const count = stored.length / 2;
  const vectors = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    if (!stored[i]) continue;
    let x = (2 * (stored[i] - 1)) / (most - 1) - 1;
    let y = (2 * (stored[count + i] - 1)) / (most - 1) - 1;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
    const length = Math.sqrt(x * x + y * y + z * z);
    vectors[3 * i] = x / length;
    vectors[3 * i + 1] = y / length;
    vectors[3 * i + 2] = z / length;
  }
  return vectors;
}
