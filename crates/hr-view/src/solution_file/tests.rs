use super::*;
use crate::glossy::Mode;
use crate::raycast::RayCaster;
use hr_diffuse::Settings;
use std::ops::ControlFlow;
use xxhash_rust::xxh3::xxh3_64;

/// A file of a test's own, removed at the end.
struct Kept(PathBuf);

impl Kept {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("hr-view-{name}-{}", std::process::id())))
    }

    fn write(&self, bytes: &[u8]) {
        std::fs::write(&self.0, bytes).expect("the folder for temporary files can be written to");
    }

    fn bytes(&self) -> Vec<u8> {
        std::fs::read(&self.0).expect("it was written")
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.0));
    }
}

/// Where the parts begin.
const BODY: usize = size_of::<Head>() + (1 + RUNS) * size_of::<Part>();

const ACCURACY: Accuracy = Accuracy { asked: 0.9, believed: 0.8 };

fn scene(name: &str) -> Arc<Scene> {
    Arc::new(Scene::load(name).expect("built in"))
}

fn solved(name: &str) -> Solved {
    let settings = Settings::with_error(ACCURACY.asked);
    Solved::new(scene(name), settings, true, &mut |_| ControlFlow::Continue(())).expect("it can be solved")
}

/// Solves and keeps a scene.
fn kept(name: &str, file: &str) -> (Solved, Kept) {
    let (solved, kept) = (solved(name), Kept::new(file));
    save(&kept.0, &solved, ACCURACY).expect("it can be written");
    (solved, kept)
}

fn error(kept: &Kept, scene: &Arc<Scene>) -> SolutionError {
    load(&kept.0, Arc::clone(scene)).expect_err("it is refused")
}

/// Puts the right lengths and checksums on what was changed: what is missing is missing from the last parts.
fn seal(bytes: &mut [u8]) {
    let length = bytes.len() as u64;
    let (head, rest) = bytes.split_at_mut(size_of::<Head>());
    let unsealed: Head = bytemuck::pod_read_unaligned(head);
    let (table, mut body) = rest.split_at_mut(unsealed.parts as usize * size_of::<Part>());
    let mut sealed: Vec<Part> = bytemuck::pod_collect_to_vec(table);
    for (i, part) in sealed.iter_mut().enumerate() {
        let is_last = i as u64 + 1 == unsealed.parts;
        let there = body.len() as u64;
        part.length = if is_last { there } else { part.length.min(there) };
        let (this, after) = body.split_at_mut(part.length as usize);
        part.checksum = xxh3_64(this);
        body = after;
    }
    table.copy_from_slice(bytemuck::cast_slice(&sealed));
    head.copy_from_slice(bytemuck::bytes_of(&Head { length, ..unsealed }.sealed(&sealed)));
}

#[test]
fn pictures_are_the_same_bit_by_bit() {
    for name in ["glossy-sphere", "room"] {
        let (before, file) = kept(name, &format!("pictures-{name}"));
        let (after, accuracy) = load(&file.0, scene(name)).expect("it can be read");
        assert_eq!(accuracy, ACCURACY, "{name}: accuracy");
        let mut camera = before.scene.default_camera();
        [camera.width, camera.height] = [40, 30];
        for mode in [Mode::Distributions, Mode::Samples] {
            let [old, new] = [&before, &after].map(|solved| {
                let caster = RayCaster::new(&solved.scene, &solved.solution, mode).with_grid(1);
                let pixels = caster.render(&camera, &|_| ()).pixels;
                pixels.into_iter().flat_map(|pixel| pixel.to_array().map(f32::to_bits)).collect::<Vec<u32>>()
            });
            assert!(old.iter().any(|&bits| f32::from_bits(bits) > 0.0), "{name}, {mode:?}: there is light");
            assert!(old == new, "{name}, {mode:?}: not one bit differs");
        }
        let again = Kept::new(&format!("pictures-again-{name}"));
        save(&again.0, &after, accuracy).expect("it can be written");
        assert!(file.bytes() == again.bytes(), "{name}: nothing was lost on the way");
    }
}

#[test]
fn any_damage_is_found() {
    let (solved, file) = kept("furnace", "damage");
    let (scene, whole) = (solved.scene, file.bytes());
    let cuts = (0..64).chain((64..whole.len()).step_by(whole.len() / 97));
    for length in cuts {
        file.write(&whole[..length]);
        let is_right = match error(&file, &scene) {
            SolutionError::Foreign { .. } => length < size_of::<Head>(),
            SolutionError::Length { found, expected, .. } => {
                [found, expected] == [length, whole.len()].map(|n| n as u64)
            }
            _ => false,
        };
        assert!(is_right, "{length} of {} bytes", whole.len());
    }
    let flips = (0..8 * 64).chain((8 * 64..8 * whole.len()).step_by(8 * whole.len() / 211));
    for bit in flips {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        file.write(&bytes);
        let error = error(&file, &scene);
        let is_right = match bit / 64 {
            0 => matches!(error, SolutionError::Foreign { .. }),
            1 => matches!(error, SolutionError::Version { .. }),
            2 => matches!(error, SolutionError::Length { .. }),
            _ => matches!(error, SolutionError::Checksum { .. }),
        };
        assert!(is_right, "bit {bit}: {error}");
    }
    let mut longer = whole;
    longer.push(0);
    file.write(&longer);
    assert!(matches!(error(&file, &scene), SolutionError::Length { .. }), "a byte too many");
}

#[test]
fn other_files_and_scenes_are_told_apart() {
    let (solved, file) = kept("furnace", "others");
    let text = error(&file, &scene("room")).to_string();
    assert!(text.contains("another scene than room") && text.contains("others"), "'{text}' names both");
    let mut newer = file.bytes();
    newer[8] = VERSION as u8 + 1;
    seal(&mut newer);
    file.write(&newer);
    let text = error(&file, &solved.scene).to_string();
    let [other, ours] = [VERSION + 1, VERSION].map(|version| format!("version {version}"));
    assert!(text.contains(&other) && text.contains(&ours), "'{text}' names both versions");
    for foreign in [&b""[..], b"PF\n24 16\n-1.0\n", &[0; 4096]] {
        file.write(foreign);
        assert!(matches!(error(&file, &solved.scene), SolutionError::Foreign { .. }), "{} bytes", foreign.len());
    }
    let missing = Kept::new("missing");
    assert!(matches!(error(&missing, &solved.scene), SolutionError::File(_)), "no such file");
}

/// What a checksum cannot find: files that someone made to be wrong. They are refused, or harmless.
#[test]
fn forged_files_do_no_harm() {
    let (solved, file) = kept("glossy-sphere", "forged");
    let (scene, whole) = (solved.scene, file.bytes());
    let mut camera = scene.default_camera();
    [camera.width, camera.height] = [8, 6];
    let (mut refused, mut taken) = (0, 0);
    let mut seed = 1_u64;
    let mut random = |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    };
    for round in 0..300 {
        let mut bytes = whole.clone();
        match round % 3 {
            0 => {
                let at = BODY + random(whole.len() - BODY);
                bytes[at] ^= 1 << random(8);
            }
            1 => {
                let at = BODY + 4 * random((whole.len() - BODY) / 4);
                bytes[at..at + 4].fill(0xff);
            }
            _ => bytes.truncate(BODY + 8 * random((whole.len() - BODY) / 8)),
        }
        seal(&mut bytes);
        file.write(&bytes);
        match load(&file.0, Arc::clone(&scene)) {
            Err(SolutionError::Content { .. }) => refused += 1,
            Err(error) => panic!("round {round}: {error}"),
            Ok((solved, _)) => {
                taken += 1;
                for mode in [Mode::Distributions, Mode::Samples] {
                    let caster = RayCaster::new(&solved.scene, &solved.solution, mode).with_grid(1);
                    let image = caster.render(&camera, &|_| ());
                    assert_eq!(image.pixels.len(), 48, "round {round}: a picture of something");
                }
            }
        }
    }
    assert!(refused > 100 && taken > 0, "{refused} refused, {taken} taken");
    let mut longer = whole;
    longer.extend([0; 8]);
    seal(&mut longer);
    file.write(&longer);
    let text = error(&file, &scene).to_string();
    assert!(text.contains(&FlatError::GoesOn.to_string()), "'{text}'");
}
