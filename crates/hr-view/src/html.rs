//! One self-contained file that walks through a solution in any browser.
//!
//! The page shows what the window shows, by the same steps: diffuse light is a number per vertex; glossy light is
//! evaluated at the vertices from the directional distributions of the leaves around them, in a vertex shader, whenever
//! the eye has moved. Exposure, filmic curve and sRGB encoding happen per pixel with the window's own constants.
//!
//! # What is given up for the size and for speed
//! - Round surfaces have fewer triangles: chords of 14°, or of 45° within 3 mm in a room of 10 m.
//! - Distributions are coarsened until few enough values are left, and quantised (module `directions`).
//! - Positions are rounded to a millionth of the scene's size, colours to 9 bits, normals to 0.004°, the weights of
//!   the distributions around a vertex to 1/255.
//! - Without a graphics card edges are not smoothed, and while the eye moves only those glossy vertices are evaluated
//!   whose direction has changed most; the others follow as soon as it rests.
//!
//! Pictures of the page and of the ray caster differ by 0.2 to 0.4 % on average outside silhouettes; the browser test
//! keeps that below 1.5 %. A soda shop of 1,727 surfaces at the default error takes 4.4 MB; in Chromium with its
//! software rasteriser on two cores it is there in 1.2 to 1.5 s and shows 21 to 29 frames a second at 1280 × 720.
//!
//! # Layout
//! After the viewer comes one script element with base64 text of a gzip file (whose checksum tells a damaged page from a
//! sound one): a JSON header and sections of bytes, which the viewer turns into vertex buffers and textures.

mod colors;
mod directions;
mod images;
mod leaves;
mod payload;
mod vertices;

use crate::ViewError;
use crate::display::{DisplayMesh, up_of};
use crate::facets::{Facets, Roundness, Source, facets};
use crate::glossy::Mode;
use crate::metering;
use crate::solved::Solved;
use crate::window::lists::split;
use crate::window::tone::BRIGHTEST;
use crate::window::{Curve, Tone};
use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use flate2::Compression;
use flate2::write::GzEncoder;
use hr_scene::Camera;
use hr_scene::whole_file::write_whole;
use payload::Payload;
use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;
use vertices::Lattice;

/// How round surfaces are: 14°, or 45° within 3 mm in a room of 10 m.
const ROUNDNESS: Roundness = Roundness { fine: 0.25, flat_enough: 3e-4, coarse: 0.8, glossy: 0.8 };

/// What the page's script reads first.
#[derive(Serialize)]
struct Facts<'a> {
    name: &'a str,
    cameras: &'a [(String, Camera)],
    /// What each of them needs beside the first one's exposure.
    exposures: Vec<f32>,
    up: [f64; 3],
    /// How far it is across what one walks through.
    extent: f64,
    origin: [f64; 3],
    lattice: Lattice,
    to_srgb: [f32; 9],
    curve: [f32; 6],
    brightest: f32,
    lists: [vertices::List; 2],
    textures: Vec<images::Picture>,
    floor: f32,
    growth: f32,
    most: i32,
    max_level: u8,
}

/// Writes the page of a solution whose distributions have been made, whole or not at all.
///
/// # Errors
/// [`ViewError::Scene`] with `path` where it cannot be written.
pub fn write(solved: &Solved, path: &Path) -> Result<(), ViewError> {
    let Facets { mut mesh, sources, .. } = facets(&solved.scene, &solved.solution, ROUNDNESS);
    vertices::gather(&mut mesh);
    Ok(write_whole(path, |out| page(solved, &mesh, &sources, out))?)
}

/// The viewer with the solution in it.
fn page(solved: &Solved, mesh: &DisplayMesh, sources: &[Source], out: &mut impl Write) -> io::Result<()> {
    const PAGE: &str = include_str!("html/viewer.html");
    let parts = [
        ("<!-- style -->", include_str!("html/viewer.css")),
        ("<!-- glossy vertex -->", include_str!("html/glossy.vert")),
        ("<!-- scene vertex -->", include_str!("html/scene.vert")),
        ("<!-- scene fragment -->", include_str!("html/scene.frag")),
        ("<!-- unpack -->", include_str!("html/unpack.js")),
        ("<!-- walker -->", include_str!("html/walker.js")),
        ("<!-- picture -->", include_str!("html/picture.js")),
        ("<!-- viewer -->", include_str!("html/viewer.js")),
    ];
    let page = parts.iter().fold(PAGE.to_owned(), |page, (place, text)| page.replacen(place, text, 1));
    let (before, after) = page.split_once("<!-- solution -->").unwrap_or((&page, ""));
    out.write_all(before.as_bytes())?;
    let mut base64 = EncoderWriter::new(&mut *out, &STANDARD);
    let mut gzip = GzEncoder::new(&mut base64, Compression::best());
    solution(solved, mesh, sources, &mut gzip)?;
    gzip.finish()?;
    base64.finish()?;
    drop(base64);
    out.write_all(after.as_bytes())
}

/// Header and sections.
fn solution(solved: &Solved, mesh: &DisplayMesh, sources: &[Source], out: &mut impl Write) -> io::Result<()> {
    let cameras = &solved.scene.cameras;
    let of_mesh = Tone::for_mesh(mesh);
    let metered = |camera: &Camera| metering::exposure(solved, Mode::Distributions, &[*camera]);
    let exposures: Vec<_> = cameras.iter().map(|(_, camera)| metered(camera).unwrap_or(of_mesh.exposure)).collect();
    let tone = Tone { exposure: exposures.first().copied().unwrap_or(of_mesh.exposure), ..of_mesh };
    let Curve { numerator: [a, b], denominator: [c, d, e] } = tone.curve;
    let lists = split(mesh, &[]);
    let lattice = Lattice::of(mesh);
    let mut payload = Payload::default();
    let names = ["diffuse", "glossy"];
    let lists_facts = [0, 1].map(|i| vertices::add(&mut payload, names[i], mesh, &lists[i], &lattice, tone.exposure));
    leaves::add(&mut payload, solved, mesh, sources, &lists[1], &lattice, tone.exposure);
    let textures = mesh.textures.iter().enumerate().map(|(i, texture)| images::add(&mut payload, i, texture));
    let facts = Facts {
        name: &solved.scene.name,
        cameras,
        exposures: exposures.iter().map(|exposure| exposure / tone.exposure).collect(),
        up: up_of(&solved.scene.cameras).to_array(),
        extent: solved.scene.extent(),
        origin: mesh.origin.to_array(),
        lattice,
        to_srgb: tone.to_srgb.to_cols_array(),
        curve: [a, b, c, d, e, tone.curve.white()],
        brightest: BRIGHTEST,
        lists: lists_facts,
        textures: textures.collect::<io::Result<_>>()?,
        floor: directions::FLOOR,
        growth: directions::GROWTH,
        most: directions::MOST,
        max_level: directions::MAX_LEVEL,
    };
    payload.write(&facts, out)
}
