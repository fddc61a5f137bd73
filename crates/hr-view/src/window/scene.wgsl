// Radiance at the vertices, interpolated, and tone mapped at the pixel.

const RAMP = 7u; // colours of the false-colour ramp, as in gauge.rs
const PI = 3.14159265;

// Whether false colours take the place of the picture.
override FALSE_COLORS = false;

struct Frame {
    eye: vec4f,         // relative to the mesh's origin
    right: vec4f,       // unit; w: horizontal scale, cotangent of half the field of view
    up: vec4f,          // unit; w: vertical scale
    forward: vec4f,     // unit; w: distance of the near plane
    to_srgb: mat3x3f,   // from the scene's primaries to linear sRGB
    numerator: vec4f,   // a, b of the curve; exposure; largest exposed value
    denominator: vec4f, // c, d, e of the curve; 1 where the target does not encode sRGB by itself
    luminance: vec4f,   // weights; w: the quantity in false colours: 0 none, 1 radiance, 2 radiosity, 3 irradiance
    scale: vec4f,       // binary logarithm of the low end, 1 / that of high / low; where the curve is white
    ramp: array<vec4f, RAMP>,
}

struct Placement {
    u: vec4f,           // rows of the texture's transform
    v: vec4f,
}

// Between the vertices of a triangle without a texture only the sum is interpolated, exposed: where the processor draws,
// every number and step more costs, and of small triangles several times.
struct Plain {
    @builtin(position) position: vec4f,
    @location(0) value: vec3f,
}

struct Textured {
    @builtin(position) position: vec4f,
    @location(0) diffuse: vec3f,    // what the texture multiplies
    @location(1) other: vec3f,
    @location(2) uv: vec2f,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var texels: texture_2d<f32>;
@group(1) @binding(1) var texel_sampler: sampler;
@group(1) @binding(2) var<uniform> placement: Placement;

// Reversed depth, no far plane: 1 at the near plane, toward 0 far away, where floats are densest.
fn project(point: vec3f) -> vec4f {
    let to = point - frame.eye.xyz;
    let x = dot(to, frame.right.xyz) * frame.right.w;
    let y = dot(to, frame.up.xyz) * frame.up.w;
    return vec4f(x, y, frame.forward.w, dot(to, frame.forward.xyz));
}

struct Vertex {
    @location(0) point: vec3f,
    @location(1) irradiance: vec3f,
    @location(2) tint: vec3f,
    @location(3) emission: vec3f,
    @location(4) uv: vec2f,
}

// What the texture multiplies, and the rest: radiance, or what is shown in false colours instead.
struct Light {
    diffuse: vec3f,
    other: vec3f,
}

fn light(v: Vertex, glossy: vec3f) -> Light {
    let quantity = frame.luminance.w;
    if quantity > 2.5 {
        return Light(v.irradiance, vec3f(0.0));
    }
    let diffuse = v.irradiance * v.tint;
    if quantity > 1.5 {
        return Light(PI * diffuse, PI * v.emission);
    }
    return Light(diffuse, v.emission + glossy);
}

fn plain(v: Vertex, glossy: vec3f) -> Plain {
    let l = light(v, glossy);
    return Plain(project(v.point), exposed(l.diffuse + l.other));
}

fn textured(v: Vertex, glossy: vec3f) -> Textured {
    let l = light(v, glossy);
    return Textured(project(v.point), l.diffuse, l.other, v.uv);
}

@vertex
fn diffuse_plain(v: Vertex) -> Plain {
    return plain(v, vec3f(0.0));
}

@vertex
fn diffuse_textured(v: Vertex) -> Textured {
    return textured(v, vec3f(0.0));
}

@vertex
fn glossy_plain(v: Vertex, @location(5) glossy: vec3f) -> Plain {
    return plain(v, glossy);
}

@vertex
fn glossy_textured(v: Vertex, @location(5) glossy: vec3f) -> Textured {
    return textured(v, glossy);
}

fn curve(x: vec2f) -> vec2f {
    let n = frame.numerator;
    let d = frame.denominator;
    return clamp((x * (n.x * x + n.y)) / (x * (d.x * x + d.y) + d.z), vec2f(0.0), vec2f(1.0));
}

// The curve of a colour, whose hue stays: as in tone.rs.
fn printed(exposed: vec3f) -> vec3f {
    let color = exposed * min(frame.scale.z / max(max(exposed.x, max(exposed.y, exposed.z)), 1e-30), 1.0);
    let low = min(color.x, min(color.y, color.z));
    let high = max(color.x, max(color.y, color.z));
    let ends = curve(vec2f(low, high));
    return vec3f(ends.x) + (color - low) * ((ends.y - ends.x) / max(high - low, 1e-30));
}

// 1.055 x^(1/2.4) − 0.055 above its linear part, to a tenth of a code of 255: two square roots, as a power costs several
// times as much where the processor draws.
fn srgb_encode(x: vec3f) -> vec3f {
    let root = sqrt(x);
    let power = 0.83372968 * root + 0.29813416 * sqrt(root) - 0.0553148 * x - 0.07691036;
    return select(power, 12.92 * x, x <= vec3f(0.0031308));
}

// The colour of a value on the logarithmic scale.
fn graded(value: vec3f) -> vec3f {
    let y = dot(max(value, vec3f(0.0)), frame.luminance.xyz);
    let place = clamp((log2(max(y, 1e-37)) - frame.scale.x) * frame.scale.y, 0.0, 1.0) * f32(RAMP - 1u);
    let below = min(u32(place), RAMP - 2u);
    return mix(frame.ramp[below].rgb, frame.ramp[below + 1u].rgb, place - f32(below));
}

// What a screen shows, of linear sRGB 0…1.
fn encoded(linear: vec3f) -> vec4f {
    return vec4f(select(linear, srgb_encode(linear), frame.denominator.w > 0.5), 1.0);
}

// What of tone mapping is linear: the same before interpolation and after it.
fn exposed(value: vec3f) -> vec3f {
    if FALSE_COLORS {
        return value;
    }
    return frame.to_srgb * clamp(value * frame.numerator.z, vec3f(0.0), vec3f(frame.numerator.w));
}

// The rest of it.
fn developed(value: vec3f) -> vec4f {
    if FALSE_COLORS {
        return encoded(graded(value));
    }
    return encoded(printed(max(value, vec3f(0.0))));
}

fn shown(value: vec3f) -> vec4f {
    return developed(exposed(value));
}

@fragment
fn plain_fragment(in: Plain) -> @location(0) vec4f {
    return developed(in.value);
}

fn texel_at(uv: vec2f) -> vec3f {
    let place = vec3f(uv, 1.0);
    return textureSample(texels, texel_sampler, vec2f(dot(placement.u.xyz, place), dot(placement.v.xyz, place))).rgb;
}

@fragment
fn textured_fragment(in: Textured) -> @location(0) vec4f {
    // Irradiance is that of what is under the texture.
    return shown(in.diffuse * select(texel_at(in.uv), vec3f(1.0), frame.luminance.w > 2.5) + in.other);
}
