//! A plot with logarithmic axes, as SVG.

/// Size of the picture, and of the margins on the left, on the right, above and below, in pixels.
const SIZE: [f64; 2] = [900.0, 600.0];
const MARGINS: [f64; 4] = [80.0, 250.0, 30.0, 60.0];
/// Of successive lines: blue, orange, green, red, purple, brown, olive, cyan.
const COLORS: [&str; 8] = ["#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#bcbd22", "#17becf"];

/// A line with marks on its points.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// For the legend.
    pub name: String,
    /// Points; those without a logarithm are left out.
    pub points: Vec<[f64; 2]>,
    /// Dashed: the same thing by another measure.
    pub dashed: bool,
    /// Number of its colour.
    pub color: usize,
}

/// Both axes logarithmic, their ends at powers of ten.
#[must_use]
pub fn svg(title: &str, axes: [&str; 2], lines: &[Line]) -> String {
    let logarithms = |line: &Line| -> Vec<[f64; 2]> {
        let points = line.points.iter().map(|p| p.map(f64::log10));
        points.filter(|p| p.iter().all(|v| v.is_finite())).collect()
    };
    let lines: Vec<(&Line, Vec<[f64; 2]>)> = lines.iter().map(|line| (line, logarithms(line))).collect();
    let ends = [0, 1].map(|axis| {
        let all = || lines.iter().flat_map(|(_, points)| points).map(|p| p[axis]);
        let low = all().fold(f64::INFINITY, f64::min).floor();
        let high = all().fold(f64::NEG_INFINITY, f64::max).ceil();
        if low.is_finite() { [low, high.max(low + 1.0)] } else { [0.0, 1.0] }
    });
    let [left, right, top, bottom] = [MARGINS[0], SIZE[0] - MARGINS[1], MARGINS[2], SIZE[1] - MARGINS[3]];
    let x = |v: f64| left + (right - left) * (v - ends[0][0]) / (ends[0][1] - ends[0][0]);
    let y = |v: f64| bottom - (bottom - top) * (v - ends[1][0]) / (ends[1][1] - ends[1][0]);
    let mut out = String::new();
    let mut add = |text: String| out.extend([text.as_str(), "\n"]);
    let [width, height] = SIZE;
    add(format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">"#
    ));
    add(format!(r#"<rect width="{width}" height="{height}" fill="white"/>"#));
    add(text([0.5 * (left + right), 20.0], "middle", title));
    add(text([0.5 * (left + right), height - 15.0], "middle", axes[0]));
    add(text([10.0, top - 10.0], "start", axes[1]));
    for (axis, &[low, high]) in ends.iter().enumerate() {
        for decade in low as i32..=high as i32 {
            for step in 1..10 {
                let value = f64::from(decade) + f64::from(step).log10();
                if value > high {
                    continue;
                }
                let at = if axis == 0 { x(value) } else { y(value) };
                let shade = if step == 1 { "#999" } else { "#e4e4e4" };
                let [x1, y1, x2, y2] = if axis == 0 { [at, top, at, bottom] } else { [left, at, right, at] };
                add(format!(r#"<path d="M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}" stroke="{shade}"/>"#));
                let label = 10_f64.powi(decade).to_string();
                match (step, axis) {
                    (1, 0) => add(text([at, bottom + 18.0], "middle", &label)),
                    (1, _) => add(text([left - 6.0, at + 4.0], "end", &label)),
                    _ => (),
                }
            }
        }
    }
    for (i, (line, points)) in lines.iter().enumerate() {
        let color = COLORS[line.color % COLORS.len()];
        let dashes = if line.dashed { r#" stroke-dasharray="6 4""# } else { "" };
        let style = format!(r#"stroke="{color}" stroke-width="2" fill="none"{dashes}"#);
        let path: Vec<String> = points.iter().map(|p| format!("{:.1} {:.1}", x(p[0]), y(p[1]))).collect();
        if !path.is_empty() {
            add(format!(r#"<path d="M{}" {style}/>"#, path.join("L")));
        }
        for p in points {
            add(format!(r#"<circle cx="{:.1}" cy="{:.1}" r="3.5" fill="{color}"/>"#, x(p[0]), y(p[1])));
        }
        let row = top + 10.0 + 20.0 * i as f64;
        add(format!(r#"<path d="M{} {row}h28" {style}/>"#, right + 12.0));
        add(text([right + 46.0, row + 4.0], "start", &line.name));
    }
    add("</svg>".into());
    out
}

fn text(at: [f64; 2], anchor: &str, words: &str) -> String {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    format!(r#"<text x="{:.1}" y="{:.1}" text-anchor="{anchor}">{words}</text>"#, at[0], at[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_where_they_belong() {
        let line =
            Line { name: "a < b".into(), points: vec![[0.1, 1.0], [10.0, 0.01], [1.0, 0.0]], dashed: true, color: 9 };
        let made = svg("t", ["x", "y"], &[line]);
        assert!(made.contains(r##"d="M80.0 30.0L650.0 540.0" stroke="#ff7f0e""##), "from corner to corner: {made}");
        assert_eq!(made.matches("<circle").count(), 2, "0 has no logarithm");
        assert!(made.contains("a &lt; b") && made.contains("stroke-dasharray"), "{made}");
        assert!(svg("", ["", ""], &[]).ends_with("</svg>\n"), "an empty plot");
    }
}
