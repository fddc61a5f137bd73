//! What the rays of a pixel have in common, and what the first of them tell about how many the others need.

use super::ends::Often;
use glam::Vec3;
use glossy_ext::Incident;
use hr_diffuse::{Hit, Rgb};

/// Rays of a pixel that come first: the corners of its grid. What they tell says what the others need.
pub(super) const CORNERS: u32 = 4;
/// Rays that follow a lobe, for each of these, …
pub(super) const FIRST_LOBE_RAYS: usize = 4;
/// … and for each of the others, at most: as many as make the standard error of the pixel …
pub(super) const LOBE_RAYS: usize = 8;
/// … this share of its light, …
const GRAIN: f32 = 0.005;
/// … and at least so many: the corners may have missed what is bright and small.
const FEWEST_LOBE_RAYS: f32 = 2.0;
/// Emitters' own light on a surface is even where the corners differ by no more than this share of it.
const EVEN_LIGHT: f32 = 0.02;
/// Diffuse light takes as long as so many of them.
const DIFFUSE_RAYS: f32 = 3.0;

/// What the rays of a pixel have in common.
pub(super) struct Shared {
    /// Rays that follow a lobe, for each of them.
    pub(super) lobe_rays: usize,
    /// Those that a ray is in.
    pub(super) lobes: Lobes,
    /// What they found out so far.
    pub(super) found: Findings,
    /// Saves allocations.
    pub(super) incident: Vec<Incident>,
    /// The ray through its middle, from the eye in unit space.
    pub(super) ray: (Vec3, Vec3),
    /// What is seen there, once it is asked for.
    pub(super) middle: Option<Option<Shaded>>,
    /// How wide pixels are at distance 1; infinite where there are none.
    pub(super) pixel: f32,
    /// Of all pixels: leaves that end many rays.
    pub(super) often: Often,
}

/// The lobes that a ray from the eye is in, one after the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobes {
    /// How wide they are together (radians).
    pub(super) width: f32,
    /// How much of the light comes back through all of them.
    pub(super) albedo: f32,
}

impl Lobes {
    /// From the eye, and in mirrors.
    pub(super) const NONE: Self = Self { width: 0.0, albedo: 1.0 };

    /// These and one more.
    pub(super) fn and(self, width: f32, albedo: f32) -> Self {
        Self { width: self.width.hypot(width), albedo: self.albedo * albedo }
    }
}

/// What the rays of a pixel found out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Findings {
    /// How noisy diffuse light is, and what is found along rays that follow a lobe.
    pub(super) noise: [Spread; 2],
    /// Light of emitters whose outlines are known, on the surface that was met last.
    pub(super) outlined: Direct,
}

impl Default for Shared {
    fn default() -> Self {
        Self {
            lobe_rays: FIRST_LOBE_RAYS,
            lobes: Lobes::NONE,
            found: Findings::default(),
            incident: Vec::new(),
            ray: Default::default(),
            middle: None,
            pixel: f32::INFINITY,
            often: Often::All,
        }
    }
}

impl Shared {
    /// That of pixels which are so wide at distance 1.
    pub(super) fn of(pixel: f32, often: Often) -> Self {
        Self { pixel, often, ..Self::default() }
    }

    /// Begins a pixel, given the ray through its middle.
    pub(super) fn begin(&mut self, ray: (Vec3, Vec3)) {
        let often = std::mem::take(&mut self.often);
        *self = Self { ray, incident: std::mem::take(&mut self.incident), ..Self::of(self.pixel, often) };
    }

    /// After the corners: what the other rays need that all pixels have.
    pub(super) fn judge_corners(&mut self, others: u32) {
        self.lobe_rays = lobe_rays_of_others(&self.found.noise, others);
    }

    /// After these: what the rays need that some pixels have beside them.
    pub(super) fn judge(&mut self) {
        self.lobe_rays = lobe_rays(self.found.noise.map(|of| of.variance()));
    }
}

/// Numbers that are means of a few each: how much one of these differs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    means: f32,
    count: f32,
    sum: f32,
    squares: f32,
}

impl Spread {
    pub(super) fn add(&mut self, mean: f32, of: usize) {
        let of = of as f32;
        self.means += 1.0;
        self.count += of;
        self.sum += of * mean;
        self.squares += of * mean * mean;
    }

    fn mean(&self) -> f32 {
        self.sum / self.count.max(1.0)
    }

    fn variance(&self) -> f32 {
        ((self.squares - self.sum * self.mean()) / (self.means - 1.0).max(1.0)).max(0.0)
    }
}

/// Irradiance by emitters at some points of one side of a surface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Direct {
    side: Option<(u32, bool)>,
    count: u32,
    sum: Rgb,
    range: [Rgb; 2],
}

impl Direct {
    pub(super) fn add(&mut self, hit: &Hit, light: Rgb) {
        let side = Some((hit.surface, hit.front));
        if self.side != side {
            *self = Self { side, range: [light; 2], ..Self::default() };
        }
        self.count += 1;
        self.sum += light;
        self.range = [self.range[0].min(light), self.range[1].max(light)];
    }

    /// That of all points, where as many as there are corners say so.
    pub(super) fn even(&self, hit: &Hit) -> Option<Rgb> {
        let (mean, width) = (self.sum / self.count as f32, self.range[1] - self.range[0]);
        let is_even = || width.max_element() <= EVEN_LIGHT * mean.max_element();
        (self.side == Some((hit.surface, hit.front)) && self.count >= CORNERS && is_even()).then_some(mean)
    }
}

/// How many rays are to follow a lobe for each ray of a pixel, where diffuse light and that along one of them have these variances: what
/// makes the least noise in the same time.
fn lobe_rays([diffuse, lobe]: [f32; 2]) -> usize {
    let best = (DIFFUSE_RAYS * lobe / diffuse.max(f32::MIN_POSITIVE)).sqrt();
    if lobe > 0.0 && best.is_finite() { best.round().clamp(1.0, LOBE_RAYS as f32) as usize } else { LOBE_RAYS }
}

/// How many rays are to follow a lobe for each of the `others` rays of a pixel, by what the first ones met.
fn lobe_rays_of_others([diffuse, lobe]: &[Spread; 2], others: u32) -> usize {
    let wanted = lobe.variance() / (GRAIN * (diffuse.mean() + lobe.mean())).powi(2).max(f32::MIN_POSITIVE);
    let each = (wanted - lobe.count) / others.max(1) as f32;
    each.ceil().clamp(FEWEST_LOBE_RAYS, LOBE_RAYS as f32) as usize
}

/// Glossy light toward a pixel of samples that arrive.
pub(super) struct Shaded {
    /// The [face cluster](hr_diffuse::face_clusters) that they arrive at.
    pub(super) cluster: u32,
    pub(super) at: Vec3,
    /// Unit direction of what is seen mirrored.
    pub(super) seen: Vec3,
    /// Of the lobe.
    pub(super) width: f32,
    pub(super) light: Rgb,
}

/// The cells of a square grid, its corners first.
pub(super) fn corners_first(side: u32) -> impl Iterator<Item = u32> {
    let last = side - 1;
    let is_corner = move |i: &u32| (i % side).is_multiple_of(last.max(1)) && (i / side).is_multiple_of(last.max(1));
    let all = 0..side * side;
    all.clone().filter(is_corner).chain(all.filter(move |i| !is_corner(i)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hr_diffuse::sampling::{hash, unit};

    /// Where diffuse light is what is noisy, in half shadow, few rays follow a lobe, and never none.
    #[test]
    fn rays_go_where_the_noise_is() {
        for (diffuse, lobe, expected) in
            [(1.0, 0.01, 1), (1.0, 6.0, 4), (0.0, 1.0, LOBE_RAYS), (1.0, 0.0, LOBE_RAYS), (f32::NAN, 1.0, LOBE_RAYS)]
        {
            assert_eq!(lobe_rays([diffuse, lobe]), expected, "variances {diffuse} and {lobe}");
        }
    }

    /// The variance is that of one ray, whatever number of them each mean is of.
    #[test]
    fn means_of_several_rays_tell_how_much_one_differs() {
        assert_eq!(Spread::default().variance(), 0.0, "of nothing");
        for of in [1, 4, 16] {
            let mut spread = Spread::default();
            const MEANS: u32 = 512;
            for i in 0..MEANS {
                let ray = |k: u32| unit(hash(7, i * of + k));
                spread.add((0..of).map(ray).sum::<f32>() / of as f32, of as usize);
            }
            let (expected, found) = (1.0 / 12.0, spread.variance());
            assert!((found - expected).abs() < 0.15 * expected, "of {of}: {found}");
        }
    }

    #[test]
    fn the_other_rays_are_as_many_as_the_corners_ask_for() {
        let corners = |lights: [f32; 4]| {
            let mut noise = [Spread::default(); 2];
            for light in lights {
                noise[0].add(1.0, 1);
                noise[1].add(light, FIRST_LOBE_RAYS);
            }
            lobe_rays_of_others(&noise, 5)
        };
        assert_eq!(corners([0.1; 4]), 2, "no noise");
        assert_eq!(corners([0.0; 4]), 2, "no light");
        assert_eq!(corners([0.0, 0.4, 0.1, 0.2]), LOBE_RAYS, "much noise");
        let some = corners([0.085, 0.115, 0.1, 0.115]);
        assert!(some > 2 && some < LOBE_RAYS, "some noise: {some}");
    }

    #[test]
    fn corners_come_first() {
        assert_eq!(corners_first(3).collect::<Vec<_>>(), [0, 2, 6, 8, 1, 3, 4, 5, 7]);
        for side in 1..=4 {
            let mut all: Vec<u32> = corners_first(side).collect();
            assert!(all.iter().take(CORNERS as usize).all(|i| [0, side - 1].contains(&(i % side))), "{side}: {all:?}");
            all.sort_unstable();
            assert_eq!(all, (0..side * side).collect::<Vec<_>>(), "each once");
        }
    }

    /// Emitters' light is taken for the same where it is, on that side of that surface only.
    #[test]
    fn even_light_is_found_once() {
        let hit = |surface: u32, front: bool| Hit {
            surface,
            t: 1.0,
            uv: glam::Vec2::ZERO,
            point: Vec3::ZERO,
            normal: Vec3::Z,
            front,
        };
        let (here, mut direct) = (hit(3, true), Direct::default());
        for light in [1.0, 1.01, 0.995, 1.0] {
            assert_eq!(direct.even(&here), None, "too few yet");
            direct.add(&here, Rgb::splat(light));
        }
        let even = direct.even(&here).expect("four that agree");
        assert!((even.x - 1.001).abs() < 0.001, "their mean: {even}");
        assert!(direct.even(&hit(3, false)).is_none() && direct.even(&hit(4, true)).is_none(), "nowhere else");
        direct.add(&here, Rgb::splat(1.1));
        assert_eq!(direct.even(&here), None, "a shadow's edge");
        direct.add(&hit(4, true), Rgb::ONE);
        assert_eq!(direct.even(&here), None, "begun anew elsewhere");
    }
}
