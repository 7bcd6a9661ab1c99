// Which vertex is under a point of the picture.

// The nearest face that a ray meets: its row times three, the distance, and the weights of its second and third corner.
function firstHit({ positions, faces }, from, direction) {
  const best = { face: -1, distance: Infinity, u: 0, v: 0 };
  const [dx, dy, dz] = direction;
  for (let f = 0; f < faces.length; f += 3) {
    // Moeller & Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection".
    const [a, b, c] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const ax = positions[a], ay = positions[a + 1], az = positions[a + 2];
    const ex = positions[b] - ax, ey = positions[b + 1] - ay, ez = positions[b + 2] - az;
    const gx = positions[c] - ax, gy = positions[c + 1] - ay, gz = positions[c + 2] - az;
    const px = dy * gz - dz * gy, py = dz * gx - dx * gz, pz = dx * gy - dy * gx;
    const scale = ex * px + ey * py + ez * pz;
    if (scale === 0) continue;
    const tx = from[0] - ax, ty = from[1] - ay, tz = from[2] - az;
    const u = (tx * px + ty * py + tz * pz) / scale;
    if (u < 0 || u > 1) continue;
    const qx = ty * ez - tz * ey, qy = tz * ex - tx * ez, qz = tx * ey - ty * ex;
    const v = (dx * qx + dy * qy + dz * qz) / scale;
    if (v < 0 || u + v > 1) continue;
    const distance = (gx * qx + gy * qy + gz * qz) / scale;
    if (distance > 0 && distance < best.distance) Object.assign(best, { face: f, distance, u, v });
  }
  return best;
}

// The vertex nearest to where the ray through (x, y) meets the mesh, and that point; null where it meets nothing.
function vertexAt(mesh, camera, x, y, aspect) {
  const direction = camera.through(x, y, aspect);
  const { face, distance, u, v } = firstHit(mesh, camera.position, direction);
  if (face < 0) return null;
  const weights = [1 - u - v, u, v];
  const vertex = mesh.faces[face + weights.indexOf(Math.max(...weights))];
  return { vertex, point: add(camera.position, scaled(direction, distance)) };
}

// The flagged vertex whose dot is nearest to (x, y), if within `reach` half heights of the picture.
function dotAt(mesh, flags, camera, x, y, aspect, reach) {
  let found = null;
  for (let vertex = 0; vertex < mesh.count; vertex++) {
    if (!flags[vertex]) continue;
    const place = camera.project(mesh.positions.slice(3 * vertex, 3 * vertex + 3), aspect);
    const away = place ? Math.hypot((place[0] - x) * aspect, place[1] - y) : Infinity;
    if (away < reach) [found, reach] = [vertex, away];
  }
  return found;
}
