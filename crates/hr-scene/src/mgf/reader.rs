//! Executes the statements of a file: contexts, transforms, includes and what they make of the geometry.

use super::color::Chromaticity;
use super::context::Contexts;
use super::fault::{Fault, fault, numbers};
use super::geometry::{Vertex, unit};
use super::lexer::File;
use super::material::{Definition, Key};
use super::transform::Transform;
use crate::error::quoted;
use crate::warnings::Warnings;
use crate::{Material, Primaries, Scene, SceneError};
use glam::{DAffine3, DVec3};
use hr_diffuse::Surface;
use std::collections::HashMap;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Deepest nesting of includes and arrays.
const MAX_DEPTH: usize = 64;

/// Most words that may be executed beyond those that the files have: arrays and repeated includes multiply a small
/// file to any size, and a few million surfaces still fit into some GiB.
const MAX_REPEATED_WORDS: u64 = 20_000_000;

/// Reads the contents of an included file.
pub type Include<'a> = &'a dyn Fn(&Path) -> io::Result<Vec<u8>>;

/// A file, or the body of an array, that is being executed; once per instance.
struct Frame {
    file: Rc<File>,
    /// Whether this is a whole file, not part of one.
    is_file: bool,
    body: std::ops::Range<usize>,
    next: usize,
    transform: Transform,
    instance: u64,
    /// How many matrices there were outside.
    outside: usize,
}

pub(super) struct Reader<'a> {
    include: Include<'a>,
    files: HashMap<PathBuf, Rc<File>>,
    frames: Vec<Frame>,
    /// Products of all transforms from the outermost on.
    matrices: Vec<DAffine3>,
    open_objects: usize,
    pub(super) vertices: Contexts<Vertex>,
    pub(super) colors: Contexts<Chromaticity>,
    pub(super) definitions: Contexts<Definition>,
    /// Index of the current material, once it is used.
    pub(super) material: Option<u32>,
    pub(super) known_materials: HashMap<(String, Key), u32>,
    pub(super) materials: Vec<Material>,
    pub(super) surfaces: Vec<Surface>,
    pub(super) warnings: Warnings,
    executed_words: u64,
    file_words: u64,
}

/// Reads a whole scene.
pub(super) fn read(path: &Path, bytes: &[u8], include: Include) -> Result<Scene, SceneError> {
    let mut reader = Reader {
        include,
        files: HashMap::new(),
        frames: Vec::new(),
        matrices: vec![DAffine3::IDENTITY],
        open_objects: 0,
        vertices: Contexts::new("v", "vertex"),
        colors: Contexts::new("c", "colour"),
        definitions: Contexts::new("m", "material"),
        material: None,
        known_materials: HashMap::new(),
        materials: Vec::new(),
        surfaces: Vec::new(),
        warnings: Warnings::default(),
        executed_words: 0,
        file_words: 0,
    };
    let file = reader.keep(path, bytes);
    let body = 0..file.statements.len();
    reader.enter(file, true, body, Transform::identity());
    reader.run()?;
    Ok(Scene {
        name: path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned()),
        surfaces: reader.surfaces,
        materials: reader.materials,
        primaries: Primaries::Radiance,
        warnings: reader.warnings.into_list(),
        ..Scene::default()
    })
}

impl Reader<'_> {
    fn run(&mut self) -> Result<(), SceneError> {
        while let Some(frame) = self.frames.last_mut() {
            let (file, statement) = (Rc::clone(&frame.file), frame.next);
            if statement == frame.body.end {
                self.end_of_body();
                continue;
            }
            frame.next += 1;
            self.execute(&file, statement).map_err(|Fault { what, mend }| SceneError::Syntax {
                place: file.place(statement),
                what,
                mend,
            })?;
        }
        if self.open_objects > 0 {
            self.warn("object left open at the end of the file");
        }
        Ok(())
    }

    /// Begins a file or the body of an array, if it has any instance.
    fn enter(&mut self, file: Rc<File>, is_file: bool, body: std::ops::Range<usize>, transform: Transform) {
        if transform.instances() == 0 {
            return;
        }
        let matrix = self.matrix() * transform.matrix(0);
        let outside = self.matrices.len();
        self.matrices.push(matrix);
        let next = body.start;
        self.frames.push(Frame { file, is_file, body, next, transform, instance: 0, outside });
    }

    /// Goes on to the next instance, or back to what is around.
    fn end_of_body(&mut self) {
        let Some(frame) = self.frames.last() else { return };
        if self.matrices.len() > frame.outside + 1 {
            self.warn("transform (xf) left open at the end of its file: closed there");
        }
        let Some(frame) = self.frames.last_mut() else { return };
        self.matrices.truncate(frame.outside);
        frame.instance += 1;
        if frame.instance < frame.transform.instances() {
            frame.next = frame.body.start;
            let matrix = frame.transform.matrix(frame.instance);
            self.matrices.push(self.matrix() * matrix);
        } else {
            self.frames.pop();
        }
    }

    /// The transform in effect.
    pub(super) fn matrix(&self) -> DAffine3 {
        self.matrices.last().copied().unwrap_or(DAffine3::IDENTITY)
    }

    /// Where we are.
    pub(super) fn place(&self) -> String {
        self.frames.last().map_or_else(String::new, |frame| frame.file.place(frame.next.saturating_sub(1)))
    }

    pub(super) fn warn(&mut self, text: impl Into<String>) {
        let place = self.place();
        self.warnings.add(text, || place);
    }

    fn execute(&mut self, file: &Rc<File>, statement: usize) -> Result<(), Fault> {
        let keyword = file.keyword(statement);
        let words: Vec<_> = file.arguments(statement).collect();
        self.charge(words.len() as u64 + 1)?;
        let words = words.as_slice();
        match keyword {
            _ if keyword.starts_with('#') => {}
            "v" => self.vertices.select(words)?,
            "c" => self.colors.select(words)?,
            "m" => {
                self.material = None;
                self.definitions.select(words)?;
            }
            "p" => self.vertices.current_mut().point = DVec3::from(numbers(words, "p x y z")?),
            "n" => self.vertices.current_mut().normal = unit(DVec3::from(numbers(words, "n dx dy dz")?)),
            "cxy" | "cspec" | "cct" | "cmix" => self.color(keyword, words)?,
            "rd" | "rs" | "td" | "ts" | "ed" | "sides" | "ir" => self.property(keyword, words)?,
            "f" | "fh" | "sph" | "cyl" | "cone" | "ring" | "torus" | "prism" => {
                self.geometry(file, statement, words)?;
            }
            "o" => self.object(words),
            "xf" => self.transform(file, statement, words)?,
            "i" => self.include(file, words)?,
            "ies" => {
                let name = words.first().copied().unwrap_or_default();
                return fault(
                    format!("IES luminaire {} is not supported", quoted(name)),
                    "convert it to MGF geometry with exitance (`ed`), or delete the statement",
                );
            }
            _ => self.warn(format!("unknown entity {}: ignored", quoted(keyword))),
        }
        Ok(())
    }

    /// Accounts for work, so that a small file cannot keep us busy forever.
    pub(super) fn charge(&mut self, words: u64) -> Result<(), Fault> {
        self.executed_words += words;
        if self.executed_words > self.file_words + MAX_REPEATED_WORDS {
            return fault(
                format!("arrays, includes and large polygons come to more than {MAX_REPEATED_WORDS} words"),
                "make arrays smaller or split polygons",
            );
        }
        Ok(())
    }

    fn object(&mut self, words: &[&str]) {
        if !words.is_empty() {
            self.open_objects += 1;
        } else if self.open_objects > 0 {
            self.open_objects -= 1;
        } else {
            self.warn("'o' closes an object that was not opened: ignored");
        }
    }

    fn transform(&mut self, file: &Rc<File>, statement: usize, words: &[&str]) -> Result<(), Fault> {
        let partner = file.statements[statement].partner;
        if words.is_empty() {
            if partner.is_none() {
                return fault(
                    "'xf' closes a transform that was not opened in this file",
                    "delete it, or open one with `xf -t dx dy dz` or the like",
                );
            }
            self.matrices.pop();
            return Ok(());
        }
        let transform = Transform::new(words)?;
        if !words.contains(&"-a") {
            let matrix = self.matrix() * transform.matrix(0);
            self.matrices.push(matrix);
            return Ok(());
        }
        let Some(end) = partner else {
            return fault("an array (xf … -a) without an end", "close it with `xf` on a line of its own");
        };
        self.check_depth()?;
        if let Some(frame) = self.frames.last_mut() {
            frame.next = end + 1;
        }
        self.enter(Rc::clone(file), false, statement + 1..end, transform);
        Ok(())
    }

    fn check_depth(&self) -> Result<(), Fault> {
        if self.frames.len() >= MAX_DEPTH {
            return fault(
                format!("includes and arrays are nested more than {MAX_DEPTH} deep"),
                "nest them less; a file must not include itself",
            );
        }
        Ok(())
    }

    fn include(&mut self, file: &Rc<File>, words: &[&str]) -> Result<(), Fault> {
        let Some((name, transform)) = words.split_first() else {
            return fault("an include without a file name", "write `i file.mgf`, transform arguments after it if any");
        };
        let transform = Transform::new(transform)?;
        let path = simplified(&file.path.parent().unwrap_or(Path::new("")).join(name));
        if self.frames.iter().any(|frame| frame.is_file && frame.file.path == path) {
            return fault(
                format!("file {} includes itself", quoted(name)),
                "break the circle: put what both files need into a third one",
            );
        }
        self.check_depth()?;
        let included = match self.files.get(&path) {
            Some(included) => Rc::clone(included),
            None => match (self.include)(&path) {
                Ok(bytes) => self.keep(&path, &bytes),
                Err(error) => {
                    return fault(
                        format!("cannot read include {}: {error}", quoted(name)),
                        "file names are relative to the folder of the including file",
                    );
                }
            },
        };
        let body = 0..included.statements.len();
        self.enter(included, true, body, transform);
        Ok(())
    }

    /// Cuts a file into statements and keeps it for the next time that it is included.
    fn keep(&mut self, path: &Path, bytes: &[u8]) -> Rc<File> {
        let path = simplified(path);
        let file = Rc::new(File::new(path.clone(), bytes));
        self.file_words += file.word_count() as u64;
        self.files.insert(path, Rc::clone(&file));
        file
    }
}

/// A path without its `.` components, so that a file has one name.
fn simplified(path: &Path) -> PathBuf {
    path.components().filter(|component| *component != Component::CurDir).collect()
}
