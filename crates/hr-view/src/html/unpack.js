// From text to numbers: base64, gzip, a header and sections; distributions put together again.
"use strict";

// A message for the user: something is wrong that waiting does not mend.
class Trouble extends Error {}

async function unpack(text) {
  if (!self.DecompressionStream) {
    throw new Trouble("This browser is too old to unpack the scene; use Chrome 80, Firefox 113, Safari 16.4 or later");
  }
  let bytes;
  try {
    const letters = atob(text.trim());
    const packed = new Uint8Array(letters.length);
    for (let i = 0; i < packed.length; i++) {
      packed[i] = letters.charCodeAt(i);
    }
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

// Places on the lattice.
function unpackPlaces(sections, name, { low, step }) {
  const axes = ["x", "y", "z"].map((axis) => sections.steps(`${name}.${axis}`));
  const places = new Float32Array(3 * axes[0].length);
  axes.forEach((axis, k) => axis.forEach((word, i) => { places[3 * i + k] = low[k] + word * step[k]; }));
  return places;
}

// Vertices and triangles of one of the two lists.
function unpackList(sections, name, { batches }, lattice) {
  const places = unpackPlaces(sections, name, lattice);
  const [u, v] = ["u", "v"].map((axis) => sections.floats(`${name}.${axis}`));
  const uv = new Float32Array(2 * u.length);
  u.forEach((_, i) => { uv[2 * i] = u[i]; uv[2 * i + 1] = v[i]; });
  const colors = ["irradiance", "tint", "emission"];
  const [irradiance, tint, emission] = colors.map((what) => sections.words(`${name}.${what}`));
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

const NO_VERTEX = 0x7fff;

// Which of corners 0, 1, 2 and midpoints 3, 4, 5 are the corners of each child; the ends of the edge of each midpoint.
const CHILDREN = [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]];
const ENDS = [[1, 2], [2, 0], [0, 1]];

// Puts distributions together, one after the other: the nodes and values that the shader walks through.
class Distributions {
  constructor(sections, facts) {
    [this.faces, this.children, this.flat] = ["faces", "children", "leaf.flat"].map((name) => sections.bytes(name));
    this.axes = sections.words("leaf.axes");
    // The bits of their numbers.
    this.places = new Uint32Array(unpackPlaces(sections, "leaf", facts.lattice).buffer);
    this.foci = ["xy", "z"].map((part) => sections.words(`leaf.focus.${part}`));
    this.channels = ["green", "red", "blue"].map((name) => sections.bytes(name));
    this.large = sections.words("large");
    this.colors = new Colors(facts);
    this.values = new Uint32Array(this.channels[0].length);
    this.leaves = new Uint32Array(8 * this.faces.length);
    this.nodes = new Uint32Array(4 * this.children.length + 64);
    [this.filled, this.firstValue, this.nextChildren, this.nextLarge] = [0, 0, 0, 0];
    this.met = 1;
    // Of the vertices of the leaf at hand: numbers (green; half of red and blue less green), and positions on the
    // octahedron in steps of the finest level.
    this.numbers = [0, 1, 2].map(() => new Int32Array(NO_VERTEX));
    [this.xs, this.ys, this.zs] = [0, 1, 2].map(() => new Int16Array(NO_VERTEX));
    const unit = this.unit = 1 << facts.max_level;
    [this.xs, this.ys, this.zs].forEach((positions, k) => { positions.set([unit, -unit], 2 * k); });
    // Its vertices by position; an entry counts if its stamp is the leaf's number.
    this.side = 2 * unit + 1;
    this.stamps = new Int32Array(2 * this.side ** 2).fill(-1);
    this.vertexAt = new Uint16Array(2 * this.side ** 2);
    // Its triangles: corners and midpoints of each; which children are divided, −1 for those that are not themselves.
    this.divided = { six: new Uint16Array(6 * NO_VERTEX), mask: new Int8Array(NO_VERTEX), count: 0 };
    this.kept = { six: new Uint16Array(6 * NO_VERTEX), mask: new Int8Array(NO_VERTEX), count: 0 };
    for (this.leaf = 0; this.leaf < this.faces.length; this.leaf++) {
      this.divide();
      this.layOut();
    }
  }

  // Adds a vertex to the leaf, its numbers near those of two others.
  add(a, b) {
    const { numbers, channels, met } = this;
    const index = this.firstValue + met;
    for (let k = 0; k < 3; k++) {
      const step = channels[k][index];
      numbers[k][met] = (numbers[k][a] + numbers[k][b] >> 1) + unfold(step < 255 ? step : this.large[this.nextLarge++]);
    }
    const green = numbers[0][met];
    this.values[index] = this.colors.word(green + 2 * numbers[1][met], green, green + 2 * numbers[2][met]);
    return this.met++;
  }

  // Where the middle between two vertices is looked up.
  place(a, b) {
    const { xs, ys, zs, unit, side } = this;
    return (xs[a] + xs[b] >> 1) + unit + side * ((ys[a] + ys[b] >> 1) + unit + (zs[a] + zs[b] < 0 ? side : 0));
  }

  // Adds the corners of a face of the octahedron to a list of triangles.
  static begin(list, face) {
    list.six.set([face & 1, 2 + (face >> 1 & 1), 4 + (face >> 2)], 6 * list.count++);
  }

  // Adds the corners of a triangle's child.
  static beget(list, six, at, child) {
    const to = 6 * list.count++;
    const corners = CHILDREN[child];
    list.six[to] = six[at + corners[0]];
    list.six[to + 1] = six[at + corners[1]];
    list.six[to + 2] = six[at + corners[2]];
  }

  // The divided triangles, level by level, with all vertices.
  divide() {
    const { leaf, divided, stamps, vertexAt, xs, ys, zs } = this;
    // The first numbers are near the last ones of the leaf before.
    const before = this.met - 1;
    this.met = 0;
    for (let corner = 0; corner < 6; corner++) {
      const near = corner > 0 ? corner - 1 : before;
      this.add(near, near);
    }
    divided.count = 0;
    for (let face = 0; face < 8; face++) {
      if (this.faces[leaf] >> face & 1) {
        Distributions.begin(divided, face);
      }
    }
    for (let next = 0; next < divided.count; next++) {
      const { six } = divided;
      const at = 6 * next;
      for (let edge = 0; edge < 3; edge++) {
        const a = six[at + ENDS[edge][0]];
        const b = six[at + ENDS[edge][1]];
        const place = this.place(a, b);
        if (stamps[place] !== leaf) {
          stamps[place] = leaf;
          const vertex = vertexAt[place] = this.add(a, b);
          xs[vertex] = xs[a] + xs[b] >> 1;
          ys[vertex] = ys[a] + ys[b] >> 1;
          zs[vertex] = zs[a] + zs[b] >> 1;
        }
        six[at + 3 + edge] = vertexAt[place];
      }
      const mask = divided.mask[next] = this.children[this.nextChildren++];
      for (let child = 0; child < 4; child++) {
        if (mask >> child & 1) {
          Distributions.beget(divided, six, at, child);
        }
      }
    }
  }

  // Fills in the midpoints of an undivided triangle, the last one of the list, that finer neighbours have put on its
  // edges; takes it off again if there are none.
  keep() {
    const { kept, stamps, vertexAt, leaf } = this;
    const at = 6 * (kept.count - 1);
    let some = false;
    for (let edge = 0; edge < 3; edge++) {
      const place = this.place(kept.six[at + ENDS[edge][0]], kept.six[at + ENDS[edge][1]]);
      const isThere = stamps[place] === leaf;
      kept.six[at + 3 + edge] = isThere ? vertexAt[place] : NO_VERTEX;
      some ||= isThere;
    }
    kept.mask[kept.count - 1] = -1;
    kept.count -= some ? 0 : 1;
    return some;
  }

  // Takes the next divided triangle as the last one of the list.
  copy(next) {
    const { kept, divided } = this;
    for (let i = 0, to = 6 * (kept.count - 1); i < 6; i++) {
      kept.six[to + i] = divided.six[6 * next + i];
    }
    kept.mask[kept.count - 1] = divided.mask[next];
    return true;
  }

  // Writes the nodes of the leaf: its divided triangles, and undivided ones with midpoints.
  layOut() {
    const { leaf, kept, foci } = this;
    kept.count = 0;
    let [roots, below] = [0, 0];
    for (let face = 0; face < 8; face++) {
      Distributions.begin(kept, face);
      const isKept = this.faces[leaf] >> face & 1 ? this.copy(below++) : this.keep();
      roots |= isKept << face;
    }
    const flags = roots | this.flat[leaf] << 8 | foci[1][leaf] << 16;
    this.leaves.set([this.axes[leaf], this.filled >> 1, this.firstValue, flags], 8 * leaf);
    this.leaves.set(this.places.subarray(3 * leaf, 3 * leaf + 3), 8 * leaf + 4);
    this.leaves[8 * leaf + 7] = foci[0][leaf];
    for (let next = 0; next < kept.count; next++) {
      const at = 6 * next;
      const mask = kept.mask[next];
      const base = kept.count;
      let have = 0;
      for (let child = 0; child < 4 && mask >= 0; child++) {
        Distributions.beget(kept, kept.six, at, child);
        const isKept = mask >> child & 1 ? this.copy(below++) : this.keep();
        have |= isKept << child;
      }
      if (this.filled + 2 > this.nodes.length) {
        const larger = new Uint32Array(2 * this.nodes.length);
        larger.set(this.nodes);
        this.nodes = larger;
      }
      const last = kept.six[at + 5];
      this.nodes[this.filled++] = kept.six[at + 3] | kept.six[at + 4] << 15 | last << 30;
      this.nodes[this.filled++] = last >> 2 | base << 13 | have << 28;
    }
    this.firstValue += this.met;
  }
}

// Everything that is shown.
async function unpackScene(text) {
  const { facts, sections } = await unpack(text);
  const [diffuse, glossy] =
    ["diffuse", "glossy"].map((name, i) => unpackList(sections, name, facts.lists[i], facts.lattice));
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
  return { facts, diffuse, glossy, shares, pictures, distributions: new Distributions(sections, facts) };
}
