// Glossy light at the pixel: the illumination samples of a leaf and of all nodes above it, reflected by the material's
// formula. What is computed is what glossy_ext does: `arrived` of its samples, `extent` and the reflectors of the same
// names, `contour`, where everything is explained; `scene.wgsl` comes before this.

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

// Whether senders that are polygons have their outline; without it all are disks.
override OUTLINES: bool = true;

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
    across: vec3f,
    taper: f32,
    along: vec3f,
    unused: f32,
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
    contour: Contour,
}

// A sender's outline over the distance of its middle.
struct Contour {
    across: vec3f,
    along: vec3f,
    taper: f32,
    reach: f32,         // 0: there is none
}

// The same in the plane of slopes.
struct Trapezoid {
    middle: vec2f,
    across: vec2f,
    along: vec2f,
    taper: f32,
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

// Of half a side over the distance of the middle, at least so wide as it is seen.
fn widened(side: vec3f, middle: vec3f, least: f32) -> vec3f {
    let seen = side - middle * dot(middle, side);
    return side + seen * max(least / max(length(seen), 1e-30) - 1.0, 0.0);
}

// A contour about its middle of these half sides, seen at least so wide.
fn contour_of(middle: vec3f, across: vec3f, along: vec3f, taper: f32, narrowest: f32) -> Contour {
    let widest = 0.8;
    let least = 0.8862269 * narrowest;
    let u = widened(across, middle, least);
    let v = widened(along, middle, least);
    let away = vec2f(dot(middle, u), dot(middle, v));
    let aside = u - middle * away.x;
    let above = v - middle * away.y;
    // Of its corners.
    let s = vec4f(1.0 + taper, -1.0 - taper, 1.0 - taper, taper - 1.0);
    let t = vec4f(-1.0, -1.0, 1.0, 1.0) + taper / 3.0;
    let depth = 1.0 + s * away.x + t * away.y;
    let square = s * s * dot(aside, aside) + 2.0 * s * t * dot(aside, above) + t * t * dot(above, above);
    let tangents = sqrt(max(square, vec4f(0.0))) / max(depth, vec4f(1e-30));
    let reach = max(max(tangents.x, tangents.y), max(tangents.z, tangents.w));
    return Contour(u, v, taper, select(0.0, reach, reach <= widest));
}

// Whether a lobe of half-vector slopes of this width shows that a sender about `middle` is no disk.
fn shows(c: Contour, middle: vec3f, width: f32) -> bool {
    return c.reach > 0.25 * width && c.reach > 0.0 && middle.z - c.reach > HORIZON;
}

// A sample as it arrives at a place; no irradiance below the horizon.
fn arrived(a: Arrival, at: vec3f, frame_: mat3x3f, narrowest: f32) -> Incident {
    var direction = a.center;
    var extent = 0.0;
    var renewal = 1.0;
    var contour = Contour(vec3f(0.0), vec3f(0.0), 0.0, 0.0);
    if (a.kind & DISTANT) == 0u {
        let to = a.center - at;
        let d2 = max(dot(to, to), 1e-12 * a.spread);
        direction = to * inverseSqrt(d2);
        let share = min(a.area * mean_cosine(a, -direction), a.radius * a.radius) / d2;
        extent = asin(sqrt(min(share, 1.0)));
        renewal = a.spread / (d2 + a.radius * a.radius);
        if OUTLINES && any(a.across != vec3f(0.0)) {
            let near = inverseSqrt(d2);
            let across = a.across * frame_ * near;
            let along = a.along * frame_ * near;
            contour = contour_of(direction * frame_, across, along, a.taper, narrowest);
        }
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
    return Incident(local, extent, select(vec3f(0.0), a.irradiance * scale, arrives), contour);
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

// J v for v perpendicular to the incident direction.
fn slope_of_half(s: Slopes, stretch: vec2f, v: vec3f) -> vec2f {
    return (v.xy - s.slope * v.z) * stretch * s.inv_z;
}

// J v.
fn slope_of(s: Slopes, stretch: vec2f, v: vec3f) -> vec2f {
    return slope_of_half(s, stretch, v - s.incident * dot(s.incident, v));
}

// Product of a lobe and a contour.
struct Product {
    mean: vec2f,
    covariance: vec3f,      // ss, st, tt
}

// A contour about one of its directions.
struct Expansion {
    incident: vec3f,
    nearness: f32,
    recede: vec2f,
    across: vec3f,          // turns
    along: vec3f,
    meeting: Product,
    taper: f32,
}

fn expansion_of(c: Contour, middle: vec3f, meeting: Product) -> Expansion {
    let moved = middle + c.across * meeting.mean.x + c.along * meeting.mean.y;
    let nearness = inverseSqrt(dot(moved, moved));
    let incident = moved * nearness;
    let across = c.across * nearness;
    let along = c.along * nearness;
    let recede = vec2f(dot(incident, across), dot(incident, along));
    return Expansion(incident, nearness, recede, across - incident * recede.x, along - incident * recede.y, meeting, c.taper);
}

// Mean squared angle at steps of this covariance.
fn spread(e: Expansion, covariance: vec3f) -> f32 {
    let squares = vec3f(dot(e.across, e.across), 2.0 * dot(e.across, e.along), dot(e.along, e.along));
    return dot(covariance, squares);
}

// What is mapped to the plane of slopes, these being where the middle and the turns are mapped to.
fn mapped(e: Expansion, at: vec2f, shrinks: vec2f, fall: vec2f, across: vec2f, along: vec2f) -> Trapezoid {
    let c = e.meeting.covariance;
    let bend = e.recede + shrinks;
    let back = e.meeting.mean + vec2f(dot(c.xy, bend), dot(c.yz, bend));
    let middle = at - across * back.x - along * back.y - fall * (0.5 * spread(e, c));
    return Trapezoid(middle, across, along, e.taper);
}

// Irradiance from there over the mean of all parts.
fn weight_of(e: Expansion, cosine: f32, rise: f32) -> f32 {
    let c = e.meeting.covariance;
    let all = variances(e.taper);
    let bulge = 2.0 * spread(e, vec3f(all.x, 0.0, all.y)) - (2.0 - rise) * spread(e, c);
    let depth = 10.0 * dot(e.recede * e.recede, all - c.xz);
    return e.incident.z * e.nearness * e.nearness * e.nearness * (1.0 + bulge) / (cosine * (1.0 + depth));
}

struct Within {
    meeting: Meeting,
    outline: Trapezoid,
}

// Where a lobe and a sender with a contour meet, and the contour's slopes there.
fn within(disk: Disk, c: Contour, outgoing: vec3f, stretch: vec2f, first: Slopes, variance: f32, rise: f32) -> Within {
    let across = slope_of(first, stretch, c.across);
    let seen = Trapezoid(first.slope * stretch, across, slope_of(first, stretch, c.along), c.taper);
    let e = expansion_of(c, disk.middle, product(seen, variance));
    let slopes = slopes_of(e.incident, outgoing, stretch);
    let shrinks = vec2f(e.across.z, e.along.z) * slopes.inv_z;
    let fall = slope_of_half(slopes, stretch, e.incident);
    let u = slope_of_half(slopes, stretch, e.across);
    let v = slope_of_half(slopes, stretch, e.along);
    let outline = mapped(e, slopes.slope * stretch, shrinks, fall, u, v);
    let tan2 = dot(slopes.slope, slopes.slope);
    let weight = weight_of(e, disk.middle.z, rise);
    let met = Meeting(e.incident, e.incident + outgoing, tan2, weight, slopes.square, outline.middle);
    return Within(met, outline);
}

// Variances of s (1 − taper t) and t.
fn variances(taper: f32) -> vec2f {
    return vec2f((1.0 + taper * taper) / 3.0, 1.0 / 3.0 - taper * taper / 9.0);
}

// For M = lobe·I + share·covariance: det M, and (det M) M⁻¹ middle.
fn outline_solved(o: Trapezoid, lobe: f32, share: f32) -> vec3f {
    let v = share * variances(o.taper);
    let xx = lobe + v.x * o.across.x * o.across.x + v.y * o.along.x * o.along.x;
    let xy = v.x * o.across.x * o.across.y + v.y * o.along.x * o.along.y;
    let yy = lobe + v.x * o.across.y * o.across.y + v.y * o.along.y * o.along.y;
    let m = o.middle;
    return vec3f(max(xx * yy - xy * xy, lobe * lobe), yy * m.x - xy * m.y, xx * m.y - xy * m.x);
}

fn product(o: Trapezoid, variance: f32) -> Product {
    let v = variances(o.taper);
    let uu = variance + v.x * dot(o.across, o.across);
    let uv = dot(o.across, o.along);
    let vv = variance + v.y * dot(o.along, o.along);
    let share = 1.0 / max(uu * vv - v.x * v.y * uv * uv, variance * variance);
    let m = vec2f(dot(o.middle, o.across), dot(o.middle, o.along));
    let third = o.taper / 3.0;
    let t = clamp(v.y * share * (v.x * uv * m.x - uu * m.y), third - 1.0, third + 1.0);
    let half_ = 1.0 - o.taper * (t - third);
    let s = clamp(v.x * share * (v.y * uv * m.y - vv * m.x), -half_, half_);
    return Product(vec2f(s, t), vec3f(v.x * vv, -v.x * v.y * uv, v.y * uu) * (share * variance));
}

fn scaled(o: Trapezoid, scale: f32) -> Trapezoid {
    return Trapezoid(o.middle * scale, o.across * scale, o.along * scale, o.taper);
}

fn size2(o: Trapezoid) -> f32 {
    let wide = 1.0 + o.taper;
    return max(dot(o.across, o.across) * wide * wide, dot(o.along, o.along));
}

fn erf4(x: vec4f) -> vec4f {
    let size = abs(x);
    let t = 1.0 / (1.0 + 0.3275911 * size);
    let series = t * (0.2548296 + t * (-0.28449672 + t * (1.4214138 + t * (-1.453152 + t * 1.0614054))));
    return (1.0 - series * exp(-size * size)) * sign(x);
}

fn inverse_erf4(x: vec4f) -> vec4f {
    let w = -log(max((1.0 - x) * (1.0 + x), vec4f(1e-7)));
    let a = w - 2.5;
    let near = 1.5014094 + a * (0.24664073 + a * (-4.1776816e-3 + a * (-1.253725e-3 + a * (2.1858087e-4
        + a * (-4.3915065e-6 + a * (-3.5233877e-6 + a * (3.4327394e-7 + a * 2.8102264e-8)))))));
    let b = sqrt(w) - 3.0;
    let far = 2.8329768 + b * (1.001674 + b * (9.4388705e-3 + b * (-7.6224613e-3 + b * (5.7395077e-3
        + b * (-3.6734284e-3 + b * (1.3493432e-3 + b * (1.0095056e-4 - b * 2.0021426e-4)))))));
    return x * select(far, near, w < vec4f(5.0));
}

// Mean of exp(−|p|²) over a trapezoid.
fn gaussian_over(o: Trapezoid) -> f32 {
    if size2(o) < 0.2 {
        let found = outline_solved(o, 1.0, 2.0);
        return exp(-dot(o.middle, found.yz) / found.x) / sqrt(found.x);
    }
    let width = length(o.across);
    let x_axis = o.across / width;
    let y_axis = vec2f(-x_axis.y, x_axis.x);
    let along = vec2f(dot(x_axis, o.along), dot(y_axis, o.along));
    let base = vec2f(dot(x_axis, o.middle), dot(y_axis, o.middle)) + along * (o.taper / 3.0);
    let height = abs(along.y);
    var t = vec4f(-0.8611363, -0.339981, 0.339981, 0.8611363);
    var weights = vec4f(0.3478548, 0.6521452, 0.6521452, 0.3478548);
    if height < 0.7 {
        let y = base.y + along.y * t;
        weights *= exp(-y * y) / (4.0 * 1.1283792 * width);
    } else {
        let ends = erf4(vec4f(base.y - height, base.y + height, 0.0, 0.0)).xy;
        let half_ = 0.5 * (ends.y - ends.x);
        let y = inverse_erf4(0.5 * (ends.x + ends.y) + half_ * t);
        t = clamp((y - base.y) / along.y, vec4f(-1.0), vec4f(1.0));
        weights *= 0.25 * PI * half_ / (4.0 * width * height);
    }
    let x = base.x + along.x * t;
    let half_width = width * (1.0 - o.taper * t);
    return dot(weights, erf4(x + half_width) - erf4(x - half_width));
}

// Twice ∫ 1/(1 + |p|²)² over the triangle between the origin and an edge.
fn ggx_edge(start: vec2f, end: vec2f) -> f32 {
    let edge = end - start;
    let long = max(length(edge), 1e-20);
    let distance_ = (start.x * edge.y - start.y * edge.x) / long;
    let from_ = dot(start, edge) / long;
    let root2 = 1.0 + distance_ * distance_;
    let root = sqrt(root2);
    return distance_ / root * atan2(long * root, root2 + from_ * (from_ + long));
}

// Mean of 1/(1 + |p|²)² over a trapezoid.
fn ggx_over(o: Trapezoid) -> f32 {
    let fall = 1.0 / (1.0 + dot(o.middle, o.middle));
    if size2(o) * fall < 0.03 {
        let v = variances(o.taper);
        let mixed = vec2f(dot(o.middle, o.across), dot(o.middle, o.along));
        let squares = vec2f(dot(o.across, o.across), dot(o.along, o.along));
        return fall * fall * (1.0 + 12.0 * fall * fall * dot(v, mixed * mixed) - 2.0 * fall * dot(v, squares));
    }
    let wide = o.across * (1.0 + o.taper);
    let narrow = o.across * (1.0 - o.taper);
    let low = o.middle + o.along * (o.taper / 3.0) - o.along;
    let high = low + 2.0 * o.along;
    let sum = ggx_edge(low - wide, low + wide) + ggx_edge(low + wide, high + narrow)
        + ggx_edge(high + narrow, high - narrow) + ggx_edge(high - narrow, low - wide);
    return 0.125 * abs(sum) / abs(o.across.x * o.along.y - o.across.y * o.along.x);
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

fn phong_over_contour(middle: vec3f, c: Contour, mirror: vec3f, n: f32) -> f32 {
    let aside = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(mirror.x) > 0.7);
    let unit = sqrt(0.5 * n);
    let x = normalize(cross(mirror, aside)) * unit;
    let y = cross(mirror, x);
    let across = c.across - middle * dot(middle, c.across);
    let along = c.along - middle * dot(middle, c.along);
    let seen = Trapezoid(flat(middle, x, y), flat(across, x, y), flat(along, x, y), c.taper);
    let e = expansion_of(c, middle, product(seen, 0.5));
    let apart = mirror - e.incident;
    let versine = 0.5 * dot(apart, apart);
    let at = flat(e.incident, x, y) * (1.0 + versine * (0.5 + 0.29 * versine));
    let outline = mapped(e, at, vec2f(0.0), vec2f(0.0), flat(e.across, x, y), flat(e.along, x, y));
    return weight_of(e, middle.z, 0.0) * gaussian_over(outline);
}

fn flat(v: vec3f, x: vec3f, y: vec3f) -> vec2f {
    return vec2f(dot(x, v), dot(y, v));
}

fn phong(disk: Disk, c: Contour, mirror: vec3f, n: f32) -> f32 {
    let apart = mirror - disk.middle;
    let versine = 0.5 * dot(apart, apart);
    if versine >= 1.0 {
        return 0.0;
    }
    if disk.radius2 > 0.0 && shows(c, disk.middle, sqrt(0.5 / n)) {
        return phong_over_contour(disk.middle, c, mirror, n);
    }
    let exponent = n * log_below(versine);
    if disk.radius2 == 0.0 {
        return exp(-exponent);
    }
    let share = 0.25 * disk.radius2 * n;
    let step = min(share / (1.0 + share), sqrt(disk.radius2 / (2.0 * max(versine, 1e-30))));
    return (disk.middle.z + step * apart.z) / disk.mean_cos * gaussian_over_disk(exponent, 2.0 * share);
}

fn ward(disk: Disk, c: Contour, outgoing: vec3f, alpha: f32, stretch: vec2f) -> f32 {
    let alpha2 = alpha * alpha;
    // No direction of the sender makes a half vector with a smaller slope than this.
    let h = disk.middle + outgoing;
    let radius = max(sqrt(disk.radius2), c.reach);
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
    if shows(c, disk.middle, alpha / max(stretch.x, stretch.y)) {
        let met = within(disk, c, outgoing, stretch, first, 0.5 * alpha2, 0.75);
        let factor = met.meeting.weight * (1.0 + met.meeting.tan2) / (met.meeting.h.z * met.meeting.h.z);
        return factor * gaussian_over(scaled(met.outline, 1.0 / alpha));
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

// The lobe where it meets a sender, over which its density of slopes is this.
fn at_meeting(m: Meeting, density: f32, alpha2: f32, outgoing: vec3f) -> f32 {
    let inv_cos2 = 1.0 + m.tan2;
    return density * m.weight * inv_cos2 * inv_cos2 * visibility(alpha2, m.incident.z, outgoing.z);
}

// The lobe D G / (4 (V·N) (L·N)), w for it, and w averaged over the disk.
fn ggx(disk: Disk, c: Contour, outgoing: vec3f, alpha: f32) -> vec3f {
    let alpha2 = alpha * alpha;
    let h = disk.middle + outgoing;
    if disk.radius2 == 0.0 {
        let ratio = dot(h, h) / (dot(h.xy, h.xy) + alpha2 * h.z * h.z);
        let w = schlick(h);
        return vec3f(alpha2 / PI * ratio * ratio * visibility(alpha2, disk.middle.z, outgoing.z), w, w);
    }
    let first = slopes_of(disk.middle, outgoing, vec2f(1.0));
    let width2 = alpha2 + dot(first.slope, first.slope);
    let variance = 0.25 * width2;
    if shows(c, disk.middle, sqrt(width2)) {
        let met = within(disk, c, outgoing, vec2f(1.0), first, variance, 1.0);
        let density = ggx_over(scaled(met.outline, 1.0 / alpha)) / (PI * alpha2);
        return vec3f(at_meeting(met.meeting, density, alpha2, outgoing), schlick(met.meeting.h), schlick(h));
    }
    let meeting = meeting_of(disk, outgoing, vec2f(1.0), first, variance);
    let root = rounded(meeting, alpha2, 1.0).x;
    let squared = rounded(meeting, alpha2 + meeting.tan2, 1.0).y;
    let density = ggx_over_disk(squared / alpha2, (root - alpha2) / alpha2) / (PI * alpha2);
    return vec3f(at_meeting(meeting, density, alpha2, outgoing), schlick(meeting.h), schlick(h));
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

// Glossy BRDF of a lobe, averaged over a sender.
fn reflected(place: u32, disk: Disk, c: Contour, outgoing: vec3f, own_color: bool, color: vec3f) -> vec3f {
    let shape = reflectors[place];
    let tint = reflectors[place + 1u];
    let last = reflectors[place + 2u];
    if (KINDS & 1u) != 0u && shape.x < 0.5 {
        return tint.rgb * phong(disk, c, vec3f(-outgoing.xy, outgoing.z), shape.y);
    }
    if (KINDS & 2u) != 0u && shape.x < 1.5 {
        return tint.rgb * ward(disk, c, outgoing, shape.y, last.xy);
    }
    if (KINDS & 12u) == 0u {
        return vec3f(0.0);
    }
    let base = select(clamp(color, vec3f(0.0), vec3f(1.0)), tint.rgb, own_color);
    let metallic = tint.w;
    let f0 = DIELECTRIC_F0 * (1.0 - metallic) + base * metallic;
    let found = ggx(disk, c, outgoing, shape.y);
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
            let incident = arrived(arrivals[k], in.point, axes, head.y);
            let contour = incident.contour;
            let overlap = select(head.w, 1.0, (arrivals[k].kind & SHINES) != 0u || contour.reach > 0.0);
            let disk = disk_of(incident.direction, max(incident.extent * overlap, head.y));
            if disk.mean_cos > 0.0 && any(incident.irradiance > vec3f(0.0)) {
                for (var lobe = 0u; lobe < lobes; lobe++) {
                    let place = material + 2u + 3u * lobe;
                    sum += incident.irradiance * reflected(place, disk, contour, outgoing, own_color, color);
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
