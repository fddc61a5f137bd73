#version 300 es
// Glossy radiance of a vertex toward the eye, from the distributions of the leaves around it.
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;

uniform vec3 eye;           // relative to the mesh's origin
uniform usampler2D shares;  // a leaf in the low 24 bits, its weight above
uniform usampler2D leaves;  // axis; first node; first value; bits 0 … 7: faces that have a node, bit 8: flat, the upper half:
                            // z of the focus. Then: middle; x (lower half) and y of the focus
uniform usampler2D nodes;   // three midpoints of 15 bits, first child's node of 15, four bits: children that have one
uniform sampler2D values;   // at the vertices of distributions

in vec3 place;
in vec2 normal;             // as leaves' axes
in uvec2 range;             // first share, how many
out vec3 radiance;

const uint NO_VERTEX = 0x7fffu;
// Cosine below which a distribution says less and less about what is reflected: it is no longer divided by it.
const float LEAST_COSINE = 0.05;
// A place is at least so much of the middle's distance away from the plane of what lights a leaf.
const float NEAREST = 0.25;
// Where normals point so far away from the eye (cosine) no triangle of the vertex is seen.
const float HIDDEN = -0.5;

ivec2 at(uint index) {
  return ivec2(index & WIDTH_MASK, index >> WIDTH_BITS);
}

vec3 unfolded(vec2 square) {
  vec3 v = vec3(square, 1.0 - abs(square.x) - abs(square.y));
  if (v.z < 0.0) {
    v.xy = (1.0 - abs(v.yx)) * vec2(v.x < 0.0 ? -1.0 : 1.0, v.y < 0.0 ? -1.0 : 1.0);
  }
  return normalize(v);
}

vec3 value(uint first, uint vertex) {
  return texelFetch(values, at(first + vertex), 0).rgb;
}

// A distribution's value in a direction: down from a face of the octahedron to the smallest triangle.
vec3 evaluate(uvec4 leaf, vec3 direction) {
  vec3 size = abs(direction);
  vec3 p = size / (size.x + size.y + size.z);
  uint face = (direction.x < 0.0 ? 1u : 0u) | (direction.y < 0.0 ? 2u : 0u) | (direction.z < 0.0 ? 4u : 0u);
  uvec3 corners = uvec3(face & 1u, 2u + (face >> 1u & 1u), 4u + (face >> 2u));
  uint mask = leaf.w & 0xffu;
  uint base = 0u;
  uint which = face;
  for (int level = 0; level <= MAX_LEVEL; level++) {
    if ((mask >> which & 1u) == 0u) {
      break;
    }
    uint below = mask & ((1u << which) - 1u);
    // How many nodes come before: ones among eight bits.
    below = below - (below >> 1u & 0x55u);
    below = (below & 0x33u) + (below >> 2u & 0x33u);
    below = (below + (below >> 4u)) & 0x0fu;
    uvec2 node = texelFetch(nodes, at(leaf.y + base + below), 0).xy;
    uvec3 mids = uvec3(node.x & NO_VERTEX, node.x >> 15u & NO_VERTEX, (node.x >> 30u | node.y << 2u) & NO_VERTEX);
    base = node.y >> 13u & NO_VERTEX;
    mask = node.y >> 28u;
    vec3 twice = p + p;
    bool middle = false;
    uvec3 inner;
    if (twice.x >= 1.0) {
      which = 0u; inner = uvec3(corners.x, mids.z, mids.y); p = twice - vec3(1.0, 0.0, 0.0);
    } else if (twice.y >= 1.0) {
      which = 1u; inner = uvec3(mids.z, corners.y, mids.x); p = twice - vec3(0.0, 1.0, 0.0);
    } else if (twice.z >= 1.0) {
      which = 2u; inner = uvec3(mids.y, mids.x, corners.z); p = twice - vec3(0.0, 0.0, 1.0);
    } else {
      which = 3u; inner = mids; p = 1.0 - twice;
    }
    if (mask == 0u && (mids.x == NO_VERTEX || mids.y == NO_VERTEX || mids.z == NO_VERTEX)) {
      // Undivided, with vertices that finer neighbours have put on its edges.
      vec3 a = value(leaf.z, corners.x), b = value(leaf.z, corners.y), c = value(leaf.z, corners.z);
      vec3 d = mids.x == NO_VERTEX ? 0.5 * (b + c) : value(leaf.z, mids.x);
      vec3 e = mids.y == NO_VERTEX ? 0.5 * (c + a) : value(leaf.z, mids.y);
      vec3 f = mids.z == NO_VERTEX ? 0.5 * (a + b) : value(leaf.z, mids.z);
      mat3 part = which == 0u ? mat3(a, f, e)
        : which == 1u ? mat3(f, b, d)
        : which == 2u ? mat3(e, d, c) : mat3(d, e, f);
      return part * p / (p.x + p.y + p.z);
    }
    corners = inner;
  }
  mat3 part = mat3(value(leaf.z, corners.x), value(leaf.z, corners.y), value(leaf.z, corners.z));
  return part * p / (p.x + p.y + p.z);
}

void main() {
  gl_Position = vec4(0.0);
  radiance = vec3(0.0);
  vec3 away = normalize(eye - place);
  vec3 facing = unfolded(normal);
  if (dot(facing, away) < HIDDEN) {
    return;
  }
  vec3 seen = -reflect(away, facing);
  float weights = 0.0;
  for (uint i = 0u; i < range.y; i++) {
    uint share = texelFetch(shares, at(range.x + i), 0).x;
    uint index = 2u * (share & 0xffffffu);
    uvec4 leaf = texelFetch(leaves, at(index), 0);
    uvec4 middle = texelFetch(leaves, at(index + 1u), 0);
    vec3 axis = unfolded(unpackSnorm2x16(leaf.x));
    // What the place reflects toward the eye comes from the mirrored direction. The leaf's middle sees the same from another one,
    // where the ray meets the plane of what lights the leaf, and mirrors it in its own way: there its distribution is asked.
    vec3 offset = place - uintBitsToFloat(middle.xyz);
    vec3 plane = uintBitsToFloat(uvec3(middle.w << 16u, middle.w & 0xffff0000u, leaf.w & 0xffff0000u));
    vec3 turned = seen * max(1.0 - dot(plane, offset), NEAREST) + offset * max(dot(plane, seen), 0.0);
    vec3 asked = reflect(-normalize(turned), axis);
    float cosine = max(dot(asked, axis), LEAST_COSINE);
    vec3 light = evaluate(leaf, asked);
    float weight = float(share >> 24u);
    radiance += (leaf.w & 0x100u) != 0u ? light * cosine * weight : light * weight;
    weights += cosine * weight;
  }
  radiance = max(radiance / max(weights, 1e-30), 0.0);
}
