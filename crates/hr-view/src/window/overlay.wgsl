// Lines and surfaces over the picture, in the colours that they have.

struct Frame {
    eye: vec4f,
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    to_srgb: mat3x3f,
    numerator: vec4f,
    denominator: vec4f,
}

struct Fragment {
    @builtin(position) position: vec4f,
    @location(0) color: vec4f,
}

// What lies on a surface is drawn this much nearer to the eye.
const NEARER: f32 = 0.998;

@group(0) @binding(0) var<uniform> frame: Frame;

@vertex
fn overlay_vertex(@location(0) point: vec3f, @location(1) color: vec4f) -> Fragment {
    let to = (point - frame.eye.xyz) * NEARER;
    let x = dot(to, frame.right.xyz) * frame.right.w;
    let y = dot(to, frame.up.xyz) * frame.up.w;
    return Fragment(vec4f(x, y, frame.forward.w, dot(to, frame.forward.xyz)), color);
}

fn srgb_encode(x: vec3f) -> vec3f {
    return select(1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3f(0.0031308));
}

@fragment
fn overlay_fragment(in: Fragment) -> @location(0) vec4f {
    return vec4f(select(in.color.rgb, srgb_encode(in.color.rgb), frame.denominator.w > 0.5), in.color.a);
}
