// From text to numbers: base64, gzip, a header and sections; distributions put together again.
"use strict";

// A message for the user: something is wrong that waiting does not mend.
class Trouble extends Error {}

async function unpack(text) {
  if (!self.DecompressionStream) {
    throw new Trouble("This browser is too old, it cannot unpack the scene; use Chrome 80, Firefox 113, Safari 16.4 or later");
  }
  let bytes;
  try {
    const packed = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  } catch (error) {
    throw new Trouble(`${DAMAGED} (${error.message || "its checksum is wrong"}). ${REMEDY}`);
  }
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  return { facts, sections: new Sections(facts.sections, bytes.subarray(4 + length)) };
}

class Sections {
  constructor(places, bytes) {
    this.places = places;
    this.all = bytes;
  }

  bytes(name) {
    const [start, length] = this.places[name];
    return this.all.subarray(start, start + length);
  }

  // Numbers whose bytes are kept by place, the lowest first.
  words(name) {
    const bytes = this.bytes(name);
    const count = bytes.length / 4;
    const words = new Uint32Array(count);
    for (let i = 0; i < count; i++) {
      words[i] = bytes[i] | bytes[count + i] << 8 | bytes[2 * count + i] << 16 | bytes[3 * count + i] << 24;
    }
    return words;
  }

  // Numbers of which the differences are kept.
  steps(name) {
    const words = this.words(name);
    let last = 0;
    for (let i = 0; i < words.length; i++) {
      last += unfold(words[i]);
      words[i] = last;
    }
    return words;
  }

  floats(name) {
    return new Float32Array(this.words(name).buffer);
  }
}

// 0, 1, 2, 3, … to 0, −1, 1, −2, …
function unfold(step) {
  return step >>> 1 ^ -(step & 1);
}

// Vertices and triangles of one of the two lists.
function unpackList(sections, name, { batches }, { low, step }) {
  const axes = ["x", "y", "z"].map((axis) => sections.steps(`${name}.${axis}`));
  const places = new Float32Array(3 * axes[0].length);
  axes.forEach((axis, k) => axis.forEach((word, i) => { places[3 * i + k] = low[k] + word * step[k]; }));
  const [u, v] = ["u", "v"].map((axis) => sections.floats(`${name}.${axis}`));
  const uv = new Float32Array(2 * u.length);
  u.forEach((_, i) => { uv[2 * i] = u[i]; uv[2 * i + 1] = v[i]; });
  const [irradiance, tint, emission] = ["irradiance", "tint", "emission"].map((what) => sections.words(`${name}.${what}`));
  return { batches, places, uv, irradiance, tint, emission, indices: sections.steps(`${name}.indices`) };
}

// Colours of nine bits per channel over a common exponent, from whole numbers on the scale of the page: value =
// floor · (growth ^ number − 1).
class Colors {
  constructor({ floor, growth, most }) {
    this.value = new Float32Array(most + 1);
    this.exponent = new Uint8Array(most + 1);
    this.scale = new Float32Array(most + 1);
    for (let number = 0; number <= most; number++) {
      const value = this.value[number] = Math.min(floor * Math.expm1(number * Math.log(growth)), 65408);
      let exponent = Math.max(0, Math.floor(Math.log2(value)) + 16);
      exponent += Math.round(value * 2 ** (24 - exponent)) > 511 ? 1 : 0;
      this.exponent[number] = exponent;
      this.scale[number] = 2 ** (24 - exponent);
    }
    this.most = most;
  }

  word(red, green, blue) {
    const { value, most } = this;
    const largest = Math.min(Math.max(red, green, blue, 0), most);
    const scale = this.scale[largest];
    const channel = (number) => number > 0 ? Math.round(value[Math.min(number, most)] * scale) : 0;
    return (channel(red) | channel(green) << 9 | channel(blue) << 18 | this.exponent[largest] << 27) >>> 0;
  }
}

// Numbers that grow.
class List {
  constructor(Type, size) {
    this.array = new Type(size);
    this.length = 0;
  }

  // Room for so many more.
  reserve(more) {
    if (this.length + more > this.array.length) {
      const larger = new this.array.constructor(2 * (this.length + more));
      larger.set(this.array);
      this.array = larger;
    }
  }

  get all() {
    return this.array.subarray(0, this.length);
  }
}

const NO_VERTEX = 0x7fff;

// Which of corners 0, 1, 2 and midpoints 3, 4, 5 are the corners of each child; the ends of the edge of each midpoint.
const CHILDREN = [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]];
const ENDS = [[1, 2], [2, 0], [0, 1]];

// Puts the distributions of all leaves together: the nodes and values that the shader walks through.
function unpackDistributions(sections, facts) {
  const [faces, children, flat] = ["faces", "children", "leaf.flat"].map((name) => sections.bytes(name));
  const axes = sections.words("leaf.axes");
  const channels = ["green", "red", "blue"].map((name) => sections.bytes(name));
  const large = sections.words("large");
  const colors = new Colors(facts);
  const count = channels[0].length;
  const values = new Uint32Array(count);
  const leaves = new Uint32Array(4 * faces.length);
  const nodes = new List(Uint32Array, 4 * children.length);
  let [firstValue, nextChildren, nextLarge] = [0, 0, 0];

  // Numbers of the values of one leaf, green first, red and blue less green.
  const numbers = [0, 1, 2].map(() => new Int32Array(NO_VERTEX));
  // Positions of its vertices on the octahedron, in steps of the finest level.
  const [px, py, pz] = [0, 1, 2].map(() => new Int16Array(NO_VERTEX));
  // Vertices by position. An entry counts if its stamp is that of the leaf.
  const unit = 1 << facts.max_level;
  const side = 2 * unit + 1;
  const stamps = new Int32Array(2 * side * side).fill(-1);
  const vertexAt = new Uint16Array(2 * side * side);
  [[unit, 0, 0], [-unit, 0, 0], [0, unit, 0], [0, -unit, 0], [0, 0, unit], [0, 0, -unit]].forEach((p, i) => {
    [px[i], py[i], pz[i]] = p;
  });
  let met = 0;
  const add = (guess) => {
    const vertex = met++;
    const index = firstValue + vertex;
    for (let k = 0; k < 3; k++) {
      let step = channels[k][index];
      if (step === 255) {
        step = large[nextLarge++];
      }
      numbers[k][vertex] = guess(k) + unfold(step);
    }
    const green = numbers[0][vertex];
    values[index] = colors.word(green + numbers[1][vertex], green, green + numbers[2][vertex]);
    return vertex;
  };
  const key = (a, b) => {
    const [x, y, z] = [(px[a] + px[b]) >> 1, (py[a] + py[b]) >> 1, (pz[a] + pz[b]) >> 1];
    return x + unit + side * (y + unit + (z < 0 ? side : 0));
  };
  const last = [0, 0, 0];

  for (let leaf = 0; leaf < faces.length; leaf++) {
    met = 0;
    for (let i = 0; i < 6; i++) {
      add((k) => last[k]);
      numbers.forEach((all, k) => { last[k] = all[i]; });
    }
    // Divided triangles, six vertices each: corners and midpoints; which of their children are divided.
    const triangles = [];
    const masks = [];
    for (let face = 0; face < 8; face++) {
      if (faces[leaf] >> face & 1) {
        triangles.push([face & 1, 2 + (face >> 1 & 1), 4 + (face >> 2)]);
      }
    }
    for (let next = 0; next < triangles.length; next++) {
      const six = triangles[next];
      for (const [i, j] of ENDS) {
        const [a, b] = [six[i], six[j]];
        const place = key(a, b);
        if (stamps[place] !== leaf) {
          stamps[place] = leaf;
          const vertex = vertexAt[place] = add((k) => (numbers[k][a] + numbers[k][b]) >> 1);
          [px[vertex], py[vertex], pz[vertex]] = [(px[a] + px[b]) >> 1, (py[a] + py[b]) >> 1, (pz[a] + pz[b]) >> 1];
        }
        six.push(vertexAt[place]);
      }
      const mask = children[nextChildren++];
      masks.push(mask);
      for (let child = 0; child < 4; child++) {
        if (mask >> child & 1) {
          triangles.push(CHILDREN[child].map((i) => six[i]));
        }
      }
    }
    numbers.forEach((all, k) => { last[k] = all[met - 1]; });
    leaves.set([axes[leaf], nodes.length >> 1, firstValue], 4 * leaf);
    leaves[4 * leaf + 3] = layOut(leaf, faces[leaf], triangles, masks) | flat[leaf] << 8;
    firstValue += met;
  }

  // Writes the nodes of a leaf; returns which faces have one. Undivided triangles have one if finer neighbours have put
  // vertices on their edges.
  function layOut(leaf, divided, triangles, masks) {
    const firstNode = nodes.length >> 1;
    const queue = [];
    let below = 0;
    const put = (corners, isDivided) => {
      if (isDivided) {
        queue.push({ six: triangles[below], mask: masks[below] });
        below++;
        return true;
      }
      const mids = ENDS.map(([i, j]) => {
        const place = key(corners[i], corners[j]);
        return stamps[place] === leaf ? vertexAt[place] : NO_VERTEX;
      });
      if (mids.every((mid) => mid === NO_VERTEX)) {
        return false;
      }
      queue.push({ six: [...corners, ...mids], mask: -1 });
      return true;
    };
    let roots = 0;
    for (let face = 0; face < 8; face++) {
      roots |= put([face & 1, 2 + (face >> 1 & 1), 4 + (face >> 2)], divided >> face & 1) << face;
    }
    for (let next = 0; next < queue.length; next++) {
      const { six, mask } = queue[next];
      const base = queue.length;
      let have = 0;
      for (let child = 0; child < 4 && mask >= 0; child++) {
        have |= put(CHILDREN[child].map((i) => six[i]), mask >> child & 1) << child;
      }
      nodes.reserve(2);
      nodes.array[nodes.length++] = six[3] | six[4] << 15 | six[5] << 30;
      nodes.array[nodes.length++] = six[5] >> 2 | base << 13 | have << 28;
    }
    return roots;
  }

  return { leaves, nodes: nodes.all, values };
}

// Everything that is shown.
async function unpackScene(text) {
  const { facts, sections } = await unpack(text);
  const [diffuse, glossy] = ["diffuse", "glossy"].map((name, i) => unpackList(sections, name, facts.lists[i], facts.lattice));
  const counts = sections.bytes("glossy.counts");
  glossy.normals = new Int16Array(sections.words("glossy.normals").buffer);
  glossy.ranges = new Uint32Array(2 * counts.length);
  let first = 0;
  counts.forEach((count, i) => {
    glossy.ranges[2 * i] = first;
    glossy.ranges[2 * i + 1] = count;
    first += count;
  });
  const weights = sections.bytes("glossy.weights");
  const shares = sections.steps("glossy.leaves").map((leaf, i) => leaf | weights[i] << 24);
  const pictures = await Promise.all(facts.textures.map((_, i) => createImageBitmap(
    new Blob([sections.bytes(`texture.${i}`)], { type: "image/png" }),
    { colorSpaceConversion: "none", premultiplyAlpha: "none" },
  )));
  return { facts, diffuse, glossy, shares, pictures, distributions: unpackDistributions(sections, facts) };
}
