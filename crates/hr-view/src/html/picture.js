// Draws the scene with WebGL 2.
"use strict";

// The near plane, as a share of the scene's diagonal: closer than anyone goes to a wall, and 24 bits of depth suffice.
const NEAR = 3e-4;
// Triangles that are drawn or left out together.
const CELL = 1024;
// So many glossy vertices are evaluated in a frame without a graphics card, beside those that never were.
const MOST_WHEN_SLOW = 8000;
// Places of vertex attributes, the same in all programs.
const PLACES = ["place", "irradiance", "tint", "emission", "uv", "glossy", "normal", "range"];

// Runs of triangles with spheres around them. The vertices of a list are numbered as its triangles meet them, so that
// each cell brings a run of new ones.
function makeCells({ batches, places, indices }, diagonal) {
  const cells = [];
  const owner = new Uint32Array(places.length / 3);
  let owned = 0;
  for (const [start, count, texture] of batches) {
    for (let from = start; from < start + count; from += 3 * CELL) {
      const to = Math.min(from + 3 * CELL, start + count);
      const cell = { from, to, texture, firstVertex: owned, needs: new Set() };
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let i = from; i < to; i++) {
        const vertex = indices[i];
        if (vertex >= owned) {
          owned = vertex + 1;
          owner[vertex] = cells.length;
        }
        cell.needs.add(owner[vertex]);
        for (let k = 0; k < 3; k++) {
          const x = places[3 * vertex + k];
          low[k] = Math.min(low[k], x);
          high[k] = Math.max(high[k], x);
        }
      }
      cell.endVertex = owned;
      cell.center = low.map((x, k) => 0.5 * (x + high[k]));
      cell.radius = 0.5 * Math.hypot(...plus(high, low, -1)) + 1e-6 * diagonal;
      // Where the eye was when the cell's vertices were evaluated.
      cell.seenFrom = null;
      cells.push(cell);
    }
  }
  return cells;
}

class Picture {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.scene = scene;
    const { lattice: { step } } = scene.facts;
    this.diagonal = 2 ** 20 * Math.hypot(...step);
    // Walking smoothly comes before smooth edges, and before highlights that are up to date at every step.
    const isSlow = isSoftware();
    this.mostPerFrame = isSlow ? MOST_WHEN_SLOW : Infinity;
    const options = { antialias: !isSlow, alpha: false, powerPreference: "high-performance" };
    const gl = this.gl = canvas.getContext("webgl2", options);
    if (!gl) {
      throw new Trouble("This browser has no WebGL 2; switch hardware acceleration on, or use another browser");
    }
    this.diffuse = { ...scene.diffuse, cells: makeCells(scene.diffuse, this.diagonal) };
    this.glossy = { ...scene.glossy, cells: makeCells(scene.glossy, this.diagonal) };
    this.prepare();
  }

  // Everything that lives on the device, also after it was lost.
  prepare() {
    const { gl, scene, diffuse, glossy } = this;
    this.width = Math.min(gl.getParameter(gl.MAX_TEXTURE_SIZE), 4096);
    // Without and with texture.
    this.programs = ["", "#define TEXTURED"].map((defines) => this.program("scene-vertex", "scene-fragment", defines));
    const bits = Math.log2(this.width);
    const constants = { WIDTH_BITS: `${bits}u`, WIDTH_MASK: `${this.width - 1}u`, MAX_LEVEL: scene.facts.max_level };
    const defines = Object.entries(constants).map(([name, value]) => `#define ${name} ${value}`);
    this.evaluator = this.program("glossy-vertex", null, defines.join("\n"));
    const { distributions } = scene;
    const nodes = distributions.nodes.subarray(0, distributions.filled);
    this.tables = {
      shares: this.table(scene.shares, gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT, 1),
      leaves: this.table(distributions.leaves, gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 4),
      nodes: this.table(nodes, gl.RG32UI, gl.RG_INTEGER, gl.UNSIGNED_INT, 2),
      values: this.table(distributions.values, gl.RGB9_E5, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, 1),
    };
    this.textures = scene.pictures.map((picture, i) => this.texture(picture, scene.facts.textures[i]));
    this.radiance = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.radiance);
    gl.bufferData(gl.ARRAY_BUFFER, Math.max(4 * glossy.places.length, 12), gl.DYNAMIC_COPY);
    for (const list of [diffuse, glossy]) {
      list.cells.forEach((cell) => { cell.seenFrom = null; });
      const places = this.buffer(list.places);
      list.array = gl.createVertexArray();
      gl.bindVertexArray(list.array);
      this.attribute("place", places, 3, gl.FLOAT);
      this.attribute("uv", this.buffer(list.uv), 2, gl.FLOAT);
      for (const what of ["irradiance", "tint", "emission"]) {
        this.attribute(what, this.buffer(list[what]), 1, gl.UNSIGNED_INT);
      }
      if (list === glossy) {
        this.attribute("glossy", this.radiance, 3, gl.FLOAT);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, list.indices, gl.STATIC_DRAW);
      if (list === glossy) {
        this.asked = gl.createVertexArray();
        gl.bindVertexArray(this.asked);
        this.attribute("place", places, 3, gl.FLOAT);
        this.attribute("normal", this.buffer(list.normals), 2, gl.SHORT);
        this.attribute("range", this.buffer(list.ranges), 2, gl.UNSIGNED_INT);
      }
    }
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    this.feedback = gl.createTransformFeedback();
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
  }

  buffer(data) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return buffer;
  }

  attribute(name, buffer, size, type) {
    const { gl } = this;
    const place = PLACES.indexOf(name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    if (type === gl.UNSIGNED_INT) {
      gl.vertexAttribIPointer(place, size, type, 0, 0);
    } else {
      gl.vertexAttribPointer(place, size, type, true, 0, 0);
    }
  }

  program(vertex, fragment, defines) {
    const { gl } = this;
    const program = gl.createProgram();
    const shader = (type, text) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      return shader;
    };
    // The version comes first.
    const source = (id) => document.getElementById(id).textContent.trim().replace("\n", `\n${defines}\n`);
    const shaders = [
      shader(gl.VERTEX_SHADER, source(vertex)),
      shader(gl.FRAGMENT_SHADER, fragment ? source(fragment) : "#version 300 es\nvoid main() {}"),
    ];
    PLACES.forEach((name, place) => gl.bindAttribLocation(program, place, name));
    if (!fragment) {
      gl.transformFeedbackVaryings(program, ["radiance"], gl.SEPARATE_ATTRIBS);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = [gl.getProgramInfoLog(program), ...shaders.map((s) => gl.getShaderInfoLog(s))];
      const log = logs.filter(Boolean).join("; ");
      throw new Trouble(`The graphics driver does not take the shader ${vertex} (${log}); update it or the browser`);
    }
    const places = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(program, i);
      places[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  // A long array as a texture of rows.
  table(data, internal, format, type, size) {
    const { gl, width } = this;
    const height = Math.max(1, Math.ceil(data.length / size / width));
    if (height > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
      throw new Trouble("The solution is too large for this graphics device; write it with a larger --error");
    }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, internal, width, height);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    const whole = Math.floor(data.length / size / width);
    if (whole > 0) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, whole, format, type, data);
    }
    const rest = data.length / size - whole * width;
    if (rest > 0) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, whole, rest, 1, format, type, data, whole * width * size);
    }
    return texture;
  }

  texture(picture, { wrap }) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl[wrap[0]]);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl[wrap[1]]);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    const anisotropic = gl.getExtension("EXT_texture_filter_anisotropic");
    if (anisotropic) {
      gl.texParameterf(gl.TEXTURE_2D, anisotropic.TEXTURE_MAX_ANISOTROPY_EXT, 8);
    }
    return texture;
  }

  // Draws what a walker sees, `exposure` times as bright as automatically; returns how many vertices were evaluated,
  // and whether some are left for the next frame.
  draw(walker, exposure) {
    const { gl, canvas } = this;
    const [x, y] = walker.scales(canvas.width / canvas.height);
    const sides = [[walker.right, x], [walker.right, -x], [walker.top, y], [walker.top, -y]]
      .map(([across, scale]) => unit(plus(walker.forward, across, scale)));
    const isSeen = ({ center, radius }) => {
      const to = plus(center, walker.eye, -1);
      return sides.every((side) => dot(side, to) > -radius) && dot(walker.forward, to) > -radius;
    };
    const [diffuse, glossy] = [this.diffuse, this.glossy].map((list) => list.cells.filter(isSeen));
    const done = this.evaluate(walker.eye, glossy);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const { to_srgb: toSrgb, curve, brightest } = this.scene.facts;
    for (const { program, places } of this.programs) {
      gl.useProgram(program);
      gl.uniform3fv(places.eye, walker.eye);
      gl.uniform4fv(places.right, [...walker.right, x]);
      gl.uniform4fv(places.up, [...walker.top, y]);
      gl.uniform4fv(places.forward, [...walker.forward, NEAR * this.diagonal]);
      gl.uniform1f(places.exposure, exposure);
      gl.uniform1f(places.brightest, brightest);
      gl.uniformMatrix3fv(places.toSrgb, false, toSrgb);
      gl.uniform1fv(places.curve, curve);
    }
    this.drawCells(this.diffuse, diffuse);
    this.drawCells(this.glossy, glossy);
    return done;
  }

  drawCells(list, cells) {
    const { gl } = this;
    gl.bindVertexArray(list.array);
    let used;
    for (let i = 0; i < cells.length; i++) {
      const { from, texture } = cells[i];
      while (i + 1 < cells.length && cells[i + 1].from === cells[i].to && cells[i + 1].texture === texture) {
        i++;
      }
      if (texture !== used) {
        used = texture;
        const { program, places } = this.programs[texture === null ? 0 : 1];
        gl.useProgram(program);
        if (texture !== null) {
          const { u, v } = this.scene.facts.textures[texture];
          gl.activeTexture(gl.TEXTURE0);
          gl.bindTexture(gl.TEXTURE_2D, this.textures[texture]);
          gl.uniform1i(places.texels, 0);
          gl.uniform3fv(places.placeU, u);
          gl.uniform3fv(places.placeV, v);
        }
      }
      gl.drawElements(gl.TRIANGLES, cells[i].to - from, gl.UNSIGNED_INT, 4 * from);
    }
    gl.bindVertexArray(null);
  }

  // The cells whose vertices are to be evaluated now, and whether more are stale: first those that the eye has moved
  // around most since.
  choose(eye, cells) {
    const needed = new Set();
    cells.forEach((cell) => cell.needs.forEach((owner) => needed.add(owner)));
    const stale = [];
    for (const index of needed) {
      const cell = this.glossy.cells[index];
      const moved = cell.seenFrom ? Math.hypot(...plus(eye, cell.seenFrom, -1)) : Infinity;
      if (moved > 0) {
        const distance = Math.hypot(...plus(eye, cell.center, -1)) - cell.radius;
        stale.push({ index, turn: moved / Math.max(distance, 1e-3 * this.diagonal) });
      }
    }
    stale.sort((a, b) => b.turn - a.turn);
    let room = this.mostPerFrame;
    const fits = ({ index, turn }) => {
      const { firstVertex, endVertex } = this.glossy.cells[index];
      room -= endVertex - firstVertex;
      return room >= 0 || turn === Infinity;
    };
    const chosen = stale.filter(fits).map(({ index }) => index).sort((a, b) => a - b);
    return { chosen: chosen.map((index) => this.glossy.cells[index]), isMore: chosen.length < stale.length };
  }

  // Brings the glossy radiances of vertices of cells up to date with the eye.
  evaluate(eye, cells) {
    const { gl } = this;
    const { chosen, isMore } = this.choose(eye, cells);
    if (chosen.length === 0) {
      return { evaluated: 0, isMore };
    }
    const { program, places } = this.evaluator;
    gl.useProgram(program);
    gl.uniform3fv(places.eye, eye);
    ["shares", "leaves", "nodes", "values"].forEach((name, i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, this.tables[name]);
      gl.uniform1i(places[name], i);
    });
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.bindVertexArray(this.asked);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    let evaluated = 0;
    for (let i = 0; i < chosen.length; i++) {
      const first = chosen[i].firstVertex;
      let end = chosen[i].endVertex;
      chosen[i].seenFrom = [...eye];
      while (i + 1 < chosen.length && chosen[i + 1].firstVertex === end) {
        i++;
        end = chosen[i].endVertex;
        chosen[i].seenFrom = [...eye];
      }
      if (end > first) {
        gl.bindBufferRange(gl.TRANSFORM_FEEDBACK_BUFFER, 0, this.radiance, 12 * first, 12 * (end - first));
        gl.beginTransformFeedback(gl.POINTS);
        gl.drawArrays(gl.POINTS, first, end - first);
        gl.endTransformFeedback();
        evaluated += end - first;
      }
    }
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
    gl.disable(gl.RASTERIZER_DISCARD);
    return { evaluated, isMore };
  }
}

// Whether pictures are drawn without a graphics card.
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl?.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|basic render|software/i.test(name);
}
