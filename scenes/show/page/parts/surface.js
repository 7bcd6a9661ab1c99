// The mesh on the graphics card, and its drawing.

const ATTRIBUTES = ["position", "normal", "bent", "w", "otherW", "error", "colour", "place", "otherPlace", "base", "baseUv", "alpha"];

class Surface {
  constructor(canvas, mesh, about) {
    this.gl = canvas.getContext("webgl2", { antialias: false, depth: false, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error("WebGL 2 is not to be had in this browser.");
    this.target = new Target(this.gl);
    this.look = about.look;
    this.surfaceProgram = this.program("surface");
    this.dotsProgram = this.program("dots");
    const shared = {
      position: this.buffer(spread(mesh.positions, mesh.origin, 3)),
      normal: this.buffer(mesh.normals),
      index: this.buffer(mesh.indices, this.gl.ELEMENT_ARRAY_BUFFER),
      base: mesh.base && this.buffer(mesh.base.colours),
      baseUv: mesh.base?.uv && this.buffer(mesh.base.uv),
      alpha: mesh.base?.alpha && this.buffer(mesh.base.alpha),
    };
    this.gl.vertexAttrib1f(ATTRIBUTES.indexOf("alpha"), 1); // unless the mesh has some
    this.mesh = mesh;
    this.whole = shared.index;
    const values = mesh.bakes.map(({ w, error, bent, uv }) => ({
      w: this.buffer(spread(w, mesh.origin, 1)),
      error: error && this.buffer(spread(error, mesh.origin, 1)),
      bent: bent && this.buffer(spread(bent, mesh.origin, 3)),
      place: uv && this.buffer(spread(uv, mesh.origin, 2)),
    }));
    this.values = values;
    const textures = mesh.bakes.map((bake) => bake.textures.map((each) => this.texture(each)));
    const images = (mesh.base?.images ?? []).map((each) => this.texture(each));
    this.draws = about.draws.map(([faces, ...used]) => ({
      corners: 3 * faces,
      image: images[used.pop()],
      pages: used.map((k, bake) => textures[bake][k]),
    }));
    this.sides = mesh.bakes.map((bake, number) => ({
      number,
      errorTop: bake.errorTop,
      surface: this.surfaceArrays(shared, values[number], values[values.length - 1]),
      dots: this.dots(mesh, bake, about.flags),
    }));
  }

  program(name) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [ending, kind] of [["vert", gl.VERTEX_SHADER], ["frag", gl.FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, document.getElementById(`${name}.${ending}`).textContent.trim());
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ATTRIBUTES.forEach((attribute, place) => gl.bindAttribLocation(program, place, attribute));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name: uniform } = gl.getActiveUniform(program, i);
      uniforms[uniform.replace("[0]", "")] = gl.getUniformLocation(program, uniform);
    }
    return { program, uniforms };
  }

  buffer(array, target = this.gl.ARRAY_BUFFER) {
    const buffer = this.gl.createBuffer();
    this.gl.bindVertexArray(null);
    this.gl.bindBuffer(target, buffer);
    this.gl.bufferData(target, array, this.gl.STATIC_DRAW);
    return buffer;
  }

  // Other w of a bake.
  setW(number, w) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.values[number].w);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, spread(w, this.mesh.origin, 1), this.gl.DYNAMIC_DRAW);
  }

  texture({ width, height, wrap, texels, bitmap }) {
    const gl = this.gl;
    const made = gl.createTexture();
    const modes = { repeat: gl.REPEAT, mirrored_repeat: gl.MIRRORED_REPEAT, clamp_to_edge: gl.CLAMP_TO_EDGE };
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    if (bitmap) gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, height, 0, gl.RED, gl.UNSIGNED_BYTE, texels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, modes[wrap[0]]);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, modes[wrap[1]]);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.generateMipmap(gl.TEXTURE_2D);
    return made;
  }

  attribute(name, buffer, size, type = this.gl.FLOAT) {
    const place = ATTRIBUTES.indexOf(name);
    if (!buffer) return;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.enableVertexAttribArray(place);
    this.gl.vertexAttribPointer(place, size, type, type !== this.gl.FLOAT, 0, 0);
  }

  surfaceArrays(shared, own, other) {
    const gl = this.gl;
    const arrays = gl.createVertexArray();
    gl.bindVertexArray(arrays);
    this.attribute("position", shared.position, 3);
    this.attribute("normal", shared.normal, 3);
    this.attribute("bent", own.bent, 3);
    this.attribute("w", own.w, 1, gl.UNSIGNED_SHORT);
    this.attribute("otherW", other.w, 1, gl.UNSIGNED_SHORT);
    this.attribute("error", own.error, 1, gl.UNSIGNED_BYTE);
    this.attribute("place", own.place, 2);
    this.attribute("otherPlace", other.place, 2);
    this.attribute("base", shared.base, 3, gl.UNSIGNED_BYTE);
    this.attribute("baseUv", shared.baseUv, 2);
    this.attribute("alpha", shared.alpha, 1, gl.UNSIGNED_BYTE);
    return arrays;
  }

  dots(mesh, { flags }, kinds) {
    const rows = flags ? [...flags.keys()].filter((i) => flags[i]) : [];
    const colours = kinds.map(([, hex]) => channels(hex));
    const colour = rows.flatMap((i) => colours[31 - Math.clz32(flags[i])] ?? [1, 1, 1]);
    const position = this.buffer(spread(mesh.positions, Uint32Array.from(rows), 3));
    const colourBuffer = this.buffer(new Float32Array(colour));
    const arrays = this.gl.createVertexArray();
    this.gl.bindVertexArray(arrays);
    this.attribute("position", position, 3);
    this.attribute("colour", colourBuffer, 3);
    return { arrays, count: rows.length };
  }

  // The list of faces to draw: all of them, or few.
  facesToDraw(isCoarse) {
    if (!isCoarse) return { index: this.whole, draws: this.draws };
    if (!this.coarse) {
      const { indices, draws } = coarseFaces(this.mesh, this.draws);
      this.coarse = { index: this.buffer(indices, this.gl.ELEMENT_ARRAY_BUFFER), draws };
    }
    return this.coarse;
  }

  get triangles() {
    return this.drawn.reduce((sum, { corners }) => sum + corners, 0) / 3;
  }

  // Milliseconds until the picture is there, once it is.
  async timed(camera, state) {
    const gl = this.gl;
    const start = performance.now();
    this.draw(camera, state);
    const drawn = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    while (gl.getSyncParameter(drawn, gl.SYNC_STATUS) === gl.UNSIGNALED) await new Promise((done) => setTimeout(done, 5));
    gl.deleteSync(drawn);
    return performance.now() - start;
  }

  // state: coarse, hasty (for machines that draw slowly: not smoothed), mode, low, high, strength, shown (end of the legend), ramp (five sRGB colours), split (share of the width), scheme.
  draw(camera, state) {
    const gl = this.gl;
    const [width, height] = this.target.begin(state.hasty);
    gl.viewport(0, 0, width, height);
    gl.clearColor(...this.look.background[state.scheme].map(encodedSrgb), 1);
    gl.disable(gl.SCISSOR_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    const edge = this.sides.length > 1 && state.mode !== MODES.difference.number ? Math.round(state.split * width) : width;
    this.sides.forEach((side, number) => {
      gl.scissor(number ? edge : 0, 0, number ? width - edge : edge, height);
      this.drawSide(side, camera, state, width / height);
    });
    this.target.show();
  }

  drawSide(side, camera, state, aspect) {
    const gl = this.gl;
    const toClip = camera.toClip(aspect);
    const [right, above, forward] = camera.axes;
    const [toRight, upwards, toViewer] = this.look.towardsKey;
    const key = unit(add(add(scaled(right, toRight), scaled(above, upwards)), scaled(forward, -toViewer)));
    const { program, uniforms } = this.surfaceProgram;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.toClip, false, toClip);
    gl.uniform1i(uniforms.mode, state.mode);
    gl.uniform3fv(uniforms.clay, this.look.clay);
    gl.uniform3fv(uniforms.towardsKey, key);
    gl.uniform3fv(uniforms.ramp, state.ramp.flatMap(channels));
    gl.uniform1f(uniforms.ambient, this.look.ambient);
    gl.uniform1f(uniforms.key, this.look.key);
    gl.uniform3f(uniforms.tone, state.low, state.high, state.strength);
    gl.uniform1f(uniforms.shown, state.mode === MODES.error.number ? state.shown / (side.errorTop || 1) : state.shown);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    const { index, draws } = this.facesToDraw(state.coarse);
    this.drawn = draws;
    gl.bindVertexArray(side.surface);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index);
    this.drawFaces(side, draws, uniforms, state.hasty);
    if (state.mode === MODES.flags.number && side.dots.count) this.drawDots(side.dots, toClip, camera.position);
  }

  // Backs of faces are moved away a little: where they meet fronts at an edge, rounding would let some pixels through.
  drawFaces({ number }, draws, uniforms, hasty) {
    const gl = this.gl;
    gl.uniform1i(uniforms.page, 0);
    gl.uniform1i(uniforms.otherPage, 1);
    gl.uniform1i(uniforms.image, 2);
    hasty ? gl.disable(gl.CULL_FACE) : gl.enable(gl.CULL_FACE);
    for (const [hidden, away] of [[gl.BACK, 0], [gl.FRONT, 1]].slice(hasty ? 1 : 0)) {
      gl.cullFace(hidden);
      away ? gl.enable(gl.POLYGON_OFFSET_FILL) : gl.disable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(1, 1);
      let first = 0;
      for (const { corners, image, pages } of draws) {
        const [own, other] = [pages[number], pages[pages.length - 1]];
        [own, other, image].forEach((page, unit) => {
          gl.activeTexture(gl.TEXTURE0 + unit);
          gl.bindTexture(gl.TEXTURE_2D, page ?? null);
        });
        gl.uniform3i(uniforms.paged, own ? 1 : 0, other ? 1 : 0, image ? 1 : 0);
        gl.drawElements(gl.TRIANGLES, corners, gl.UNSIGNED_INT, 4 * first);
        first += corners;
      }
    }
    gl.disable(gl.CULL_FACE);
  }

  // Dots behind the surface show through it.
  drawDots(dots, toClip, eye) {
    const gl = this.gl;
    const { program, uniforms } = this.dotsProgram;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.toClip, false, toClip);
    gl.uniform3fv(uniforms.eye, eye);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(dots.arrays);
    const through = Math.min(0.3, 200 / dots.count); // so that thousands do not hide the surface
    for (const [opacity, size, tested] of [[through, 6, false], [1, 8, true]]) {
      gl.uniform1f(uniforms.opacity, opacity);
      gl.uniform1f(uniforms.size, size * (window.devicePixelRatio || 1));
      tested ? gl.enable(gl.DEPTH_TEST) : gl.disable(gl.DEPTH_TEST);
      gl.drawArrays(gl.POINTS, 0, dots.count);
    }
  }
}

// Rows of `array`, `size` numbers each, in the order of `rows`.
function spread(array, rows, size) {
  const out = new array.constructor(rows.length * size);
  for (let i = 0; i < rows.length; i++) for (let k = 0; k < size; k++) out[size * i + k] = array[size * rows[i] + k];
  return out;
}

const channels = (hex) => [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16) / 255);
const encodedSrgb = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
