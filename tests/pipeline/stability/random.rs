//! Random scenes and settings, made to hit the hard cases: shared corners, common planes, zero and huge numbers.

use crate::stability::answers::assert_sane;
use glam::{DVec3, Vec3};
use hr_diffuse::sampling::{hash, unit};
use hr_diffuse::{
    Budget, DiffuseMaterial, Light, LightKind, Progress, Rgb, SceneInput, Settings, Shape, Solution, SolveError,
    Solver, Surface,
};
use std::ops::ControlFlow;
use std::time::Duration;

/// Scenes per test, where `STABILITY_CASES` does not say.
const CASES: u32 = 100;
/// A scene need not be solved to the end: by this many calls of the watch function it has been through all phases.
const MOST_CALLS: u32 = 60;

fn cases() -> u32 {
    std::env::var("STABILITY_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(CASES)
}

/// A stream of numbers that depends on its seed alone.
struct Source {
    seed: u32,
    drawn: u32,
}

impl Source {
    fn new(test: u32, case: u32) -> Self {
        Self { seed: hash(test, case), drawn: 0 }
    }

    fn unit(&mut self) -> f64 {
        self.drawn += 1;
        f64::from(unit(hash(self.seed, self.drawn)))
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }

    fn of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }

    /// Mostly points of a coarse grid, so that corners, edges and planes coincide; sometimes anything.
    fn coordinate(&mut self) -> f64 {
        match self.below(40) {
            0 => self.of(&[1e-7, -1e-7, 1e-3, 1e6, -1e6, 1e-30]),
            1..8 => self.unit() * 2.0 - 0.5,
            _ => self.of(&[0.0, 0.25, 0.5, 0.75, 1.0]),
        }
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.coordinate(), self.coordinate(), self.coordinate())
    }

    fn length(&mut self) -> f64 {
        self.of(&[0.0, 1e-7, 0.1, 0.25, 0.5, 1.0, 10.0])
    }

    fn axis(&mut self) -> DVec3 {
        let free = self.point();
        self.of(&[DVec3::X, -DVec3::Y, DVec3::Z, free, free.normalize_or_zero(), DVec3::ZERO])
    }

    fn shape(&mut self) -> Shape {
        match self.below(10) {
            0..3 => Shape::Triangle([self.point(), self.point(), self.point()]),
            3..6 => {
                let (corner, a, b) = (self.point(), self.axis(), self.axis());
                Shape::Quad([corner, corner + a, corner + a + b, corner + b])
            }
            6 => Shape::Sphere { center: self.point(), radius: self.length() },
            7 => Shape::Cone { ends: [self.point(), self.point()], radii: [self.length(), self.length()] },
            8 => Shape::Ring {
                center: self.point(),
                normal: self.axis(),
                inner: self.length() * 0.5,
                outer: self.length(),
            },
            _ => Shape::Torus {
                center: self.point(),
                axis: self.axis(),
                major: self.length(),
                minor: self.length() * 0.5,
            },
        }
    }

    fn color(&mut self, values: &[f32]) -> Rgb {
        if self.below(3) > 0 {
            return Rgb::splat(self.of(values));
        }
        Rgb::new(self.of(values), self.of(values), self.of(values))
    }

    fn light(&mut self) -> Light {
        let direction = self.axis().as_vec3().normalize_or(Vec3::X);
        let cosine = self.unit() as f32;
        let kind = self.of(&[
            LightKind::Point,
            LightKind::Spot { direction, cos_inner: cosine, cos_outer: cosine - 0.1 },
            LightKind::Spot { direction, cos_inner: cosine, cos_outer: cosine },
            LightKind::Directional { direction },
        ]);
        Light { position: self.point(), intensity: self.color(&[0.0, 1.0, 1e-20, 1e10]), kind }
    }

    fn scene(&mut self) -> SceneInput {
        let materials: Vec<DiffuseMaterial> = (0..1 + self.below(4))
            .map(|_| DiffuseMaterial {
                reflectance: self.color(&[0.0, 0.2, 0.5, 0.9, 0.999, 1.0]),
                exitance: self.color(&[0.0, 0.0, 0.0, 1.0, 1e-20, 1e20]),
                two_sided: self.below(2) == 0,
            })
            .collect();
        let mut surfaces: Vec<Surface> = Vec::new();
        for _ in 0..1 + self.below(16) {
            let again = (self.below(8) == 0).then(|| surfaces.last().cloned()).flatten();
            let material = self.below(materials.len()) as u32;
            let flip = self.below(4) == 0;
            let new = Surface { flip, ..Surface::new(self.shape(), material) };
            surfaces.push(again.unwrap_or(new));
        }
        let lights = (0..self.below(3)).map(|_| self.light()).collect();
        SceneInput { surfaces, materials, lights, texture: None }
    }
}

/// Surfaces that the solver refuses are left out one by one, as its messages advise.
fn mended(mut input: SceneInput, settings: Settings) -> Option<(SceneInput, Solver)> {
    loop {
        match Solver::new(&input, settings, ()) {
            Ok(solver) => return Some((input, solver)),
            Err(SolveError::Surface { surface, .. } | SolveError::NoSteadyState { surface, .. }) => {
                input.surfaces.remove(surface);
            }
            Err(SolveError::Light { light, .. }) => {
                input.lights.remove(light);
            }
            Err(SolveError::Empty) => return None,
            Err(other) => panic!("{other} in {input:?}"),
        }
    }
}

/// What there is when a solver is done, or has been called often enough.
fn ended(mut solver: Solver) -> Solution {
    let mut calls = 0;
    let mut watch = |_: &Progress| {
        calls += 1;
        if calls > MOST_CALLS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    solver.solve(&mut watch);
    solver.finish(&mut watch)
}

/// What an error names can be left out, and then the rest is solved: all numbers finite, no negative light.
#[test]
fn random_scenes_are_refused_or_solved() {
    let mut solved = 0;
    for case in 0..cases() {
        let mut source = Source::new(0xa11, case);
        let error = source.of(&[1.0, 0.5, 0.2, 0.05]);
        let memory = source.of(&[None, None, Some(0), Some(100_000), Some(u64::MAX)]);
        let time = source.of(&[None, None, Some(Duration::ZERO), Some(Duration::from_millis(20)), Some(Duration::MAX)]);
        let settings = Settings { budget: Budget { time, memory }, ..Settings::with_error(error) };
        let Some((input, solver)) = mended(source.scene(), settings) else { continue };
        let solution = ended(solver);
        assert_sane(&solution, &format!("case {case}, {input:?}"));
        solved += 1;
    }
    assert!(solved > cases() / 2, "most can be solved: {solved}");
}

/// No more light than there can be: in no scene whose materials reflect at most half does anything send more than what the
/// brightest emitter does over what is not reflected, if leaves see up to a tenth more than all there is. Lights without extent
/// have poles, and are left out.
#[test]
fn random_scenes_do_not_make_light() {
    for case in 0..cases() {
        let mut source = Source::new(0xb22, case);
        let mut input = source.scene();
        input.lights.clear();
        for material in &mut input.materials {
            material.reflectance *= 0.5;
        }
        let Some((input, solver)) = mended(input, Settings::with_error(0.5)) else { continue };
        let solution = ended(solver);
        let brightest = input.materials.iter().map(|m| m.exitance).fold(Rgb::ZERO, Rgb::max);
        for radiosity in &solution.exitant.radiosity {
            let most = brightest / (1.0 - 0.5 * 1.1) * 1.01;
            assert!(radiosity.cmple(most).all(), "case {case}: {radiosity} of {brightest}, {input:?}");
        }
    }
}

/// The same seed, the same scene: a failing case can be found again.
#[test]
fn random_scenes_are_the_same_each_time() {
    for case in 0..20 {
        let [a, b] = [0, 0].map(|test| Source::new(test, case).scene());
        assert_eq!(a.surfaces, b.surfaces, "case {case}");
    }
}
