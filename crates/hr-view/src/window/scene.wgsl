// Radiance at the vertices, interpolated, and tone mapped at the pixel.

const RAMP = 7u; // colours of the false-colour ramp, as in gauge.rs
const PI = 3.14159265;

struct Frame {
    eye: vec4f,         // relative to the mesh's origin
    right: vec4f,       // unit; w: horizontal scale, cotangent of half the field of view
    up: vec4f,          // unit; w: vertical scale
    forward: vec4f,     // unit; w: distance of the near plane
    to_srgb: mat3x3f,   // from the scene's primaries to linear sRGB
    numerator: vec4f,   // a, b of the curve; exposure; largest exposed value
    denominator: vec4f, // c, d, e of the curve; 1 where the target does not encode sRGB by itself
    luminance: vec4f,   // weights; w: the quantity in false colours: 0 none, 1 radiance, 2 radiosity, 3 irradiance
    scale: vec4f,       // binary logarithm of the low end, 1 / that of high / low
    ramp: array<vec4f, RAMP>,
}

struct Placement {
    u: vec4f,           // rows of the texture's transform
    v: vec4f,
}

struct Fragment {
    @builtin(position) position: vec4f,
    @location(0) irradiance: vec3f,
    @location(1) tint: vec3f,
    @location(2) radiance: vec3f,
    @location(3) uv: vec2f,
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

@vertex
fn diffuse_vertex(v: Vertex) -> Fragment {
    return Fragment(project(v.point), v.irradiance, v.tint, v.emission, v.uv);
}

@vertex
fn glossy_vertex(v: Vertex, @location(5) glossy: vec3f) -> Fragment {
    return Fragment(project(v.point), v.irradiance, v.tint, v.emission + select(glossy, vec3f(0.0), frame.luminance.w > 1.5), v.uv);
}

fn curve(x: vec3f) -> vec3f {
    let n = frame.numerator;
    let d = frame.denominator;
    return clamp((x * (n.x * x + n.y)) / (x * (d.x * x + d.y) + d.z), vec3f(0.0), vec3f(1.0));
}

fn srgb_encode(x: vec3f) -> vec3f {
    return select(1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3f(0.0031308));
}

// The colour of a value on the logarithmic scale.
fn graded(value: vec3f) -> vec3f {
    let y = dot(max(value, vec3f(0.0)), frame.luminance.xyz);
    let place = clamp((log2(max(y, 1e-37)) - frame.scale.x) * frame.scale.y, 0.0, 1.0) * f32(RAMP - 1u);
    let below = min(u32(place), RAMP - 2u);
    return mix(frame.ramp[below].rgb, frame.ramp[below + 1u].rgb, place - f32(below));
}

// What a screen shows, of linear sRGB 0…1.
fn encoded(shown: vec3f) -> vec4f {
    return vec4f(select(shown, srgb_encode(shown), frame.denominator.w > 0.5), 1.0);
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4f {
    let place = vec3f(in.uv, 1.0);
    let texel = textureSample(texels, texel_sampler, vec2f(dot(placement.u.xyz, place), dot(placement.v.xyz, place)));
    let radiance = in.irradiance * in.tint * texel.rgb + in.radiance;
    if frame.luminance.w > 0.5 {
        let value = select(select(radiance, PI * radiance, frame.luminance.w > 1.5), in.irradiance, frame.luminance.w > 2.5);
        return encoded(graded(value));
    }
    let exposed = clamp(radiance * frame.numerator.z, vec3f(0.0), vec3f(frame.numerator.w));
    return encoded(curve(max(frame.to_srgb * exposed, vec3f(0.0))));
}
