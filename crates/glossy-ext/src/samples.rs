//! Illumination Samples (paper, section 3.2): what every link leaves at its receiver, and what of it arrives at an
//! oriented point further down.

use crate::Rgb;
use crate::reflector::{Contour, Incident};
use crate::wide::FlatPart;
use glam::{Mat3, Vec2, Vec3};
use hr_diffuse::hooks::Sides;
use hr_diffuse::{Hierarchy, NodeId, Transfer};

/// Marks samples of receivers that are oriented: their irradiance includes the cosine.
const ORIENTED: u32 = 1 << 31;
/// Irradiance is renewed for the place where a sample arrives by at most this factor either way. Beyond it the
/// inverse square law no longer holds for the sender, and refinement leaves no such links where they matter.
const MOST_RENEWAL: f32 = 4.0;

/// One link's light: a Dirac impulse from its sender. The direction is that toward the sender from wherever the
/// sample is used (16 bytes).
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct IlluminationSample {
    /// Sender's node id, and whether the receiver is oriented.
    sender: u32,
    /// Transported irradiance in W/m² (linear RGB).
    irradiance: [f32; 3],
}

impl IlluminationSample {
    /// The sample that a transfer leaves.
    #[must_use]
    pub fn new(transfer: &Transfer) -> Self {
        let flag = if transfer.oriented { ORIENTED } else { 0 };
        Self { sender: (transfer.sender.0 & !ORIENTED) | flag, irradiance: transfer.irradiance.to_array() }
    }

    /// Where it comes from.
    #[must_use]
    pub fn sender(&self) -> NodeId {
        NodeId(self.sender & !ORIENTED)
    }

    /// Whether the receiver is oriented, so that the irradiance is on its plane and includes the cosine.
    #[must_use]
    pub fn is_oriented(&self) -> bool {
        self.sender & ORIENTED != 0
    }

    /// Irradiance at the receiver, W/m²: on its plane if it is oriented, else perpendicular to the direction.
    #[must_use]
    pub fn irradiance(&self) -> Rgb {
        Rgb::from(self.irradiance)
    }
}

/// A node's set of illumination samples.
pub type SampleSet = Vec<IlluminationSample>;

/// A point of a surface that light arrives at: its place, and the frame whose z is its normal.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Position, in the hierarchy's unit.
    pub at: Vec3,
    /// Columns: two tangents and the unit normal.
    pub frame: Mat3,
}

impl Place {
    /// A place with a unit normal; the tangents are any.
    #[must_use]
    pub fn new(at: Vec3, normal: Vec3) -> Self {
        let (x, y) = normal.any_orthonormal_pair();
        Self { at, frame: Mat3::from_cols(x, y, normal) }
    }

    /// A place with a unit normal whose first tangent follows a reflector's [grain](crate::Reflector::grain). Where there
    /// is none, or it is along the normal, the tangents are any.
    #[must_use]
    pub fn along(at: Vec3, normal: Vec3, grain: Option<Vec3>) -> Self {
        // A grain within about 0.06° of the normal has no direction that rounding leaves alone.
        let across = grain.map(|g| normal.cross(g)).filter(|y| y.length_squared() > 1e-6);
        let Some(y) = across.and_then(Vec3::try_normalize) else { return Self::new(at, normal) };
        Self { at, frame: Mat3::from_cols(y.cross(normal), y, normal) }
    }

    /// Unit normal.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.frame.z_axis
    }

    /// A world direction in the place's frame.
    #[must_use]
    pub fn local(&self, direction: Vec3) -> Vec3 {
        Vec3::new(self.frame.x_axis.dot(direction), self.frame.y_axis.dot(direction), self.frame.z_axis.dot(direction))
    }
}

/// The union of the sample sets on the path from the root down to `leaf`, as they arrive at a place of it: pushed
/// down without a copy in between. Direction, extent and irradiance are renewed for the place (the sender is known),
/// and the cosine is applied to what ancestors without orientation received. Directions are in the place's frame. Each sender
/// is seen in the direction of its middle, however much of the view it takes up.
pub fn arriving<H: Hierarchy>(
    hierarchy: &H,
    leaf: NodeId,
    path: &[&SampleSet],
    place: &Place,
    out: &mut Vec<Incident>,
) {
    arriving_as(hierarchy, (leaf, path), place, false, out, |_, _| ());
}

/// The same, [wide](crate::wide) senders in parts if these count; `origin` is told where what arrives is from.
pub(crate) fn arriving_as<H: Hierarchy>(
    hierarchy: &H,
    (leaf, path): (NodeId, &[&SampleSet]),
    place: &Place,
    in_parts: bool,
    out: &mut Vec<Incident>,
    mut origin: impl FnMut(Origin, &mut [Incident]),
) {
    out.clear();
    let mut receiver = leaf;
    for samples in path.iter().rev() {
        if !samples.is_empty() {
            let from = Place::new(hierarchy.center(receiver), hierarchy.normals(receiver).axis);
            for sample in *samples {
                let first = out.len();
                arrive(hierarchy, (sample, &from), place, in_parts, out);
                origin(Origin { receiver, sample: *sample, end: out.len() }, &mut out[first..]);
            }
        }
        match hierarchy.parent(receiver) {
            Some(parent) => receiver = parent,
            None => break,
        }
    }
}

/// Where samples that arrive are from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Origin {
    /// Node that received it.
    receiver: NodeId,
    sample: IlluminationSample,
    /// The first one that is of another origin: a wide sender arrives in parts.
    end: usize,
}

/// A sender of which it is not proved how much a leaf sees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubtful {
    sender: NodeId,
    /// Its samples, from one on up to another.
    first: usize,
    end: usize,
    /// How bright their lobes would be if all of it were seen.
    unoccluded: f32,
    /// Rays that what is known rests on.
    rays: f32,
}

/// Samples are looked for whose lobes would be as bright as this share of a leaf's light, times the error asked for, were all of their
/// senders seen, …
const LOOKED_FOR: f32 = 0.4;
/// … by so many rays for one that is as bright as all other light, …
const LOOKS: f32 = 16.0;
/// … but at least and at most so many.
const LEAST_LOOKS: u32 = 3;
const MOST_LOOKS: u32 = 16;
/// Links of which each leaf finds out how much they let through carry this share at least.
const LEAST_SEEN: f32 = 0.01;
/// What leaves found out themselves rests on so many rays.
const KNOWN: f32 = 4.0;
/// What is not seen at all is kept as this share, in proportion.
const NEXT_TO_NOTHING: f32 = 1e-6;

/// Sum of the irradiances of samples.
fn sum(samples: &[Incident]) -> Rgb {
    samples.iter().map(|sample| sample.irradiance).sum()
}

/// Scales samples so that together they are an irradiance.
fn scale(samples: &mut [Incident], now: Rgb) {
    let before = sum(samples);
    // Light may be so strong or weak that its square is no number.
    let factor = Rgb::select(before.cmpgt(Rgb::ZERO), now / before, Rgb::ZERO);
    samples.iter_mut().for_each(|sample| sample.irradiance *= factor);
}

/// Makes samples of one origin what the leaf has found out that they bring; and tells how bright they may be, if nothing proves how much
/// of their sender the leaf sees.
pub(crate) fn brought<H: Hierarchy>(
    hierarchy: &H,
    leaf: NodeId,
    (origin, samples): (&Origin, &mut [Incident]),
    peak: impl Fn(&Incident) -> f32,
) -> Option<Doubtful> {
    let Origin { receiver, sample, end } = *origin;
    let sender = sample.sender();
    let doubtful = hierarchy.seen(receiver, sender).map(|seen| {
        let unoccluded = samples.iter().map(&peak).fold(0.0, f32::max) / seen.max(LEAST_SEEN);
        Doubtful {
            sender,
            first: end - samples.len(),
            end,
            unoccluded,
            rays: if receiver == leaf { KNOWN } else { 0.0 },
        }
    });
    match hierarchy.brought(leaf, receiver, sender) {
        Some(brought) => {
            scale(samples, sample.irradiance() * brought.max(NEXT_TO_NOTHING));
            doubtful.map(|doubtful| Doubtful { rays: KNOWN, ..doubtful })
        }
        None => doubtful,
    }
}

/// Looks from a leaf for the senders whose lobes are bright there, where it is not proved how much the leaf sees of them. `peak` is how
/// bright a sample's lobe is beside the leaf's mean light, `error` the relative error asked for.
pub(crate) fn look_again<H: Hierarchy>(
    hierarchy: &H,
    leaf: NodeId,
    doubtful: &[Doubtful],
    error: f32,
    incident: &mut [Incident],
) {
    for &Doubtful { sender, first, end, unoccluded, rays } in doubtful {
        if unoccluded < LOOKED_FOR * error {
            continue;
        }
        let looks = ((unoccluded * LOOKS) as u32).clamp(LEAST_LOOKS, MOST_LOOKS);
        let Some(found) = hierarchy.look(leaf, sender, looks) else { continue };
        let known = rays / (rays + looks as f32);
        let now = sum(&incident[first..end]) * known + found * (1.0 - known);
        scale(&mut incident[first..end], now);
    }
}

/// Adds the samples of senders that no link brings any light of, though nothing proves them hidden, as if they were all but hidden, to be
/// [looked for](look_again).
pub(crate) fn hidden<H: Hierarchy>(
    hierarchy: &H,
    (leaf, place): (NodeId, &Place),
    (peak, error): (impl Fn(&Incident) -> f32, f32),
    incident: &mut Vec<Incident>,
    doubtful: &mut Vec<Doubtful>,
) {
    for receiver in std::iter::successors(Some(leaf), |&node| hierarchy.parent(node)) {
        let from = Place::new(hierarchy.center(receiver), hierarchy.normals(receiver).axis);
        for transfer in hierarchy.hidden(receiver) {
            let first = incident.len();
            arrive(hierarchy, (&IlluminationSample::new(&transfer), &from), place, true, incident);
            let unoccluded = incident[first..].iter().map(&peak).fold(0.0, f32::max);
            if unoccluded < LOOKED_FOR * error {
                incident.truncate(first);
                continue;
            }
            incident[first..].iter_mut().for_each(|sample| sample.irradiance *= NEXT_TO_NOTHING);
            let rays = if receiver == leaf { KNOWN } else { 0.0 };
            doubtful.push(Doubtful { sender: transfer.sender, first, end: incident.len(), unoccluded, rays });
        }
    }
}

/// Lobes grow brighter toward the horizon, but no further than this cosine.
pub(crate) const LEAST_COSINE: f32 = 0.1;
/// Cells along each side of the square that the hemisphere of directions is mapped to, for weak samples: 25° wide.
const WEAK_CELLS: f32 = 6.0;
/// So many times as many cells along a side there are for weak samples that the next wider cells are for.
const WEAK_STEP: f32 = 0.25;
/// Cells for close samples are at most this part of the lobe's width. What is merged then lies within a ninth of the width
/// from its mean (standard deviation, per axis), and widens the lobe by less than a hundredth.
const CLOSE: f32 = 0.25;

/// Strength of a sample, for its place among the others.
fn strength(sample: &Incident) -> f32 {
    sample.irradiance.element_sum()
}

/// Merges samples that are so close together that a lobe of this width (radians) cannot tell them apart: of many small parts
/// of one sender there are as few left as the lobe can show. Where the width is 0, all samples stay as they are.
pub fn merge_close(incident: &mut Vec<Incident>, width: f32) {
    // A cell of the square is 4/cells wide at the zenith, half of that at the horizon.
    let cells = 4.0 / (CLOSE * width);
    if incident.len() > 1 && cells < f32::from(u16::MAX) {
        merge(incident, 0, cells.max(1.0));
    }
}

/// Merges the weakest samples at a place, which make up such a share of the irradiance, so that no more than 36 of them are left. The
/// strong ones stay as they are, and so do weak ones whose lobes, of this width (radians), are `bright`: small lamps, far away; and the
/// sums of weak ones within a lobe's width, or within a few, that are: of a lamp's shade each part may be dim.
pub fn merge_weak(incident: &mut Vec<Incident>, width: f32, share: f32, bright: impl Fn(&Incident) -> bool) {
    if incident.len() <= (WEAK_CELLS * WEAK_CELLS) as usize {
        return;
    }
    incident.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    let total: f32 = incident.iter().map(strength).sum();
    let mut rest = 0.0;
    let mut strong = incident.len();
    while strong > 0 && rest + strength(&incident[strong - 1]) <= share * total {
        strong -= 1;
        rest += strength(&incident[strong]);
    }
    let mut cells = (4.0 / width).min(f32::from(u16::MAX));
    loop {
        let dim = incident.split_off(strong);
        let (mut stay, dim): (Vec<_>, Vec<_>) = dim.into_iter().partition(&bright);
        incident.append(&mut stay);
        strong = incident.len();
        incident.extend(dim);
        if cells <= WEAK_CELLS {
            break;
        }
        merge(incident, strong, cells);
        cells *= WEAK_STEP;
    }
    merge(incident, strong, WEAK_CELLS);
}

/// Merges the samples from one on into one for each cell of a grid of directions, with so many cells along each side:
/// irradiance adds up, the direction is the weighted mean, and the extent grows by how far they spread.
fn merge(incident: &mut Vec<Incident>, from: usize, cells: f32) {
    let cell = |sample: &Incident| {
        let square = sample.direction.truncate() / (1.0 + sample.direction.z.max(0.0)) * 0.5 + 0.5;
        let cell = (square * cells).clamp(Vec2::ZERO, Vec2::splat(cells)).floor();
        (cell.y as u32, cell.x as u32)
    };
    incident[from..].sort_by_cached_key(cell);
    let mut kept = from;
    let mut next = from;
    while next < incident.len() {
        let here = cell(&incident[next]);
        let count = incident[next..].iter().take_while(|sample| cell(sample) == here).count();
        incident[kept] = together(&incident[next..next + count]);
        kept += 1;
        next += count;
    }
    incident.truncate(kept);
}

/// One sample in place of several.
fn together(samples: &[Incident]) -> Incident {
    let weight: f32 = samples.iter().map(strength).sum();
    if samples.len() == 1 || weight <= 0.0 {
        return samples[0];
    }
    let weighted = |of: fn(&Incident) -> Vec3| samples.iter().map(|s| of(s) * strength(s)).sum::<Vec3>() / weight;
    let mean = weighted(|s| s.direction);
    let extent2 = weighted(|s| Vec3::splat(s.extent * s.extent)).x;
    // Unit vectors about their mean: 1 − |mean|² is their variance; a disk's is half its squared radius.
    let spread = 2.0 * (1.0 - mean.length_squared()).max(0.0);
    Incident {
        direction: mean.normalize_or(Vec3::Z),
        extent: (extent2 + spread).sqrt().min(std::f32::consts::FRAC_PI_2),
        irradiance: samples.iter().map(|s| s.irradiance).sum(),
        contour: Contour::NONE,
        nearness: weighted(|s| Vec3::splat(s.nearness)).x,
    }
}

/// The outline of a sender as it is seen from a place, in its frame.
fn contour(FlatPart { center, sides: Sides { across, along, taper } }: &FlatPart, place: &Place) -> Contour {
    let to = *center - place.at;
    let near = to.length().recip();
    let [middle, across, along] = [to, *across, *along].map(|v| place.local(v) * near);
    Contour::new(middle, across, along, *taper)
}

/// Adds a sample received at `from` as it arrives at `place`, of wide senders in parts if these count; nothing below the horizon.
fn arrive<H: Hierarchy>(
    hierarchy: &H,
    (sample, from): (&IlluminationSample, &Place),
    place: &Place,
    in_parts: bool,
    out: &mut Vec<Incident>,
) {
    let (sender, oriented) = (sample.sender(), sample.is_oriented());
    let (center, radius) = (hierarchy.center(sender), hierarchy.radius(sender));
    let outline = hierarchy.sides(sender).map(|sides| FlatPart { center, sides });
    if let Some(whole) = outline
        && in_parts
        && whole.is_wide(place.at)
    {
        return arrive_in_parts((&whole, hierarchy.normals(sender).axis), (sample, from), place, out);
    }
    let (direction, extent) = hierarchy.direction_to(sender, place.at);
    let cosine = direction.dot(place.normal());
    // A sender with extent may be partly above the horizon though its middle is not; its light is then weak.
    if cosine <= 0.0 && (extent <= 0.0 || !oriented) {
        return;
    }
    let is_distant = hierarchy.is_distant(sender);
    let distance2 = |at: Vec3| center.distance_squared(at) + radius * radius;
    let renewal = if is_distant || from.at == place.at { 1.0 } else { distance2(from.at) / distance2(place.at) };
    let scale = if oriented {
        // The cosine is in the irradiance already; grazing senders keep what the link's form factor found.
        let before = if is_distant { direction } else { (center - from.at).normalize_or_zero() }.dot(from.normal());
        let turned = if before > 0.1 && cosine > 0.0 { cosine / before } else { 1.0 };
        (renewal * turned).clamp(MOST_RENEWAL.recip(), MOST_RENEWAL)
    } else {
        renewal.clamp(MOST_RENEWAL.recip(), MOST_RENEWAL) * cosine
    };
    out.push(Incident {
        direction: place.local(direction),
        extent,
        irradiance: sample.irradiance() * scale,
        contour: outline.filter(|_| extent > 0.0).map_or(Contour::NONE, |outline| contour(&outline, place)),
        // Within the ball that holds it nobody knows where its light comes from.
        nearness: if is_distant { 0.0 } else { center.distance(place.at).max(radius).max(f32::MIN_POSITIVE).recip() },
    });
}

/// The same for a [wide](crate::wide) sender with a unit normal. Its form factor is renewed as a whole.
fn arrive_in_parts(
    (whole, normal): (&FlatPart, Vec3),
    (sample, from): (&IlluminationSample, &Place),
    place: &Place,
    out: &mut Vec<Incident>,
) {
    // The receiver's cosine is in the irradiance, or is not.
    let counted = |cosine: f32| if sample.is_oriented() { cosine.max(0.0) } else { 1.0 };
    let (first, mut now, mut before) = (out.len(), 0.0, 0.0);
    whole.divided(place.at, |part| {
        let (factor, direction) = part.factor(normal, place.at);
        let cosine = direction.dot(place.normal());
        now += factor * counted(cosine);
        if factor > 0.0 && cosine > 0.0 {
            out.push(Incident {
                direction: place.local(direction),
                extent: factor.min(1.0).sqrt().asin(),
                irradiance: Rgb::splat(factor * cosine),
                contour: contour(&part, place),
                nearness: part.center.distance(place.at).max(f32::MIN_POSITIVE).recip(),
            });
        }
    });
    if from.at == place.at {
        before = now;
    } else {
        whole.divided(from.at, |part| {
            let (factor, direction) = part.factor(normal, from.at);
            before += factor * counted(direction.dot(from.normal()));
        });
    }
    let renewal = if before > 0.0 { (now / before).clamp(MOST_RENEWAL.recip(), MOST_RENEWAL) } else { 1.0 };
    for part in &mut out[first..] {
        part.irradiance = part.irradiance / now * renewal * sample.irradiance();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reflector::{MetallicRoughness, Phong, Reflector, Ward};

    #[test]
    fn samples_are_small() {
        assert_eq!(size_of::<IlluminationSample>(), 16, "bytes of a sample at rest");
    }

    /// A square light of 20° in n × n parts.
    fn light(n: usize) -> Vec<Incident> {
        let part = |i: usize| {
            let [x, y] = [i % n, i / n].map(|k| 0.36 * ((k as f32 + 0.5) / n as f32 - 0.5));
            let direction = Vec3::new(0.5 + x, y, 0.8).normalize();
            let irradiance = Rgb::new(1.0, 0.5, 0.2) / (n * n) as f32;
            Incident { direction, irradiance, ..Incident::default() }
        };
        (0..n * n).map(part).collect()
    }

    /// However finely a light is divided, there is only so much that a lobe can show of it.
    #[test]
    fn close_samples_count_once() {
        let reflectors: [Box<dyn Reflector>; 3] = [
            Box::new(Ward::new(Rgb::ZERO, Rgb::splat(0.8), 0.1).expect("a Ward reflector")),
            Box::new(Phong::new(Rgb::ZERO, Rgb::splat(0.8), 40.0).expect("a Phong reflector")),
            Box::new(MetallicRoughness::new(Rgb::ONE, 1.0, 0.35).expect("a metal")),
        ];
        for reflector in reflectors {
            let width = reflector.lobe(Vec3::new(0.6, 0.0, 0.8)).width;
            let mut counts = Vec::new();
            for n in [8, 16, 32, 64] {
                let all = light(n);
                let mut few = all.clone();
                merge_close(&mut few, width);
                counts.push(few.len());
                let sum = |of: &[Incident]| of.iter().map(|i| i.irradiance).sum::<Rgb>();
                assert!((sum(&all) - sum(&few)).abs().max_element() < 1e-4, "irradiance adds up");
                let (mut off, mut total) = (0.0, 0.0);
                for k in 0..400 {
                    let turn = Vec2::from_angle(k as f32 * 2.399_963_2) * ((k as f32 + 0.5) / 400.0).sqrt() * 0.6;
                    let outgoing = Vec3::new(turn.x - 0.5, turn.y, 0.8).normalize();
                    let right = reflector.reflect_sum(&all, outgoing);
                    off += (reflector.reflect_sum(&few, outgoing) - right).abs().element_sum();
                    total += right.element_sum();
                }
                assert!(
                    off < 0.005 * total,
                    "{reflector:?}: {} of {} samples, off by {}",
                    few.len(),
                    n * n,
                    off / total
                );
            }
            assert!(counts[3] < 2 * counts[1] && counts[3] < 700, "64 times the samples: {counts:?}");
        }
    }

    /// A lamp far down a room brings little, and is seen all the same beside one overhead.
    #[test]
    fn weak_lamps_stay_where_walls_are_merged() {
        let sample = |direction: Vec3, extent, irradiance: f32| Incident {
            direction: direction.normalize(),
            extent,
            irradiance: Rgb::splat(irradiance),
            ..Incident::default()
        };
        let overhead = sample(Vec3::new(0.2, 0.0, 1.0), 0.18, 18.0);
        let far = sample(Vec3::new(0.95, 0.0, 0.29), 0.055, 0.6);
        let wall = |k: u8| sample(Vec2::from_angle(0.3 * f32::from(k)).extend(0.1 + 0.01 * f32::from(k)), 0.3, 0.1);
        let mut incident: Vec<Incident> = [overhead, far].into_iter().chain((0..60).map(wall)).collect();
        let irradiance = |of: &[Incident]| of.iter().map(strength).sum::<f32>();
        let before = irradiance(&incident);
        merge_weak(&mut incident, 0.1, 0.3, |sample| strength(sample) > 20.0 * sample.extent * sample.extent);
        assert!(incident.contains(&overhead) && incident.contains(&far), "both lamps stay: {incident:?}");
        assert!(incident.len() <= 2 + 36, "walls are merged: {} samples", incident.len());
        assert!((irradiance(&incident) / before - 1.0).abs() < 1e-5, "irradiance adds up");
    }

    /// The inside of a lamp's shade is as bright as a bulb, though none of its many parts is; the parts of a wall stay dim together.
    #[test]
    fn dim_parts_of_something_bright_stay_together() {
        let sample = |direction: Vec3, irradiance: f32| Incident {
            direction: direction.normalize(),
            irradiance: Rgb::splat(irradiance),
            ..Incident::default()
        };
        let width = 0.08;
        let bright = |sample: &Incident| strength(sample) > 60.0 * (sample.extent * sample.extent + width * width);
        let overhead = sample(Vec3::new(0.2, 0.0, 1.0), 100.0);
        // Half of the lobe's width across.
        let shade = |k: u8| sample(Vec3::new(0.7 + 0.01 * f32::from(k % 5), 0.4 + 0.01 * f32::from(k / 5), 0.5), 0.05);
        let wall = |k: u8| sample(Vec2::from_angle(0.1 * f32::from(k)).extend(0.1 + 0.02 * f32::from(k % 7)), 0.05);
        let parts: Vec<Incident> = (0..25).map(shade).collect();
        assert!(!parts.iter().any(bright), "none of them is bright by itself");
        // What is around it would blur it.
        let around = |k: u8| {
            let aside = Vec2::from_angle(0.3 * f32::from(k)) * 0.2;
            sample(shade(12).direction + Vec3::new(aside.x, aside.y, 0.0), 0.05)
        };
        let walls = (0..60).map(wall).chain((0..20).map(around));
        let mut incident: Vec<Incident> = std::iter::once(overhead).chain(parts).chain(walls).collect();
        merge_weak(&mut incident, width, 0.3, bright);
        let is_shade = |i: &&Incident| i.direction.distance(shade(12).direction) < 0.05 && i.extent < width;
        let found: f32 = incident.iter().filter(is_shade).map(strength).sum();
        // A few parts may lie alone in a cell that the others do not reach into. Were all merged at once, none would be found there.
        assert!(found > 0.9 * 25.0 * 0.15, "the shade, and where it is: {found}");
        assert!(incident.len() <= 1 + 4 + 36, "walls are merged: {} samples", incident.len());
    }

    /// A floor from above it, and from the side: disks in the place of its parts would leave gaps between them.
    #[test]
    fn parts_of_wide_senders_have_outlines() {
        for taper in [0.0, 1.0] {
            let sides = Sides { across: Vec3::new(2.0, 0.5, 0.0), along: Vec3::new(-0.3, 1.0, 0.0), taper };
            let floor = FlatPart { center: Vec3::new(0.4, 0.2, 0.0), sides };
            for at in [Vec3::new(0.5, 0.1, 0.15), Vec3::new(0.2, -0.1, 0.4), Vec3::new(-1.5, 0.0, 0.6)] {
                let (place, mut parts) = (Place::new(at, Vec3::NEG_Z), 0);
                floor.divided(at, |part| {
                    parts += 1;
                    assert!(contour(&part, &place).reach() > 0.0, "{part:?} from {at}");
                });
                assert!(parts > 4, "{parts} parts from {at}");
            }
        }
    }

    /// A lamp above a leaf, which a fourth of something larger sees, and what is really seen of it.
    struct Seen {
        /// Irradiance that a look finds.
        look: Rgb,
        /// What the leaf has found out itself over what the link brings.
        brought: Option<f32>,
        /// Whether no link brings anything.
        hidden: bool,
    }

    const LEAF: NodeId = NodeId(7);
    const ABOVE: NodeId = NodeId(3);
    const LAMP: NodeId = NodeId(1);
    const PROVED: NodeId = NodeId(9);
    const UNOCCLUDED: f32 = 4.0;

    impl Hierarchy for Seen {
        fn parent(&self, node: NodeId) -> Option<NodeId> {
            (node == LEAF).then_some(ABOVE)
        }
        fn center(&self, node: NodeId) -> Vec3 {
            if node == LAMP || node == PROVED { Vec3::Z } else { Vec3::ZERO }
        }
        fn radius(&self, _: NodeId) -> f32 {
            0.01
        }
        fn normals(&self, _: NodeId) -> hr_diffuse::Cone {
            hr_diffuse::Cone { axis: Vec3::Z, cos_angle: 1.0 }
        }
        fn material(&self, _: NodeId) -> Option<u32> {
            Some(0)
        }
        fn seen(&self, _: NodeId, sender: NodeId) -> Option<f32> {
            (sender != PROVED).then_some(if self.hidden { 0.0 } else { 0.25 })
        }
        fn brought(&self, _: NodeId, _: NodeId, _: NodeId) -> Option<f32> {
            self.brought
        }
        fn hidden(&self, receiver: NodeId) -> Vec<Transfer> {
            let transfer =
                Transfer { sender: LAMP, direction: Vec3::Z, irradiance: Rgb::splat(UNOCCLUDED), oriented: true };
            if self.hidden && receiver == ABOVE { vec![transfer] } else { Vec::new() }
        }
        fn look(&self, leaf: NodeId, _: NodeId, rays: u32) -> Option<Rgb> {
            assert!((LEAST_LOOKS..=MOST_LOOKS).contains(&rays), "{rays} rays");
            assert_eq!(leaf, LEAF, "nobody else looks");
            Some(self.look)
        }
    }

    /// The irradiance that a leaf has of a lamp by a sample that a receiver got, as far as it matters for this error.
    fn found(host: &Seen, (receiver, sender): (NodeId, NodeId), error: f32) -> f32 {
        let irradiance = Rgb::splat(0.25 * UNOCCLUDED);
        let transfer = Transfer { sender, direction: Vec3::Z, irradiance, oriented: true };
        let own = [IlluminationSample::new(&transfer)].to_vec();
        let nothing = SampleSet::new();
        let path = match (host.hidden, receiver == LEAF) {
            (true, _) => [&nothing, &nothing],
            (false, true) => [&nothing, &own],
            (false, false) => [&own, &nothing],
        };
        let place = Place::new(Vec3::ZERO, Vec3::Z);
        let peak = |sample: &Incident| sample.irradiance.x;
        let (mut incident, mut doubtful) = (Vec::new(), Vec::new());
        arriving_as(host, (LEAF, &path), &place, true, &mut incident, |origin, samples| {
            doubtful.extend(brought(host, LEAF, (&origin, samples), peak));
        });
        hidden(host, (LEAF, &place), (peak, error), &mut incident, &mut doubtful);
        look_again(host, LEAF, &doubtful, error, &mut incident);
        sum(&incident).x
    }

    #[test]
    fn bright_senders_are_looked_for() {
        let host = |look: f32| Seen { look: Rgb::splat(look), brought: None, hidden: false };
        for look in [0.0, 1.5, UNOCCLUDED] {
            assert_eq!(found(&host(look), (ABOVE, LAMP), 1.0), look, "what something larger sees tells nothing");
            assert_eq!(found(&host(look), (ABOVE, PROVED), 1.0), 1.0, "it is proved to be seen");
            assert_eq!(found(&host(look), (ABOVE, LAMP), 11.0), 1.0, "too dim, were all of it seen");
            // 16 rays, and 4 that are known of.
            let own = found(&host(look), (LEAF, LAMP), 1.0);
            assert!((own - (0.2 + 0.8 * look)).abs() < 1e-5, "together with what the leaf's own link found: {own}");
        }
    }

    #[test]
    fn samples_are_scaled_however_strong() {
        for strength in [1e-30_f32, 1.0, 1e30] {
            let mut samples = [1.0, 3.0, 0.0].map(|share| Incident {
                irradiance: Rgb::new(share * strength, 2.0 * share * strength, 0.0),
                ..Incident::default()
            });
            scale(&mut samples, Rgb::splat(8.0 * strength));
            let found = samples.map(|sample| sample.irradiance / strength);
            let right = [[2.0, 2.0, 0.0], [6.0, 6.0, 0.0], [0.0; 3]].map(Rgb::from);
            assert!(found.iter().zip(right).all(|(a, b)| (*a - b).abs().max_element() < 1e-5), "{found:?}");
        }
    }

    #[test]
    fn what_leaves_found_out_counts() {
        for brought in [0.0, 0.5, 4.0] {
            let host = |look: f32| Seen { look: Rgb::splat(look), brought: Some(brought), hidden: false };
            let dim = found(&host(UNOCCLUDED), (ABOVE, LAMP), 11.0);
            assert!((dim - brought).abs() < 1e-5, "{dim} of what would bring 1 everywhere, {brought} here");
            let bright = found(&host(UNOCCLUDED), (ABOVE, LAMP), 1.0);
            assert!(
                (bright - (0.2 * brought + 0.8 * UNOCCLUDED)).abs() < 1e-5,
                "and what a closer look finds: {bright}"
            );
        }
    }

    #[test]
    fn senders_that_no_link_sees_are_looked_for() {
        let host = |look: f32| Seen { look: Rgb::splat(look), brought: None, hidden: true };
        assert!((found(&host(UNOCCLUDED), (ABOVE, LAMP), 1.0) / UNOCCLUDED - 1.0).abs() < 1e-5, "all of it is seen");
        assert_eq!(found(&host(0.0), (ABOVE, LAMP), 1.0), 0.0, "it is hidden");
        assert_eq!(found(&host(UNOCCLUDED), (ABOVE, LAMP), 11.0), 0.0, "too dim, were all of it seen");
    }

    #[test]
    fn mirrors_tell_all_samples_apart() {
        let mut all = light(16);
        merge_close(&mut all, 0.0);
        assert_eq!(all, light(16), "nothing is merged");
        for width in [0.0, f32::NAN, -1.0] {
            merge_weak(&mut all, width, 1.0, |_| true);
            assert_eq!(all.len(), 256, "all of them are bright");
        }
    }

    #[test]
    fn frames_follow_the_grain() {
        let lathe = Some(2.0 * Vec3::Z);
        for k in 0..50 {
            let turn = 0.37 * k as f32;
            let normal = Vec3::new(turn.cos(), turn.sin(), (0.2 * k as f32).sin()).normalize();
            let frame = Place::along(Vec3::ZERO, normal, lathe).frame;
            let off = (frame.transpose() * frame - Mat3::IDENTITY).to_cols_array().map(f32::abs);
            assert!(off.iter().all(|&e| e < 1e-5) && frame.determinant() > 0.0, "right-handed frame: {frame}");
            assert_eq!(frame.z_axis, normal, "the normal");
            let projected = (Vec3::Z - normal * normal.z).normalize();
            assert!(frame.x_axis.distance(projected) < 1e-4, "{} is not {projected}", frame.x_axis);
        }
        for grain in [None, lathe] {
            let any = Place::along(Vec3::ZERO, Vec3::Z, grain);
            assert_eq!(
                any.frame,
                Place::new(Vec3::ZERO, Vec3::Z).frame,
                "any tangents where there is no grain to follow"
            );
        }
    }
}
