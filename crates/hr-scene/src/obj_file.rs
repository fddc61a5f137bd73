//! Wavefront OBJ with MTL materials.
//!
//! Read: polygons with any number of corners (planar convex quadrilaterals stay whole), normals, texture coordinates,
//! vertex colours after the coordinates, materials: `Kd`, `Ks`, `Ns` (diffuse and energy-normalised Phong), `Ke`
//! (radiance in W/(m² sr)), `map_Kd` with its `-s`, `-o` and `-clamp`, and `Pr`, `Pm` of the PBR extension, which make
//! it metallic-roughness. Most files' Ks is no reflectance: where Kd + Ks exceeds 1 anywhere in a library, its highlights
//! are the classic, not normalised ones, whose reflectance is 8 Ks / (Ns + 8). Colours are taken as linear Rec. 709, but images as sRGB. The format does not know
//! sides: all faces reflect on both, and emit on the side from which they are counter-clockwise.
//!
//! The parser is our own: it knows line numbers, keeps double precision and quadrilaterals, and takes lines for what
//! they are, not for polygons.

mod mtl;
#[cfg(test)]
mod tests;

use crate::error::quoted;
use crate::mesh::{Face, MAX_SURFACES, Part, Vertices, merge, place};
use crate::polygon::{Piece, pieces};
use crate::warnings::Warnings;
use crate::whole_file;
use crate::{Primaries, Scene, SceneError};
use glam::{DMat4, DVec3, Vec2, Vec3};
use glossy_ext::Rgb;
use mtl::Library;
use std::collections::HashMap;
use std::path::Path;
use std::str::SplitWhitespace;

/// Loads an .obj file with its material libraries and images.
///
/// # Errors
/// [`SceneError::Io`] where the file cannot be read, [`SceneError::Syntax`] with the line where a number or an index
/// is wrong, [`SceneError::Empty`] where it has no polygon. Missing libraries, materials and images are only warned
/// of; grey stands in for a missing material.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    from_bytes(&whole_file::read_whole(path)?, path)
}

/// As [`load`], for a file's contents; `path` is where other files are looked for, and its name.
pub(crate) fn from_bytes(bytes: &[u8], path: &Path) -> Result<Scene, SceneError> {
    let mut warnings = Warnings::default();
    let mut reader = Reader::new(path);
    for (line, statement) in statements(&whole_file::text(bytes)) {
        reader.statement(line, &statement, &mut warnings)?;
    }
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let mut scene = Scene { name, primaries: Primaries::Rec709, ..Scene::default() };
    let mut materials: HashMap<(Option<usize>, bool, bool), u32> = HashMap::new();
    for group in reader.groups {
        let mut faces = merge(&group.vertices, &group.triangles);
        faces.extend(&group.quads);
        if scene.surfaces.len() + faces.len() > MAX_SURFACES {
            return Err(SceneError::Syntax {
                place: group.whence,
                what: format!("the scene has more than {MAX_SURFACES} faces"),
                mend: "simpler meshes would be right".to_owned(),
            });
        }
        let (textured, colored) = (!group.vertices.uv.is_empty(), !group.vertices.colors.is_empty());
        let source = group.material.and_then(|m| reader.library.materials.get(m));
        let textured = textured && source.is_some_and(|m| m.texture.is_some());
        let material = *materials.entry((group.material, textured, colored)).or_insert_with(|| {
            scene.materials.push(mtl::material(source, textured));
            scene.materials.len() as u32 - 1
        });
        let Group { vertices, whence, .. } = group;
        let part = Part { vertices, faces, material, attributes: textured || colored, whence };
        place(&mut scene, &mut warnings, &part, &DMat4::IDENTITY);
    }
    if scene.surfaces.is_empty() {
        return Err(SceneError::empty(scene.name, &warnings.into_list()));
    }
    for (index, mean) in crate::mesh::mean_base_colors(&scene).into_iter().enumerate() {
        let key = materials.iter().find(|(_, m)| **m as usize == index).map(|(key, _)| *key);
        if let (Some(mean), Some((material, ..))) = (mean, key) {
            let source = material.and_then(|m| reader.library.materials.get(m));
            scene.materials[index].reflector = mtl::reflector(source, mean);
        }
    }
    scene.warnings = warnings.into_list();
    Ok(scene)
}

/// The statements of a file with their line numbers, from 1: comments gone, lines ending in a backslash joined.
fn statements(text: &str) -> impl Iterator<Item = (usize, String)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let mut statement = first.to_owned();
        while statement.ends_with('\\') {
            statement.pop();
            statement.push(' ');
            statement.push_str(lines.next().map_or("", |(_, line)| line));
        }
        if let Some(comment) = statement.find('#') {
            statement.truncate(comment);
        }
        Some((number + 1, statement))
    })
}

/// A number of a statement.
fn number(word: Option<&str>, place: impl FnOnce() -> String) -> Result<f64, SceneError> {
    word.and_then(|w| w.parse().ok()).ok_or_else(|| SceneError::Syntax {
        place: place(),
        what: word.map_or("a number is missing".to_owned(), |w| format!("{} is no number", quoted(w))),
        mend: "a decimal number would be right".to_owned(),
    })
}

/// Faces that share a material and the kind of attributes that they have.
struct Group {
    vertices: Vertices,
    triangles: Vec<[u32; 3]>,
    quads: Vec<Face>,
    material: Option<usize>,
    whence: String,
}

/// What a face is grouped by: material, then whether it has texture coordinates, normals, colours.
type GroupKey = (Option<usize>, bool, bool, bool);

struct Reader<'a> {
    path: &'a Path,
    positions: Vec<DVec3>,
    colors: Vec<Option<Rgb>>,
    uv: Vec<Vec2>,
    normals: Vec<Vec3>,
    library: Library,
    material: Option<usize>,
    groups: Vec<Group>,
    index: HashMap<GroupKey, usize>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            positions: Vec::new(),
            colors: Vec::new(),
            uv: Vec::new(),
            normals: Vec::new(),
            library: Library::default(),
            material: None,
            groups: Vec::new(),
            index: HashMap::new(),
        }
    }

    fn place(&self, line: usize) -> String {
        format!("{}:{line}", self.path.display())
    }

    fn statement(&mut self, line: usize, statement: &str, warnings: &mut Warnings) -> Result<(), SceneError> {
        let mut words = statement.split_whitespace();
        let Some(keyword) = words.next() else {
            return Ok(());
        };
        let rest = statement.trim_start().strip_prefix(keyword).unwrap_or("").trim();
        match keyword {
            "v" => {
                let [x, y, z] = self.numbers(&mut words, line)?;
                let extra: Vec<&str> = words.collect();
                // Three more numbers are a colour; a single one is a weight that only curves use.
                let color = match extra[..] {
                    [r, g, b] => {
                        let mut c = [0.0_f32; 3];
                        for (c, word) in c.iter_mut().zip([r, g, b]) {
                            *c = number(Some(word), || self.place(line))? as f32;
                            *c = if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) };
                        }
                        Some(Rgb::from(c))
                    }
                    _ => None,
                };
                self.positions.push(DVec3::new(x, y, z));
                self.colors.push(color);
            }
            "vt" => {
                let u = number(words.next(), || self.place(line))?;
                let v = words.next().map_or(Ok(0.0), |w| number(Some(w), || self.place(line)))?;
                // Row 0 of an image is its top, but v goes up.
                let uv = Vec2::new(u as f32, (1.0 - v) as f32);
                self.uv.push(if uv.is_finite() { uv } else { Vec2::ZERO });
            }
            "vn" => {
                let n = self.numbers(&mut words, line)?;
                self.normals.push(Vec3::from(n.map(|c| c as f32)));
            }
            "f" => self.face(line, words, warnings)?,
            "mtllib" => {
                let base = self.path.parent().unwrap_or(Path::new(""));
                // A name may hold blanks, and several may follow: the whole line is tried first.
                let whole = base.join(rest);
                let files = if whole.is_file() { vec![whole] } else { words.map(|name| base.join(name)).collect() };
                for file in files {
                    match whole_file::read(&file) {
                        Ok(bytes) => self.library.read(&bytes, &file, warnings)?,
                        Err(e) => warnings
                            .add(format!("material library '{}' cannot be read: {e}", file.display()), || {
                                self.place(line)
                            }),
                    }
                }
            }
            "usemtl" => {
                self.material = self.library.index.get(rest).copied();
                if self.material.is_none() {
                    warnings.add(format!("there is no material '{rest}': grey is used"), || self.place(line));
                }
            }
            "curv" | "curv2" | "surf" => {
                warnings.add("free-form curves and surfaces are left out", || self.place(line));
            }
            "p" | "l" => warnings.add("points and lines are left out: they have no area", || self.place(line)),
            _ => {}
        }
        Ok(())
    }

    fn numbers<const N: usize>(&self, words: &mut SplitWhitespace, line: usize) -> Result<[f64; N], SceneError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = number(words.next(), || self.place(line))?;
        }
        Ok(values)
    }

    fn face(&mut self, line: usize, words: SplitWhitespace, warnings: &mut Warnings) -> Result<(), SceneError> {
        let corners = words.map(|w| self.corner(w, line)).collect::<Result<Vec<_>, _>>()?;
        if corners.len() < 3 {
            warnings.add("a face with fewer than three corners is left out", || self.place(line));
            return Ok(());
        }
        let has_uv = corners.iter().all(|c| c[1].is_some());
        let has_normals = corners.iter().all(|c| c[2].is_some());
        let of = |i: Option<usize>| i.unwrap_or_default();
        let has_colors = corners.iter().all(|c| self.colors[of(c[0])].is_some());
        let points: Vec<DVec3> = corners.iter().map(|c| self.positions[of(c[0])]).collect();
        let key = (self.material, has_uv, has_normals, has_colors);
        let next = self.groups.len();
        let at = *self.index.entry(key).or_insert(next);
        if at == next {
            self.groups.push(Group {
                vertices: Vertices::default(),
                triangles: Vec::new(),
                quads: Vec::new(),
                material: self.material,
                whence: self.place(line),
            });
        }
        let group = &mut self.groups[at];
        let first = group.vertices.positions.len() as u32;
        group.vertices.positions.extend(&points);
        if has_uv {
            group.vertices.uv.extend(corners.iter().map(|c| self.uv[of(c[1])]));
        }
        if has_normals {
            group.vertices.normals.extend(corners.iter().map(|c| self.normals[of(c[2])]));
        }
        if has_colors {
            group.vertices.colors.extend(corners.iter().filter_map(|c| self.colors[of(c[0])]));
        }
        let vertex = |corner: usize| first + corner as u32;
        match pieces(&points, &[]) {
            Ok(pieces) => {
                for piece in pieces {
                    match piece {
                        Piece::Triangle(corners) => group.triangles.push(corners.map(vertex)),
                        Piece::Quad(corners) => group.quads.push(Face { corners: corners.map(vertex) }),
                    }
                }
            }
            Err(error) => warnings.add(format!("face with {error}: left out"), || self.place(line)),
        }
        Ok(())
    }

    /// Indices from 0 of position, texture coordinate and normal.
    fn corner(&self, word: &str, line: usize) -> Result<[Option<usize>; 3], SceneError> {
        let counts = [self.positions.len(), self.uv.len(), self.normals.len()];
        let mut indices = [None; 3];
        for (k, part) in word.split('/').enumerate() {
            if part.is_empty() && k > 0 {
                continue;
            }
            let count = counts.get(k).copied().unwrap_or(0) as i64;
            let index = match part.parse::<i64>() {
                Ok(i) if i > 0 && i <= count => i - 1,
                Ok(i) if i < 0 && i >= -count => count + i,
                _ => {
                    let what = ["v", "vt", "vn"].get(k).copied().unwrap_or("fourth");
                    return Err(SceneError::Syntax {
                        place: self.place(line),
                        what: format!(
                            "{} has the {what} index {}, and {count} are known here",
                            quoted(word),
                            quoted(part)
                        ),
                        mend: format!("1…{count}, or -1…-{count} from the last one, would be right"),
                    });
                }
            };
            indices[k] = Some(index as usize);
        }
        Ok(indices)
    }
}
