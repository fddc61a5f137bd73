//! Rooms: parts of a scene that do not see each other.
//!
//! What a link may be wrong by is measured by its receiver's share of an area. Were that the area of all surfaces, the rooms of a
//! city would each be solved the more coarsely the more of them there are: a link of one of N rooms could be √N times as wrong as
//! in that room alone. The error of a room of area Aᵢ, whose links are each as wrong as they may be, goes with 1/√Aᵢ, and Aᵢ/A of all,
//! A = Σ Aᵢ, is there. So that the whole has the error of a single room, the measure is A/(Σ √(Aᵢ/A))²: the area of one of several that
//! are alike, and hardly less than all where a hall has a thousand lanterns.
//!
//! Rays tell what sees each other, as they do for [sides that no light reaches](crate::sealed). A part counts as a room if it is
//! closed; all others count as one together, whatever sees what: out of doors each thing lies in the sun by itself. Rooms that are
//! joined by an open door are one, too; what that makes too coarse is found when the [error](crate::residual) is looked for. A
//! closed room that has less than about a hundredth of its view in common with another one may be taken for one by itself.

use crate::Aabb;
use crate::geometry::Domain;
use crate::hierarchy::Element;
use crate::sampling::{cosine_direction, hash, point4};
use crate::sealed::{MOST_LEAVING, ROUNDS, Side, Spots, is_back};
use crate::threads;

/// Lit groups are joined by so many rays of each spot at most.
const MOST_RAYS: usize = 16;
/// A group is closed if of so many rays no more than [`MOST_LEAVING`] meet nothing.
const RAYS: usize = 64;

/// No room, or several and something else.
pub(crate) const NO_ROOM: u32 = u32::MAX;
/// Several rooms, and nothing else.
pub(crate) const ROOMS: u32 = u32::MAX - 1;

/// What two nodes are in together.
pub(crate) fn together(a: u32, b: u32) -> u32 {
    match (a, b) {
        _ if a == b => a,
        (NO_ROOM, _) | (_, NO_ROOM) => NO_ROOM,
        _ => ROOMS,
    }
}

/// Whether no light passes between two nodes, neither of which is below the other: they are in different rooms.
pub(crate) fn are_apart(a: &Element, b: &Element) -> bool {
    a.room != NO_ROOM && b.room != NO_ROOM && (a.room != b.room || a.room == ROOMS)
}

/// What rooms a scene has.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Rooms {
    /// Σ √(Aᵢ/A) over rooms of areas Aᵢ, what is in none of them being one: √N for N that are alike.
    pub(crate) number: f32,
    /// The longest side of their boxes in unit space, on average by area.
    pub(crate) size: f32,
}

impl Rooms {
    /// Everything.
    pub(crate) const ONE: Self = Self { number: 1.0, size: 1.0 };

    /// Whether there can be rooms like that.
    pub(crate) fn is_sound(&self) -> bool {
        self.number >= 1.0 && self.number.is_finite() && self.size > 0.0 && self.size <= 1.0
    }
}

/// What a group of spots has.
#[derive(Clone)]
struct Part {
    spots: Vec<u32>,
    area: f64,
    bounds: Aabb,
}

/// The rooms of lit spots, and for each surface those that its front and its back are in. Rays of each spot before `first` were
/// shot before.
pub(crate) fn rooms(spots: &mut Spots<'_>, first: u32) -> (Rooms, Vec<[u32; 2]>) {
    let mut of_sides = vec![[NO_ROOM; 2]; spots.scene.surfaces().len()];
    let Some(roots) = join(spots, first) else { return (Rooms::ONE, of_sides) };
    // Parts in the order of their first spots, whoever is their root.
    let mut part_of_root = vec![NO_ROOM; spots.all.len()];
    let mut parts: Vec<Part> = Vec::new();
    for (spot, &root) in roots.iter().enumerate().filter(|(_, root)| **root != NO_ROOM) {
        let part = &mut part_of_root[root as usize];
        if *part == NO_ROOM {
            *part = parts.len() as u32;
            parts.push(Part { spots: Vec::new(), area: 0.0, bounds: Aabb::EMPTY });
        }
        let part = &mut parts[*part as usize];
        let side = spots.all[spot].side;
        let geometry = &spots.scene.surfaces()[(side / 2) as usize];
        part.spots.push(spot as u32);
        part.area += f64::from(geometry.area(Domain::WHOLE)) / spots.on_side(side).count() as f64;
        let of_spot =
            spots.place(spot as u32).map_or_else(|| geometry.bounds(Domain::WHOLE), |at| Aabb::of_points([at]));
        part.bounds = part.bounds.union(&of_spot);
    }
    let closed = threads::map(&parts, 1, |part| is_closed(spots, &part.spots));
    // Where there is one room the rest, what lies under the sky or is taken for lit by mistake, does not make another.
    if closed.iter().filter(|closed| **closed).count() < 2 {
        return (Rooms::ONE, of_sides);
    }
    let total: f64 = parts.iter().map(|part| part.area).sum();
    let (mut open, mut number, mut size) = (total, 0.0, 0.0);
    for (part, _) in parts.iter().zip(&closed).filter(|(_, closed)| **closed) {
        open -= part.area;
        number += (part.area / total).sqrt();
        size += part.area / total * f64::from(part.bounds.size().max_element());
    }
    let open = (open / total).max(0.0);
    (number, size) = (number + open.sqrt(), size + open);
    for (side, rooms) in of_sides.as_flattened_mut().iter_mut().enumerate() {
        let part = |spot: u32| match roots[spot as usize] {
            NO_ROOM => NO_ROOM,
            root => part_of_root[root as usize],
        };
        let mut of_spots = spots.on_side(side as Side).map(part);
        let Some(first) = of_spots.next() else { continue };
        let is_in_one = first != NO_ROOM && closed[first as usize] && of_spots.all(|other| other == first);
        *rooms = if is_in_one { first } else { NO_ROOM };
    }
    let rooms = Rooms { number: number as f32, size: size as f32 };
    (if rooms.is_sound() { rooms } else { Rooms::ONE }, of_sides)
}

/// Joins lit groups that see each other. The root of each lit spot, if there is more than one.
fn join(spots: &mut Spots<'_>, mut first: u32) -> Option<Vec<u32>> {
    for rays in ROUNDS {
        let roots = lit_roots(spots);
        let lit: Vec<u32> = (0..roots.len() as u32).filter(|&spot| roots[spot as usize] != NO_ROOM).collect();
        let mut groups: Vec<u32> = roots.into_iter().filter(|&root| root != NO_ROOM).collect();
        groups.sort_unstable();
        groups.dedup();
        if groups.len() < 2 {
            return None;
        }
        if groups.len() * rays as usize > MOST_RAYS * lit.len() {
            break;
        }
        spots.explore(&lit, first, rays);
        first += rays;
    }
    let roots = lit_roots(spots);
    let mut lit = roots.iter().filter(|&&root| root != NO_ROOM);
    let one = lit.next();
    lit.any(|root| Some(root) != one).then_some(roots)
}

/// By spot, the root of its group if that is lit.
fn lit_roots(spots: &mut Spots<'_>) -> Vec<u32> {
    spots.groups.flatten();
    let groups = &spots.groups;
    let root = |spot| if groups.is_known_lit(spot) { groups.known_root(spot) as u32 } else { NO_ROOM };
    (0..spots.all.len() as u32).map(root).collect()
}

/// Whether hardly any ray from some spots leaves the scene, and they see more than their own surface.
fn is_closed(spots: &Spots<'_>, members: &[u32]) -> bool {
    let scene = spots.scene;
    let side = |spot: u32| spots.all[spot as usize].side;
    if members.iter().all(|&member| side(member) == side(members[0])) {
        return false;
    }
    let leaves = |&ray: &usize| {
        let spot = members[ray * members.len() / RAYS];
        let side = side(spot);
        let u = point4(hash(spot, 0xc105), ray as u32);
        let geometry = &scene.surfaces()[(side / 2) as usize];
        let (x, normal) = geometry.sample(Domain::WHOLE, u.x, u.y);
        let x = spots.place(spot).unwrap_or(x);
        let direction = cosine_direction(if is_back(side) { -normal } else { normal }, u.z, u.w);
        scene.visibility.first_side(x, direction, f32::MAX, side / 2).is_none()
    };
    (0..RAYS).filter(leaves).count() as f32 <= MOST_LEAVING * RAYS as f32
}

#[cfg(test)]
mod tests;
