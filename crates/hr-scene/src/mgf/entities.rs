//! Colours, properties of materials, and geometry: what their arguments mean, and what is wrong with them.

use super::color::Chromaticity;
use super::fault::{Fault, count, counted, exactly, fault, number, numbers};
use super::geometry::{Sink, Vertex};
use super::lexer::File;
use super::material::Tint;
use super::reader::Reader;
use crate::error::quoted;
use glam::DVec3;

/// Most corners of a polygon: more than fit into the 4096 characters that MGF allows a line to have.
const MAX_CORNERS: usize = 4096;

/// Cutting a polygon takes at worst the cube of its corners; that cube over this is charged as words.
const CUTTING_COST: u64 = 1 << 16;

/// The largest exitance in W/m²; the sun's surface has 6.3e7, and RGB values must fit single precision.
const MAX_EXITANCE: f64 = 1e30;

impl Reader<'_> {
    pub(super) fn color(&mut self, keyword: &str, words: &[&str]) -> Result<(), Fault> {
        let color = match keyword {
            "cxy" => {
                let [x, y] = numbers(words, "cxy x y")?;
                if x < 0.0 || y < 0.0 || x + y > 1.0 + 1e-6 {
                    return fault(
                        format!("({x}, {y}) is no chromaticity"),
                        "give CIE 1931 coordinates x, y ≥ 0 with x + y ≤ 1, such as 0.333 0.333 for white",
                    );
                }
                Chromaticity::new(x, y)
            }
            "cct" => {
                let [kelvin] = numbers(words, "cct temperature")?;
                if kelvin <= 0.0 {
                    return fault(
                        format!("a black body of {kelvin} K"),
                        "give a temperature above 0 K, such as 6500 for daylight",
                    );
                }
                Chromaticity::from_temperature(kelvin)
            }
            "cspec" => spectrum(words)?,
            _ => self.mixture(words)?,
        };
        if color.is_none() {
            self.warn(format!("colour without luminance ({keyword}): neutral taken instead"));
        }
        *self.colors.current_mut() = color.unwrap_or_default();
        Ok(())
    }

    fn mixture(&self, words: &[&str]) -> Result<Option<Chromaticity>, Fault> {
        const USAGE: &str = "write `cmix weight1 colour1 weight2 colour2 …` with weights ≥ 0";
        let (pairs, rest) = words.as_chunks::<2>();
        if pairs.is_empty() || !rest.is_empty() {
            return fault("a mixture needs pairs of weight and colour", USAGE);
        }
        let mut parts = Vec::with_capacity(pairs.len());
        for [weight, name] in pairs {
            let weight = number(weight)?;
            if weight < 0.0 {
                return fault(format!("weight {weight} is negative"), USAGE);
            }
            parts.push((weight, *self.colors.get(name)?));
        }
        Ok(Chromaticity::from_mixture(&parts))
    }

    pub(super) fn property(&mut self, keyword: &str, words: &[&str]) -> Result<(), Fault> {
        self.material = None;
        let color = *self.colors.current();
        let definition = self.definitions.current_mut();
        match keyword {
            "rd" => {
                let [amount] = numbers(words, "rd reflectance")?;
                definition.diffuse = Tint { amount: share(keyword, amount)?, color };
            }
            "td" => {
                let [amount] = numbers(words, "td transmittance")?;
                definition.transmitted[0] = share(keyword, amount)?;
            }
            "rs" | "ts" => {
                let [amount, roughness] = numbers(words, &format!("{keyword} amount roughness"))?;
                let amount = share(keyword, amount)?;
                if !(0.0..=1.0).contains(&roughness) {
                    return fault(
                        format!("{keyword} with a roughness of {roughness}"),
                        "the roughness is the RMS facet slope, from 0 (a mirror) to 1; polished surfaces have 0.01 to \
                         0.2",
                    );
                }
                if keyword == "rs" {
                    definition.specular = Tint { amount, color };
                    definition.roughness = roughness;
                } else {
                    definition.transmitted[1] = amount;
                }
            }
            "ed" => {
                let [amount] = numbers(words, "ed exitance")?;
                if !(0.0..=MAX_EXITANCE).contains(&amount) {
                    return fault(
                        format!("an exitance of {amount} W/m²"),
                        format!("ed is from 0 to {MAX_EXITANCE:e} W/m²"),
                    );
                }
                definition.exitance = Tint { amount, color };
            }
            "ir" => {
                numbers::<2>(words, "ir n_real n_imaginary")?;
            }
            _ => {
                let [sides] = exactly(words, "sides count")?;
                definition.two_sided = match count(sides) {
                    Ok(1) => false,
                    Ok(2) => true,
                    _ => {
                        return fault(
                            format!("a surface with {} sides", quoted(sides)),
                            "write `sides 1` (the back absorbs) or `sides 2` (both sides reflect)",
                        );
                    }
                };
            }
        }
        Ok(())
    }

    /// The index of the current material.
    fn material(&mut self) -> u32 {
        if let Some(index) = self.material {
            return index;
        }
        let definition = self.definitions.current();
        let name = self.definitions.current_name();
        let key = (name.to_owned(), definition.key());
        let index = match self.known_materials.get(&key) {
            Some(&index) => index,
            None => {
                let place = self.place();
                let material = definition.finish(name, &place, &mut self.warnings);
                // The limit on executed words keeps this far below 2^32.
                let index = u32::try_from(self.materials.len()).unwrap_or(u32::MAX);
                self.materials.push(material);
                self.known_materials.insert(key, index);
                index
            }
        };
        self.material = Some(index);
        index
    }

    pub(super) fn geometry(&mut self, file: &File, statement: usize, words: &[&str]) -> Result<(), Fault> {
        match file.keyword(statement) {
            "f" => {
                let corners = self.corners(words, "f v1 v2 v3 …")?;
                self.sink(file, statement).face(&corners, &[]);
            }
            "fh" => {
                let (corners, holes) = self.loops(words)?;
                self.sink(file, statement).face(&corners, &holes);
            }
            "sph" => {
                let [center, radius] = exactly(words, "sph center radius")?;
                let (center, radius) = (self.vertex(center)?, number(radius)?);
                self.sink(file, statement).sphere(center, radius);
            }
            "cyl" => {
                let [v1, radius, v2] = exactly(words, "cyl v1 radius v2")?;
                let (ends, radius) = ([self.vertex(v1)?, self.vertex(v2)?], number(radius)?);
                self.sink(file, statement).cone(ends, [radius; 2])?;
            }
            "cone" => {
                let [v1, r1, v2, r2] = exactly(words, "cone v1 radius1 v2 radius2")?;
                let (ends, radii) = ([self.vertex(v1)?, self.vertex(v2)?], [number(r1)?, number(r2)?]);
                self.sink(file, statement).cone(ends, radii)?;
            }
            "ring" => {
                let (center, [inner, outer]) = self.axis(words, "ring center inner_radius outer_radius")?;
                self.sink(file, statement).ring(center, inner, outer)?;
            }
            "torus" => {
                let (center, [inner, outer]) = self.axis(words, "torus center inner_radius outer_radius")?;
                self.sink(file, statement).torus(center, inner, outer)?;
            }
            _ => {
                const USAGE: &str = "prism v1 v2 v3 … length";
                let Some((length, names)) = words.split_last() else {
                    return fault("a prism without vertices", format!("write `{USAGE}`"));
                };
                let (corners, length) = (self.corners(names, USAGE)?, number(length)?);
                self.sink(file, statement).prism(&corners, length);
            }
        }
        Ok(())
    }

    fn sink<'a>(&'a mut self, file: &'a File, statement: usize) -> Sink<'a> {
        let (matrix, material) = (self.matrix(), self.material());
        Sink { matrix, material, file, statement, surfaces: &mut self.surfaces, warnings: &mut self.warnings }
    }

    fn vertex(&self, name: &str) -> Result<Vertex, Fault> {
        self.vertices.get(name).copied()
    }

    /// Three or more vertices.
    fn corners(&mut self, names: &[&str], usage: &str) -> Result<Vec<Vertex>, Fault> {
        if names.len() < 3 {
            return fault(
                format!("a polygon of {} where three or more belong", counted(names.len(), "name")),
                format!("write `{usage}`"),
            );
        }
        self.charge_polygon(names.len())?;
        names.iter().map(|name| self.vertex(name)).collect()
    }

    /// The outline and the holes of an `fh`, and where each hole begins.
    fn loops(&mut self, words: &[&str]) -> Result<(Vec<Vertex>, Vec<usize>), Fault> {
        let (mut corners, mut holes) = (Vec::new(), Vec::new());
        for (k, names) in words.split(|&word| word == "-").enumerate() {
            if k > 0 {
                holes.push(corners.len());
            }
            corners.extend(self.corners(names, "fh v1 v2 v3 … - h1 h2 h3 … - …")?);
        }
        if !holes.is_empty() {
            self.charge_polygon(corners.len())?;
        }
        Ok((corners, holes))
    }

    fn charge_polygon(&mut self, corners: usize) -> Result<(), Fault> {
        if corners > MAX_CORNERS {
            return fault(
                format!("a polygon of {corners} corners, where at most {MAX_CORNERS} are allowed"),
                "split it into several",
            );
        }
        let corners = corners as u64;
        self.charge(corners * corners * corners / CUTTING_COST)
    }

    /// A vertex that needs a normal, and two radii.
    fn axis(&self, words: &[&str], usage: &str) -> Result<(Vertex, [f64; 2]), Fault> {
        let [name, inner, outer] = exactly(words, usage)?;
        let center = self.vertex(name)?;
        if center.normal == DVec3::ZERO {
            return fault(
                format!("vertex {} has no normal", quoted(name)),
                "give the axis with `n dx dy dz` after the vertex's `p`",
            );
        }
        Ok((center, [number(inner)?, number(outer)?]))
    }
}

/// A share of the light.
fn share(keyword: &str, amount: f64) -> Result<f64, Fault> {
    if !(0.0..=1.0).contains(&amount) {
        return fault(format!("{keyword} of {amount}"), "it is a share of the light, from 0 to 1");
    }
    Ok(amount)
}

fn spectrum(words: &[&str]) -> Result<Option<Chromaticity>, Fault> {
    const USAGE: &str = "write `cspec first_nm last_nm value1 value2 …` with two or more values";
    let mut values = Vec::with_capacity(words.len());
    for word in words {
        values.push(number(word)?);
    }
    let [first, last, ref values @ ..] = values[..] else {
        return fault("a spectrum without its wavelengths", USAGE);
    };
    if values.len() < 2 {
        return fault(format!("a spectrum of {}", counted(values.len(), "value")), USAGE);
    }
    if first >= last {
        return fault(format!("a spectrum from {first} nm to {last} nm"), "the shorter wavelength comes first");
    }
    Ok(Chromaticity::from_spectrum(first, last, values))
}
