//! From bytes to a checked document with its buffers, and typed errors for whatever is wrong on the way.

use crate::SceneError;
use crate::error::quoted;
use crate::whole_file::read;
use gltf::json::validation::{Error as Fault, Validate};
use gltf::json::{self, Root};
use std::path::{Path, PathBuf};

/// Extensions that are understood.
const SUPPORTED: [&str; 4] =
    ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_mesh_quantization", "KHR_texture_transform"];

/// A document whose indices all lie in range, and its buffers.
pub(super) struct Document {
    pub(super) root: Root,
    pub(super) buffers: Vec<Vec<u8>>,
    path: PathBuf,
}

/// JSON text and binary chunk.
type Chunks<'a> = (std::borrow::Cow<'a, [u8]>, Option<Vec<u8>>);

/// The part of a document that is looked at before the rest is expected to make sense.
#[derive(serde::Deserialize)]
struct Preamble {
    asset: Option<Asset>,
    #[serde(default, rename = "extensionsRequired")]
    extensions_required: Vec<String>,
}

#[derive(serde::Deserialize)]
struct Asset {
    version: Option<String>,
}

impl Document {
    /// Parses and checks a .gltf or .glb file that lies at `path`, and reads its buffers.
    pub(super) fn new(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        let mut this = Self { root: Root::default(), buffers: Vec::new(), path: path.to_owned() };
        let (text, mut blob) = this.split(bytes)?;
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
        let preamble: Preamble = serde_json::from_slice(text).map_err(|e| this.no_json(&e))?;
        let version = preamble.asset.and_then(|asset| asset.version);
        if let Some(version) = version.filter(|version| !version.starts_with("2.")) {
            return Err(this.wrong(
                "asset.version",
                format!("the file is glTF {}", quoted(&version)),
                "export it anew as glTF 2.0",
            ));
        }
        for (i, name) in preamble.extensions_required.iter().enumerate() {
            if !SUPPORTED.contains(&name.as_str()) {
                return Err(this.wrong(
                    &format!("extensionsRequired[{i}]"),
                    format!("the file cannot be read without the extension {name}"),
                    mend_extension(name),
                ));
            }
        }
        this.root = Root::from_slice(text).map_err(|e| this.no_json(&e))?;
        this.root.extensions_required.clear();
        this.validate()?;
        for index in 0..this.root.buffers.len() {
            let data = this.buffer(index, &mut blob)?;
            this.buffers.push(data);
        }
        Ok(this)
    }

    /// Takes a .glb container apart; anything else is all text.
    fn split<'a>(&self, bytes: &'a [u8]) -> Result<Chunks<'a>, SceneError> {
        if !bytes.starts_with(b"glTF") {
            return Ok((bytes.into(), None));
        }
        let length = bytes.get(8..12).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes) as usize;
        // Shorter than its own header, a length would make the parser below subtract past zero.
        let content = bytes.get(..length).filter(|_| length >= 12).ok_or_else(|| {
            self.wrong(
                "header",
                format!("it gives a length of {length} bytes but the file has {}", bytes.len()),
                "copy or export the file anew, whole",
            )
        })?;
        let glb = gltf::Glb::from_slice(content).map_err(|e| {
            self.wrong("header", format!("the binary container is damaged ({e})"), "export the file anew as glTF 2.0")
        })?;
        Ok((glb.json, glb.bin.map(std::borrow::Cow::into_owned)))
    }

    /// The checks of the gltf crate, less those that only matter to others.
    fn validate(&mut self) -> Result<(), SceneError> {
        // The validator looks these accessors up unchecked, and asks for bounds that are not used here.
        for (m, mesh) in self.root.meshes.iter().enumerate() {
            for (p, primitive) in mesh.primitives.iter().enumerate() {
                for (semantic, accessor) in &primitive.attributes {
                    let count = self.root.accessors.len();
                    if accessor.value() >= count {
                        let name = match semantic {
                            json::validation::Checked::Valid(name) => name.to_string(),
                            json::validation::Checked::Invalid => "?".to_owned(),
                        };
                        return Err(self.wrong(
                            &format!("meshes[{m}].primitives[{p}].attributes.{name}"),
                            format!("there is no accessor {accessor}"),
                            format!("an index below {count} would be right"),
                        ));
                    }
                }
            }
        }
        let mut faults = Vec::new();
        self.root.validate(&self.root, json::Path::new, &mut |path, fault| {
            let path = path().to_string();
            // Where extensions bring images of other kinds, textures may have none of their own.
            let unused = path.ends_with("[\"POSITION\"]")
                || path.ends_with("[\"POSITION\"].min")
                || path.ends_with("[\"POSITION\"].max")
                || path.starts_with("textures[") && path.ends_with(".source");
            if !(unused && matches!(fault, Fault::Missing)) {
                faults.push((path, fault));
            }
        });
        let Some((path, fault)) = faults.first() else {
            return Ok(());
        };
        let (what, mend) = match fault {
            Fault::IndexOutOfBounds => ("the index is out of range", "the index of a present item would be right"),
            Fault::Missing => ("required data is missing", "add it or export the file anew"),
            Fault::Oversize => ("the number is too large", "export the file anew"),
            _ => ("the value is not one that glTF 2.0 allows", "see the glTF 2.0 specification for what it does"),
        };
        let more = match faults.len() - 1 {
            0 => String::new(),
            n => format!(" ({n} more faults follow)"),
        };
        Err(self.wrong(&path.replace("[\"", ".").replace("\"]", ""), format!("{what}{more}"), mend))
    }

    fn buffer(&self, index: usize, blob: &mut Option<Vec<u8>>) -> Result<Vec<u8>, SceneError> {
        let buffer = &self.root.buffers[index];
        let place = format!("buffers[{index}]");
        let data = match &buffer.uri {
            Some(uri) => self.read_uri(uri, &format!("{place}.uri"))?,
            None => blob.take().filter(|_| index == 0).ok_or_else(|| {
                self.wrong(&place, "it has neither a uri nor the file's binary chunk", "give it a uri")
            })?,
        };
        if (data.len() as u64) < buffer.byte_length.0 {
            return Err(self.wrong(
                &format!("{place}.byteLength"),
                format!("it says {} bytes but the data has only {}", buffer.byte_length.0, data.len()),
                "the data is cut off: copy or export the file anew, whole",
            ));
        }
        Ok(data)
    }

    /// The bytes behind a data or file URI.
    pub(super) fn read_uri(&self, uri: &str, place: &str) -> Result<Vec<u8>, SceneError> {
        if uri.starts_with("data:") {
            let data = gltf::buffer::Data::from_source(gltf::buffer::Source::Uri(uri), None);
            return data.map(|data| data.0).map_err(|e| {
                self.wrong(place, format!("the data URI cannot be decoded ({e})"), "base64 would be right")
            });
        }
        let relative =
            percent_decoded(uri).filter(|name| !name.contains(':') && !name.is_empty()).ok_or_else(|| {
                self.wrong(
                    place,
                    format!("{} is no relative file name", quoted(uri)),
                    "embed the data or lay the file beside",
                )
            })?;
        let path = self.path.parent().unwrap_or(Path::new("")).join(relative);
        read(&path).map_err(|e| {
            self.wrong(
                place,
                format!("{} cannot be read ({e})", path.display()),
                "lay that file beside this one, or export all in one as .glb",
            )
        })
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize, place: &str) -> Result<&[u8], SceneError> {
        let view = &self.root.buffer_views[index];
        let offset = view.byte_offset.map_or(0, |o| o.0);
        let data = &self.buffers[view.buffer.value()];
        let end = offset.checked_add(view.byte_length.0).filter(|end| *end <= data.len() as u64);
        end.map(|end| &data[offset as usize..end as usize]).ok_or_else(|| {
            self.wrong(
                place,
                format!(
                    "bufferViews[{index}] covers {} bytes from {offset} on but buffers[{}] has only {}",
                    view.byte_length.0,
                    view.buffer.value(),
                    data.len()
                ),
                "a view that lies inside its buffer would be right",
            )
        })
    }

    /// Names of extensions that the file uses, does not require, and that are not understood.
    pub(super) fn ignored_extensions(&self) -> impl Iterator<Item = &str> {
        self.root.extensions_used.iter().map(String::as_str).filter(|name| !SUPPORTED.contains(name))
    }

    /// An error at a JSON path.
    pub(super) fn wrong(&self, place: &str, what: impl Into<String>, mend: impl Into<String>) -> SceneError {
        SceneError::Syntax { place: format!("{}: {place}", self.path.display()), what: what.into(), mend: mend.into() }
    }

    fn no_json(&self, error: &serde_json::Error) -> SceneError {
        self.wrong(
            &format!("line {}, column {}", error.line(), error.column()),
            format!("not a glTF 2.0 document ({error})"),
            "a .gltf or .glb file of glTF 2.0 would be right",
        )
    }
}

fn mend_extension(name: &str) -> String {
    match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export the file without mesh compression".to_owned()
        }
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
            "export its textures as PNG or JPEG".to_owned()
        }
        "EXT_mesh_gpu_instancing" => "export each instance as a node".to_owned(),
        _ => format!("export the file without {name}; supported: {}", SUPPORTED.join(", ")),
    }
}

/// %41 to A; `None` where that gives no text.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let hex = (first == b'%').then(|| tail.get(..2)).flatten();
        let code = hex.and_then(|h| std::str::from_utf8(h).ok()).and_then(|h| u8::from_str_radix(h, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8(bytes).ok()
}
