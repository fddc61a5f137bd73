// Glossy light at the pixel: the illumination samples of a leaf and of all nodes above it, reflected by the material's
// formula. What is computed is what glossy_ext does: `arrived` of its samples, `extent` and the reflectors of the same
// names, where everything is explained; `scene.wgsl` comes before this.

const VARIES = 0x80000000u;
const DISTANT = 1u;
const ORIENTED = 2u;
const SHINES = 4u;
const HORIZON = 1e-6;
const MOST_RENEWAL = 4.0;
const DIELECTRIC_F0 = 0.04;
const MEAN_W = 0.00368455;
const LOSSES = 33u;

// Bits of the kinds of lobes that there are: the others cost nothing.
override KINDS: u32 = 15u;

struct Leaf {
    first: u32,
    count: u32,
    material: u32,
}

struct Arrival {
    center: vec3f,
    kind: u32,
    radius: f32,
    area: f32,
    spread: f32,
    cosine: f32,
    irradiance: vec3f,
    mean_x: f32,
    mean_yz: vec2f,
    squares_xy: vec2f,
    squares_z: f32,
    mixed_x: f32,
    mixed_yz: vec2f,
}

@group(2) @binding(0) var<storage, read> leaves: array<Leaf>;
@group(2) @binding(1) var<storage, read> runs: array<vec2u>;
@group(2) @binding(2) var<storage, read> arrivals: array<Arrival>;
@group(2) @binding(3) var<storage, read> reflectors: array<vec4f>;

struct Sampled {
    @builtin(position) position: vec4f,
    @location(0) diffuse: vec3f,
    @location(1) emission: vec3f,
    @location(2) uv: vec2f,
    @location(3) point: vec3f,
    @location(4) normal: vec3f,
    @location(5) color: vec3f,
    @location(6) @interpolate(flat, either) leaf: u32,
}

struct Followed {
    @location(5) normal: vec3f,
    @location(6) color: vec3f,
    @location(7) leaf: u32,
}

@vertex
fn sampled(v: Vertex, f: Followed) -> Sampled {
    let l = light(v, vec3f(0.0));
    return Sampled(project(v.point), l.diffuse, l.other, v.uv, v.point, f.normal, f.color, f.leaf);
}

// Light of one sender, in the frame of the place.
struct Incident {
    direction: vec3f,
    extent: f32,
    irradiance: vec3f,
}

// The visible part of a sender.
struct Disk {
    middle: vec3f,
    radius2: f32,
    mean_cos: f32,      // 0: nothing is visible
}

struct Slopes {
    incident: vec3f,
    inv_z: f32,
    slope: vec2f,
    square: vec3f,      // xx, xy, yy of J Jᵀ
}

struct Meeting {
    incident: vec3f,
    h: vec3f,
    tan2: f32,
    weight: f32,
    square: vec3f,
    middle: vec2f,
}

fn mean_cosine(a: Arrival, direction: vec3f) -> f32 {
    let x = dot(vec3f(a.mean_x, a.mean_yz), direction);
    let squares = dot(vec3f(a.squares_xy, a.squares_z), direction * direction);
    let mixed = dot(vec3f(a.mixed_x, a.mixed_yz), direction.yzx * direction.zxy);
    let x2 = max(squares + 2.0 * mixed, x * x);
    let series = 0.25 + 0.5 * x + 0.15625 * (3.0 * x2 - 1.0);
    return max(max(min(series, 0.5 * (x + sqrt(x2))), x), 0.0);
}

// A sample as it arrives at a place; no irradiance below the horizon.
fn arrived(a: Arrival, at: vec3f, frame_: mat3x3f) -> Incident {
    var direction = a.center;
    var extent = 0.0;
    var renewal = 1.0;
    if (a.kind & DISTANT) == 0u {
        let to = a.center - at;
        let d2 = max(dot(to, to), 1e-12 * a.spread);
        direction = to * inverseSqrt(d2);
        let share = min(a.area * mean_cosine(a, -direction), a.radius * a.radius) / d2;
        extent = asin(sqrt(min(share, 1.0)));
        renewal = a.spread / (d2 + a.radius * a.radius);
    }
    let local = direction * frame_;
    let cosine = local.z;
    var scale = 0.0;
    if (a.kind & ORIENTED) != 0u {
        let turned = select(1.0, cosine / a.cosine, a.cosine > 0.1 && cosine > 0.0);
        scale = clamp(renewal * turned, 1.0 / MOST_RENEWAL, MOST_RENEWAL);
    } else {
        scale = clamp(renewal, 1.0 / MOST_RENEWAL, MOST_RENEWAL) * cosine;
    }
    let arrives = scale > 0.0 && (cosine > 0.0 || extent > 0.0);
    return Incident(local, extent, select(vec3f(0.0), a.irradiance * scale, arrives));
}

fn disk_of(direction: vec3f, extent: f32) -> Disk {
    let z = direction.z;
    if extent <= 0.0 {
        return Disk(direction, 0.0, select(0.0, z, z > HORIZON));
    }
    let extent2 = min(extent, 0.5 * PI) * min(extent, 0.5 * PI);
    let radius2 = extent2 * (1.0 - extent2 * (1.0 / 12.0 - extent2 / 360.0));
    let steep2 = max(1.0 - z * z, 0.0);
    if z > HORIZON && z * z >= extent2 * steep2 {
        return Disk(direction, radius2, max(z * (1.0 - 0.25 * radius2), HORIZON));
    }
    let steep = sqrt(steep2);
    let reach = sqrt(extent2) * steep;
    if z + reach <= HORIZON || reach == 0.0 {
        return Disk(direction, 0.0, 0.0);
    }
    let t = min(z / reach, 1.0);
    let mean = max(0.4244 + t * (0.5 + t * 0.0756), 0.0);
    let t2 = t * t;
    let area = max(0.5 + t * (0.63661977 - t2 * (0.0232 + 0.1134 * t2)), 0.0);
    let turn = sqrt(extent2) * (mean - t) / steep;
    let moved = direction + turn * (vec3f(0.0, 0.0, 1.0) - z * direction);
    let middle = moved / max(length(moved), 1e-30);
    return Disk(middle, radius2 * area, select(0.0, max(reach * mean, HORIZON), middle.z > HORIZON));
}

fn slopes_of(incident: vec3f, outgoing: vec3f, stretch: vec2f) -> Slopes {
    let largest = 1e15;
    let h = incident + outgoing;
    let inv_z = 1.0 / h.z;
    let slope = h.xy * inv_z;
    let pq = incident.xy - slope * incident.z;
    let scale = inv_z * inv_z;
    let square = scale * vec3f(
        stretch.x * stretch.x * (1.0 + slope.x * slope.x - pq.x * pq.x),
        stretch.x * stretch.y * (slope.x * slope.y - pq.x * pq.y),
        stretch.y * stretch.y * (1.0 + slope.y * slope.y - pq.y * pq.y),
    );
    return Slopes(incident, inv_z, slope, clamp(square, vec3f(0.0, -largest, 0.0), vec3f(largest)));
}

// √det M, and (det M) M⁻¹ s, for M = lobe·I + share·square.
fn solved(square: vec3f, lobe: f32, share: f32, s: vec2f) -> vec3f {
    let m = vec3f(lobe + share * square.x, share * square.y, lobe + share * square.z);
    let root = sqrt(max(m.x * m.z - m.y * m.y, lobe * lobe));
    return vec3f(root, m.z * s.x - m.y * s.y, m.x * s.y - m.y * s.x);
}

// Where a lobe of half-vector slopes of a variance per axis and a disk meet.
fn meeting_of(disk: Disk, outgoing: vec3f, stretch: vec2f, first: Slopes, variance: f32) -> Meeting {
    var slopes = first;
    var middle = slopes.slope * stretch;
    let share = 0.25 * disk.radius2;
    if share * (slopes.square.x + slopes.square.z) > 1e-3 * variance {
        let found = solved(slopes.square, variance, share, middle);
        // Jᵀ of it.
        let v = found.yz * stretch;
        let g = vec3f(v, -dot(slopes.slope, v)) * slopes.inv_z;
        let along = g - slopes.incident * dot(slopes.incident, g);
        var step = along * (-share / (found.x * found.x));
        let length2 = dot(step, step);
        if length2 > disk.radius2 {
            step *= sqrt(disk.radius2 / length2);
        }
        let moved = disk.middle + step;
        let incident = moved / length(moved);
        if incident.z > HORIZON {
            slopes = slopes_of(incident, outgoing, stretch);
            let off = disk.middle - incident;
            let across = off - incident * dot(incident, off);
            middle = slopes.slope * stretch + (across.xy - slopes.slope * across.z) * stretch * slopes.inv_z;
        }
    }
    let weight = slopes.incident.z / disk.mean_cos;
    let tan2 = dot(slopes.slope, slopes.slope);
    return Meeting(slopes.incident, slopes.incident + outgoing, tan2, weight, slopes.square * disk.radius2, middle);
}

// For M = lobe·I + share·E: √det M, and √det M × sᵀM⁻¹s.
fn rounded(m: Meeting, lobe: f32, share: f32) -> vec2f {
    let found = solved(m.square, lobe, share, m.middle);
    return vec2f(found.x, max(dot(m.middle, found.yz) / found.x, 0.0));
}

fn exp_mean(t: f32) -> f32 {
    return select((1.0 - exp(-t)) / t, 1.0 - t * (0.5 - t * (1.0 / 6.0 - t * (1.0 / 24.0))), t < 0.1);
}

fn gaussian_over_disk(x: f32, y: f32) -> f32 {
    let peak = exp_mean(y);
    if y < 0.1 {
        return peak * exp(-x * peak);
    }
    let lambda = y * y / (4.0 + y * sqrt(y) / 1.2);
    let mean = exp_mean(lambda);
    let exponent = x * peak / mean - lambda;
    if exponent > 80.0 {
        return 0.0;
    }
    return peak / (lambda * mean + exp(exponent));
}

fn ggx_over_disk(x: f32, y: f32) -> f32 {
    let a = 1.0 + x - y;
    let s = sqrt(a * a + 4.0 * y);
    return select((s - a) / (2.0 * y * s), 2.0 / (s * (s + a)), a > 0.0);
}

// −ln(1 − x), exact for small x, too.
fn log_below(x: f32) -> f32 {
    return select(-log(1.0 - x), x * (1.0 + x * (0.5 + x / 3.0)), x < 0.01);
}

fn phong(disk: Disk, mirror: vec3f, n: f32) -> f32 {
    let apart = mirror - disk.middle;
    let versine = 0.5 * dot(apart, apart);
    if versine >= 1.0 {
        return 0.0;
    }
    let exponent = n * log_below(versine);
    if disk.radius2 == 0.0 {
        return exp(-exponent);
    }
    let share = 0.25 * disk.radius2 * n;
    let step = min(share / (1.0 + share), sqrt(disk.radius2 / (2.0 * max(versine, 1e-30))));
    return (disk.middle.z + step * apart.z) / disk.mean_cos * gaussian_over_disk(exponent, 2.0 * share);
}

fn ward(disk: Disk, outgoing: vec3f, alpha: f32, stretch: vec2f) -> f32 {
    let alpha2 = alpha * alpha;
    // No direction of the disk makes a half vector with a smaller slope than this.
    let h = disk.middle + outgoing;
    let radius = sqrt(disk.radius2);
    let nearest = radius * max(stretch.x, stretch.y) + 4.0 * alpha * (h.z + radius);
    if dot(h.xy * stretch, h.xy * stretch) > nearest * nearest {
        return 0.0;
    }
    let first = slopes_of(disk.middle, outgoing, stretch);
    if disk.radius2 == 0.0 {
        let stretched = first.slope * stretch;
        let tan2 = dot(first.slope, first.slope);
        return exp(-dot(stretched, stretched) / alpha2) * (1.0 + tan2) * first.inv_z * first.inv_z;
    }
    let meeting = meeting_of(disk, outgoing, stretch, first, 0.5 * alpha2);
    let is_round = stretch.x == 1.0 && stretch.y == 1.0;
    let share = select(1.0, 0.5, is_round);
    let found = rounded(meeting, alpha2, share);
    let radius2 = max(found.x - alpha2, 0.0) / share;
    let factor = meeting.weight * (1.0 + meeting.tan2) / (meeting.h.z * meeting.h.z);
    return factor * gaussian_over_disk(found.y / alpha2, radius2 / alpha2);
}

fn schlick(h: vec3f) -> f32 {
    let m = max(1.0 - 0.5 * length(h), 0.0);
    return m * m * m * m * m;
}

fn visibility(alpha2: f32, i: f32, o: f32) -> f32 {
    let roots = sqrt(max(vec2f(alpha2) + (1.0 - alpha2) * vec2f(i * i, o * o), vec2f(0.0)));
    return 0.5 / (o * roots.x + i * roots.y);
}

// The lobe D G / (4 (V·N) (L·N)), w for it, and w averaged over the disk.
fn ggx(disk: Disk, outgoing: vec3f, alpha: f32) -> vec3f {
    let alpha2 = alpha * alpha;
    let h = disk.middle + outgoing;
    if disk.radius2 == 0.0 {
        let ratio = dot(h, h) / (dot(h.xy, h.xy) + alpha2 * h.z * h.z);
        let w = schlick(h);
        return vec3f(alpha2 / PI * ratio * ratio * visibility(alpha2, disk.middle.z, outgoing.z), w, w);
    }
    let first = slopes_of(disk.middle, outgoing, vec2f(1.0));
    let variance = 0.25 * (alpha2 + dot(first.slope, first.slope));
    let meeting = meeting_of(disk, outgoing, vec2f(1.0), first, variance);
    let root = rounded(meeting, alpha2, 1.0).x;
    let squared = rounded(meeting, alpha2 + meeting.tan2, 1.0).y;
    let density = ggx_over_disk(squared / alpha2, (root - alpha2) / alpha2) / (PI * alpha2);
    let inv_cos2 = 1.0 + meeting.tan2;
    let factor = meeting.weight * inv_cos2 * inv_cos2 * visibility(alpha2, meeting.incident.z, outgoing.z);
    return vec3f(density * factor, schlick(meeting.h), schlick(h));
}

// What compensated albedos leave of 1, at a cosine.
fn losses_at(table: u32, cosine: f32) -> vec2f {
    let x = sqrt(clamp(cosine, 0.0, 1.0)) * f32(LOSSES - 1u);
    let k = min(u32(x), LOSSES - 2u);
    return mix(reflectors[table + k].xy, reflectors[table + k + 1u].xy, x - f32(k));
}

fn further_bounces(f0: vec3f, loss: f32) -> vec3f {
    let fresnel = f0 + (1.0 - f0) / 21.0;
    return fresnel * fresnel * (1.0 - loss) / (1.0 - fresnel * loss);
}

fn per(loss: f32) -> f32 {
    return select(0.0, 1.0 / (PI * max(loss, 1e-4)), loss > 1e-4);
}

// Glossy BRDF of a lobe, averaged over a disk.
fn reflected(place: u32, disk: Disk, outgoing: vec3f, own_color: bool, color: vec3f) -> vec3f {
    let shape = reflectors[place];
    let tint = reflectors[place + 1u];
    let last = reflectors[place + 2u];
    if (KINDS & 1u) != 0u && shape.x < 0.5 {
        return tint.rgb * phong(disk, vec3f(-outgoing.xy, outgoing.z), shape.y);
    }
    if (KINDS & 2u) != 0u && shape.x < 1.5 {
        return tint.rgb * ward(disk, outgoing, shape.y, last.xy);
    }
    if (KINDS & 12u) == 0u {
        return vec3f(0.0);
    }
    let base = select(clamp(color, vec3f(0.0), vec3f(1.0)), tint.rgb, own_color);
    let metallic = tint.w;
    let f0 = DIELECTRIC_F0 * (1.0 - metallic) + base * metallic;
    let found = ggx(disk, outgoing, shape.y);
    let single = f0 * (found.x * (1.0 - found.y)) + found.x * found.y;
    if (KINDS & 8u) == 0u || shape.x < 2.5 {
        return single + base * ((1.0 - metallic) / PI * (1.0 - DIELECTRIC_F0) * (MEAN_W - found.z));
    }
    let mean = last.xy;
    let m = further_bounces(vec3f(DIELECTRIC_F0), mean.x) * (1.0 - metallic) + further_bounces(base, mean.x) * metallic;
    let table = u32(last.z);
    let product = losses_at(table, disk.mean_cos) * losses_at(table, outgoing.z);
    let matte = base * ((1.0 - metallic) * per(mean.y));
    return single + m * per(mean.x) * product.x + matte * (product.y - mean.y * mean.y);
}

// Any frame about a normal, or the one whose x axis follows a grain.
fn frame_of(normal: vec3f, has_grain: bool, grain: vec3f) -> mat3x3f {
    let across = cross(normal, grain);
    if has_grain && dot(across, across) > 1e-6 {
        let y = normalize(across);
        return mat3x3f(cross(y, normal), y, normal);
    }
    let aside = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(normal.x) > 0.7);
    let y = normalize(cross(normal, aside));
    return mat3x3f(cross(y, normal), y, normal);
}

// Glossy radiance toward the eye.
fn glossy(in: Sampled, color: vec3f) -> vec3f {
    let leaf = leaves[in.leaf];
    let material = leaf.material & ~VARIES;
    let own_color = (leaf.material & VARIES) == 0u;
    let head = reflectors[material];
    let lobes = u32(head.x);
    let away = normalize(frame.eye.xyz - in.point);
    var normal = normalize(in.normal);
    let facing = dot(normal, away);
    if facing <= 0.02 {
        normal = normalize(normal + away * (0.02 - facing));
    }
    let axes = frame_of(normal, head.z > 0.5, reflectors[material + 1u].xyz);
    let outgoing = away * axes;
    var sum = vec3f(0.0);
    if outgoing.z <= HORIZON {
        return sum;
    }
    // Runs have ends that are known beforehand: lanes beside a triangle must come to one, too.
    for (var i = leaf.first; i < leaf.first + leaf.count; i++) {
        let run = runs[i];
        for (var k = run.x; k < run.y; k++) {
            let incident = arrived(arrivals[k], in.point, axes);
            let overlap = select(head.w, 1.0, (arrivals[k].kind & SHINES) != 0u);
            let disk = disk_of(incident.direction, max(incident.extent * overlap, head.y));
            if disk.mean_cos > 0.0 && any(incident.irradiance > vec3f(0.0)) {
                for (var lobe = 0u; lobe < lobes; lobe++) {
                    sum += incident.irradiance * reflected(material + 2u + 3u * lobe, disk, outgoing, own_color, color);
                }
            }
        }
    }
    return sum;
}

// Of the picture and of radiance in false colours the glossy light is a part, of the other quantities it is none.
fn with_glossy(in: Sampled, diffuse: vec3f, color: vec3f) -> vec4f {
    if frame.luminance.w > 1.5 {
        return shown(diffuse + in.emission);
    }
    return shown(max(diffuse + glossy(in, color), vec3f(0.0)) + in.emission);
}

@fragment
fn sampled_plain_fragment(in: Sampled) -> @location(0) vec4f {
    return with_glossy(in, in.diffuse, in.color);
}

@fragment
fn sampled_textured_fragment(in: Sampled) -> @location(0) vec4f {
    let texel = texel_at(in.uv);
    let factor = select(texel, vec3f(1.0), frame.luminance.w > 2.5);
    return with_glossy(in, in.diffuse * factor, in.color * texel);
}
