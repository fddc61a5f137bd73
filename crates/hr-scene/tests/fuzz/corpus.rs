//! What is mutated: a small scene of each format, with all that the format has.

use image::{ImageFormat, Rgb, RgbImage};
use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

const ROOM_MGF: &[u8] = include_bytes!("corpus/room.mgf");
const LAMP_MGF: &[u8] = include_bytes!("corpus/lamp.mgf");
const ROOM_OBJ: &[u8] = include_bytes!("corpus/room.obj");
const ROOM_MTL: &[u8] = include_bytes!("corpus/room.mtl");
const ROOM_GLTF: &str = include_str!("corpus/room.gltf");
const CAMERA: &[u8] = include_bytes!("corpus/camera.json");

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Mgf,
    Obj,
    Gltf,
    Glb,
    Camera,
}

/// A folder with a scene's files, removed at the end.
pub(crate) struct Folder {
    at: PathBuf,
    /// Names and contents; the scene's own comes last.
    files: Vec<(String, Vec<u8>)>,
}

impl Folder {
    pub(crate) fn new(kind: Kind) -> Self {
        let at = std::env::temp_dir().join(format!("hr-scene-fuzz-{kind:?}-{}", std::process::id()));
        fs::create_dir_all(&at).expect("the system's temporary folder can be written to");
        let file = |name: &str, bytes: &[u8]| (name.to_owned(), bytes.to_owned());
        let png = file("image.png", &picture(ImageFormat::Png));
        let files = match kind {
            Kind::Mgf => vec![file("lamp.mgf", LAMP_MGF), file("room.mgf", ROOM_MGF)],
            Kind::Obj => {
                let jpeg = file("image.jpg", &picture(ImageFormat::Jpeg));
                vec![png, jpeg, file("room.mtl", ROOM_MTL), file("room.obj", ROOM_OBJ)]
            }
            Kind::Gltf => vec![png, file("room.bin", &buffer()), file("room.gltf", ROOM_GLTF.as_bytes())],
            Kind::Glb => vec![png, file("room.glb", &glb())],
            Kind::Camera => vec![file("camera.json", CAMERA)],
        };
        let folder = Self { at, files };
        for (name, bytes) in &folder.files {
            folder.write(name, bytes);
        }
        folder
    }

    pub(crate) fn files(&self) -> &[(String, Vec<u8>)] {
        &self.files
    }

    /// The scene's own file.
    pub(crate) fn main(&self) -> PathBuf {
        self.at.join(&self.files[self.files.len() - 1].0)
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.at.join(name), bytes).expect("the folder is ours");
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Nothing is lost where it stays.
        let _ = fs::remove_dir_all(&self.at);
    }
}

fn picture(format: ImageFormat) -> Vec<u8> {
    let image = RgbImage::from_fn(8, 4, |x, y| Rgb([32 * x as u8, 64 * y as u8, 99]));
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("it can be written to memory");
    bytes.into_inner()
}

/// The buffer of the glTF scene: a square's positions, normals, texture coordinates and indices, and one that is moved.
fn buffer() -> Vec<u8> {
    let square: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut floats: Vec<f32> = square.iter().flat_map(|[x, y]| [*x, *y, 0.0]).collect();
    floats.extend([[0.1_f32, 0.0, 1.0]; 4].as_flattened());
    floats.extend(square.as_flattened());
    let mut bytes: Vec<u8> = floats.into_iter().flat_map(f32::to_le_bytes).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].into_iter().flat_map(u16::to_le_bytes));
    bytes.extend([2, 0, 0, 0]);
    bytes.extend([0.5_f32, 0.5, 0.5].into_iter().flat_map(f32::to_le_bytes));
    bytes
}

/// The glTF scene in one file (glTF 2.0, section 4.4): a header, the document, the buffer.
fn glb() -> Vec<u8> {
    let mut json = ROOM_GLTF.replace(r#", "uri": "room.bin""#, "").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes()[..], kind, data].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &buffer())].concat();
    let length = (12 + chunks.len()) as u32;
    [b"glTF", &2_u32.to_le_bytes()[..], &length.to_le_bytes(), &chunks].concat()
}
