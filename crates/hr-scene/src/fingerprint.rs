//! What tells scenes apart: a number made of all that light depends on.

use crate::{Material, Scene, SurfaceAttributes, Texture};
use glam::{DVec3, Vec3};
use hr_diffuse::{Light, LightKind, Shape, Surface};
use std::fmt::{self, Debug, Write};
use xxhash_rust::xxh3::Xxh3;

impl Scene {
    /// A number (XXH3, 64 bits) made of surfaces, materials, textures and lights, in their order: scenes with the same one
    /// are the same to light. Names, cameras and warnings have no part in it. It is the same on all machines.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let Self { surfaces, attributes, materials, lights, name: _, cameras: _, primaries: _, warnings: _ } = self;
        let mut print = Print(Xxh3::new());
        print.counts([surfaces.len(), attributes.len(), materials.len(), lights.len()]);
        surfaces.iter().for_each(|surface| print.surface(surface));
        attributes.iter().for_each(|attributes| print.attributes(attributes));
        materials.iter().for_each(|material| print.material(material));
        lights.iter().for_each(|light| print.light(light));
        print.0.digest()
    }
}

struct Print(Xxh3);

impl Print {
    fn counts<const N: usize>(&mut self, counts: [usize; N]) {
        self.0.update(counts.map(|count| (count as u64).to_le_bytes()).as_flattened());
    }

    fn numbers<const N: usize>(&mut self, numbers: [f64; N]) {
        self.0.update(numbers.map(f64::to_le_bytes).as_flattened());
    }

    fn points(&mut self, points: &[DVec3]) {
        points.iter().for_each(|point| self.numbers(point.to_array()));
    }

    fn colors(&mut self, colors: &[Vec3]) {
        colors.iter().for_each(|color| self.numbers(color.as_dvec3().to_array()));
    }

    /// What can only tell of itself in words does so exactly: numbers are written so that they can be read again.
    fn words(&mut self, words: &impl Debug) {
        // Takes anything.
        let _ = write!(self, "{words:?};");
    }

    fn surface(&mut self, surface: &Surface) {
        let Surface { shape, flip, material, shading_normals } = surface;
        self.counts([usize::from(*flip), *material as usize, usize::from(shading_normals.is_some())]);
        self.colors(shading_normals.as_ref().map_or(&[], |normals| &normals[..]));
        match *shape {
            Shape::Triangle(corners) => {
                self.counts([0]);
                self.points(&corners);
            }
            Shape::Quad(corners) => {
                self.counts([1]);
                self.points(&corners);
            }
            Shape::Sphere { center, radius } => {
                self.counts([2]);
                self.points(&[center]);
                self.numbers([radius]);
            }
            Shape::Cone { ends, radii } => {
                self.counts([3]);
                self.points(&ends);
                self.numbers(radii);
            }
            Shape::Ring { center, normal, inner, outer } => {
                self.counts([4]);
                self.points(&[center, normal]);
                self.numbers([inner, outer]);
            }
            Shape::Torus { center, axis, major, minor } => {
                self.counts([5]);
                self.points(&[center, axis]);
                self.numbers([major, minor]);
            }
        }
    }

    fn attributes(&mut self, attributes: &SurfaceAttributes) {
        let SurfaceAttributes { surface, uv, color } = attributes;
        self.counts([*surface as usize]);
        uv.iter().for_each(|uv| self.numbers(uv.as_dvec2().to_array()));
        self.colors(color);
    }

    fn material(&mut self, material: &Material) {
        let Material { name: _, reflector, exitance, two_sided, texture, base_color } = material;
        self.words(reflector);
        self.colors(&[*exitance, *base_color]);
        self.counts([usize::from(*two_sided), usize::from(texture.is_some())]);
        if let Some(Texture { texels, transform, wrap }) = texture {
            self.counts([texels.width() as usize, texels.height() as usize]);
            self.colors(texels.data());
            self.words(&(transform, wrap));
        }
    }

    fn light(&mut self, light: &Light) {
        let Light { position, intensity, kind } = light;
        self.points(&[*position]);
        self.colors(&[*intensity]);
        match *kind {
            LightKind::Point => self.counts([0]),
            LightKind::Spot { direction, cos_inner, cos_outer } => {
                self.counts([1]);
                self.colors(&[direction]);
                self.numbers([cos_inner.into(), cos_outer.into()]);
            }
            LightKind::Directional { direction } => {
                self.counts([2]);
                self.colors(&[direction]);
            }
        }
    }
}

impl Write for Print {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin;
    use std::sync::Arc;

    type Change = fn(&mut Scene);

    fn room() -> Scene {
        Scene::load("room").expect("built in")
    }

    #[test]
    fn every_scene_has_its_own() {
        let mut all: Vec<u64> =
            builtin::NAMES.iter().map(|name| Scene::load(name).expect("built in").fingerprint()).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), builtin::NAMES.len(), "no two are alike");
        assert_eq!(room().fingerprint(), room().fingerprint(), "the same scene again");
    }

    #[test]
    fn every_change_to_light_shows() {
        let changes: [(&str, Change); 6] = [
            ("a surface less", |scene| scene.surfaces.truncate(scene.surfaces.len() - 1)),
            ("a surface turned over", |scene| scene.surfaces[3].flip ^= true),
            ("a surface of another material", |scene| scene.surfaces[0].material ^= 1),
            ("a brighter lamp", |scene| scene.materials[0].exitance.x += 1e-6),
            ("another reflector", |scene| {
                let other = scene.materials[1].reflector.diffuse() * 0.999;
                scene.materials[1].reflector = Arc::new(glossy_ext::Lambert::new(other).expect("a colour"));
            }),
            ("two lamps in one place", |scene| {
                let kind = LightKind::Point;
                scene.lights.push(Light { position: DVec3::ZERO, intensity: Vec3::ONE, kind });
            }),
        ];
        for (what, change) in changes {
            let mut changed = room();
            change(&mut changed);
            assert_ne!(changed.fingerprint(), room().fingerprint(), "{what}");
        }
        let mut named = room();
        named.name.push('2');
        named.cameras.clear();
        assert_eq!(named.fingerprint(), room().fingerprint(), "light does not know of names and cameras");
    }
}
