//! How the normals of a set of surfaces are distributed: as much of it as tells how large the set looks from a direction.

use glam::{Vec3, Vec3Swizzles};

/// Area-weighted first and second moments of unit normals. Linear: those of a whole are the mean of those of its
/// parts, so that splitting an element changes nothing in sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Facing {
    /// Mean normal: of length 1 for flat sets, 0 for closed ones.
    pub mean: Vec3,
    /// Means of nx², ny², nz².
    pub diagonal: Vec3,
    /// Means of ny·nz, nz·nx, nx·ny.
    pub mixed: Vec3,
}

impl Facing {
    /// No surface at all.
    pub const ZERO: Self = Self { mean: Vec3::ZERO, diagonal: Vec3::ZERO, mixed: Vec3::ZERO };

    /// A single unit normal.
    #[must_use]
    pub fn single(normal: Vec3) -> Self {
        Self { mean: normal, diagonal: normal * normal, mixed: normal.yzx() * normal.zxy() }
    }

    /// The back of it.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self { mean: -self.mean, ..self }
    }

    /// Adds others with a weight.
    pub fn add(&mut self, other: &Self, weight: f32) {
        self.mean += other.mean * weight;
        self.diagonal += other.diagonal * weight;
        self.mixed += other.mixed * weight;
    }

    /// With all moments multiplied.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        Self { mean: self.mean * factor, diagonal: self.diagonal * factor, mixed: self.mixed * factor }
    }

    /// Mean of max(0, n·ω) over the normals n, for a unit vector ω; 0…1.
    ///
    /// The first three terms of the Legendre series of max(0, x), ¼ + ½x + 5/16·P₂(x), kept within what the moments
    /// allow: E x ≤ E max(0, x) ≤ ½(E x + √(E x²)). Exact for flat sets, spheres and hemispheres; 3% off for cylinders.
    #[must_use]
    pub fn mean_cosine(&self, direction: Vec3) -> f32 {
        let x = self.mean.dot(direction);
        let x2 = self.diagonal.dot(direction * direction) + 2.0 * self.mixed.dot(direction.yzx() * direction.zxy());
        let x2 = x2.max(x * x);
        let series = 0.25 + 0.5 * x + (5.0 / 32.0) * (3.0 * x2 - 1.0);
        series.min(0.5 * (x + x2.sqrt())).max(x).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean over normals on a part of the unit sphere's latitudes (heights), by brute force.
    fn cap(heights: std::ops::Range<f32>) -> (Facing, Vec<Vec3>) {
        let mut normals = Vec::new();
        for i in 0..200 {
            let z = heights.start + (heights.end - heights.start) * (i as f32 + 0.5) / 200.0;
            for j in 0..200 {
                let (sin, cos) = (std::f32::consts::TAU * j as f32 / 200.0).sin_cos();
                let r = (1.0 - z * z).sqrt();
                normals.push(Vec3::new(r * cos, r * sin, z));
            }
        }
        let mut facing = Facing::ZERO;
        for normal in &normals {
            facing.add(&Facing::single(*normal), 1.0 / normals.len() as f32);
        }
        (facing, normals)
    }

    #[test]
    fn mean_cosines_agree_with_brute_force() {
        // Sphere, hemisphere, a cap of 60°, a band that is nearly a cylinder.
        for (heights, allowed) in [(-1.0..1.0, 0.002), (0.0..1.0, 0.002), (0.5..1.0, 0.02), (-0.1..0.1, 0.015)] {
            let (facing, normals) = cap(heights.clone());
            for angle in 0..=12 {
                let (sin, cos) = (std::f32::consts::PI * angle as f32 / 12.0).sin_cos();
                let direction = Vec3::new(sin * 0.6, sin * 0.8, cos);
                let exact = normals.iter().map(|n| n.dot(direction).max(0.0)).sum::<f32>() / normals.len() as f32;
                let ours = facing.mean_cosine(direction);
                assert!((ours - exact).abs() < allowed, "{heights:?}, {angle}: {ours} against {exact}");
            }
        }
        let flat = Facing::single(Vec3::Z);
        assert_eq!(flat.mean_cosine(Vec3::new(0.0, 0.6, 0.8)), 0.8);
        assert_eq!(flat.mean_cosine(Vec3::NEG_Z), 0.0);
    }
}
