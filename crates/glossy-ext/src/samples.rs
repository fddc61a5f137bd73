//! Illumination Samples (paper, section 3.2): what every link leaves at its receiver, and what of it arrives at an
//! oriented point further down.

use crate::Rgb;
use crate::reflector::Incident;
use glam::{Mat3, Vec3};
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
/// and the cosine is applied to what ancestors without orientation received. Directions are in the place's frame.
pub fn arriving<H: Hierarchy>(
    hierarchy: &H,
    leaf: NodeId,
    path: &[&SampleSet],
    place: &Place,
    out: &mut Vec<Incident>,
) {
    out.clear();
    let mut receiver = leaf;
    for samples in path.iter().rev() {
        if !samples.is_empty() {
            let from = Place::new(hierarchy.center(receiver), hierarchy.normals(receiver).axis);
            for sample in *samples {
                out.extend(arrived(hierarchy, sample, &from, place));
            }
        }
        match hierarchy.parent(receiver) {
            Some(parent) => receiver = parent,
            None => break,
        }
    }
}

/// Samples that are merged make up at most this share of the irradiance at a place.
const WEAK_SHARE: f32 = 0.3;
/// Cells along each side of the square that the hemisphere of directions is mapped to.
const CELLS: usize = 6;

/// Merges the weakest samples at a place into one for each cell of a grid of directions (about 25° wide): irradiance
/// adds up, the direction is the weighted mean, and the extent grows by how far they spread. The strong ones, which
/// make the peaks of what is reflected, stay as they are.
pub fn merge_weak(incident: &mut Vec<Incident>) {
    if incident.len() <= CELLS * CELLS {
        return;
    }
    let strength = |i: &Incident| i.irradiance.element_sum();
    incident.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    let total: f32 = incident.iter().map(strength).sum();
    let mut rest = 0.0;
    let mut strong = incident.len();
    while strong > 0 && rest + strength(&incident[strong - 1]) <= WEAK_SHARE * total {
        strong -= 1;
        rest += strength(&incident[strong]);
    }
    // Direction, squared extent plus squared length, weight and irradiance per cell.
    let mut cells = [(Vec3::ZERO, 0.0_f32, 0.0_f32, Rgb::ZERO); CELLS * CELLS];
    for sample in incident.drain(strong..) {
        let weight = strength(&sample);
        let square = sample.direction.truncate() / (1.0 + sample.direction.z.max(0.0)) * 0.5 + 0.5;
        let cell = (square * CELLS as f32).clamp(glam::Vec2::ZERO, glam::Vec2::splat(CELLS as f32 - 1.0));
        let cell = &mut cells[cell.y as usize * CELLS + cell.x as usize];
        cell.0 += sample.direction * weight;
        cell.1 += sample.extent * sample.extent * weight;
        cell.2 += weight;
        cell.3 += sample.irradiance;
    }
    for (direction, extent, weight, irradiance) in cells {
        if weight > 0.0 {
            let mean = direction / weight;
            // Unit vectors about their mean: 1 − |mean|² is their variance; a disk's is half its squared radius.
            let spread = 2.0 * (1.0 - mean.length_squared()).max(0.0);
            let extent = (extent / weight + spread).sqrt().min(std::f32::consts::FRAC_PI_2);
            incident.push(Incident { direction: mean.normalize_or(Vec3::Z), extent, irradiance });
        }
    }
}

/// A sample received at `from` as it arrives at `place`; none below the horizon.
fn arrived<H: Hierarchy>(hierarchy: &H, sample: &IlluminationSample, from: &Place, place: &Place) -> Option<Incident> {
    let sender = sample.sender();
    let (direction, extent) = hierarchy.direction_to(sender, place.at);
    let cosine = direction.dot(place.normal());
    // A sender with extent may be partly above the horizon though its middle is not; its light is then weak.
    let local = place.local(direction);
    let oriented = sample.sender & ORIENTED != 0;
    let nearness = |at: Vec3| {
        if hierarchy.is_distant(sender) {
            1.0
        } else {
            let spread = hierarchy.radius(sender);
            (hierarchy.center(sender).distance_squared(at) + spread * spread).recip()
        }
    };
    let renewal = if from.at == place.at { 1.0 } else { nearness(place.at) / nearness(from.at) };
    let scale = if oriented {
        // The cosine is in the irradiance already; grazing senders keep what the link's form factor found.
        let before = hierarchy.direction_to(sender, from.at).0.dot(from.normal());
        let turned = if before > 0.1 && cosine > 0.0 { cosine / before } else { 1.0 };
        (renewal * turned).clamp(MOST_RENEWAL.recip(), MOST_RENEWAL)
    } else {
        renewal.clamp(MOST_RENEWAL.recip(), MOST_RENEWAL) * cosine
    };
    (scale > 0.0 && (cosine > 0.0 || extent > 0.0)).then(|| Incident {
        direction: local,
        extent,
        irradiance: sample.irradiance() * scale,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
