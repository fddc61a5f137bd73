//! Elements as lines of text.

use crate::solved::Solved;
use hr_diffuse::hierarchy::Kind;
use std::io::{self, Write};

/// Writes the table.
pub(super) fn write(solved: &Solved, out: &mut impl Write) -> io::Result<()> {
    let vectors = [("irradiance", "W/m²"), ("radiosity", "W/m²"), ("glossy exitance", "W/m²")];
    write!(out, "surface,side,material,x [m],y [m],z [m],normal x,normal y,normal z,area [m²]")?;
    for (name, unit) in vectors {
        for channel in ["R", "G", "B"] {
            write!(out, ",{name} {channel} [{unit}]")?;
        }
    }
    writeln!(out)?;
    let (scene, solution) = (&solved.scene, &solved.solution);
    let (exitant, normalization) = (&solution.exitant, &solution.scene.normalization);
    for leaf in solution.elements.patch_leaves() {
        let element = &solution.elements.nodes[leaf as usize];
        let side = if element.kind == Kind::Back { "back" } else { "front" };
        let material = quoted(&scene.materials[element.material as usize].name);
        let ([x, y, z], normal) = (normalization.to_scene(element.center).to_array(), element.normals.axis);
        let area = f64::from(element.area) / normalization.scale().powi(2);
        write!(out, "{},{side},{material},{x},{y},{z},{},{},{},{area}", element.source, normal.x, normal.y, normal.z)?;
        for light in [&exitant.irradiance, &exitant.radiosity, &exitant.directional] {
            let [r, g, b] = light[leaf as usize].to_array();
            write!(out, ",{r},{g},{b}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A text as a field of the table (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_one_field() {
        assert_eq!(quoted("wall"), "wall", "as it is");
        assert_eq!(quoted("wall, \"red\""), "\"wall, \"\"red\"\"\"", "quoted");
    }
}
