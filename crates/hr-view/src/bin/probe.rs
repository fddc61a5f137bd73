#![allow(missing_docs, clippy::print_stdout)]
use hr_scene::*; use hr_view::*; use std::sync::Arc; use std::ops::ControlFlow;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Arc::new(Scene::load(&a[1]).unwrap());
    let s = solved::Solved::new(scene.clone(), hr_diffuse::Settings { error: a[2].parse().unwrap() }, false, &mut { let t = std::time::Instant::now(); move |_: &hr_diffuse::Progress| if t.elapsed().as_secs_f64() > std::env::var("TB").map_or(1e9, |v| v.parse().unwrap()) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) } }).unwrap();
    if std::env::var("HOT").is_ok() { let sol = &s.solution; let mut l: Vec<u32> = sol.elements.patch_leaves().collect(); l.sort_by(|a, b| sol.exitant.irradiance[*b as usize].element_sum().total_cmp(&sol.exitant.irradiance[*a as usize].element_sum())); for &n in &l[..12] { let e = &sol.elements.nodes[n as usize]; println!("HOT node {n} {:?} surface {} {:?} mat {} center {} r {} E {} B {} flat {} meann {} peak {} links {}", e.kind, e.source, scene.surfaces[e.source as usize].shape, scene.materials[e.material as usize].name, e.center, e.radius, sol.exitant.irradiance[n as usize], sol.exitant.radiosity[n as usize], e.is_flat(), e.mean_normal, sol.exitant.peak[n as usize], sol.links.of(n).len());
 let light = sol.light(); let mut m = n; let mut rows = vec![]; loop { let r = &sol.elements.nodes[m as usize]; for k in sol.links.of(m) { let d = light.direction_to(r.center, k.sender); rows.push((light.emitted(k.sender, -d).element_sum() * k.factor * k.visibility.abs(), format!("recv {m} flat {} sender {} {:?} src {} B {} f {} V {} em {}", r.is_flat(), k.sender, sol.elements.nodes[k.sender as usize].kind, sol.elements.nodes[k.sender as usize].source, sol.exitant.radiosity[k.sender as usize], k.factor, k.visibility, light.emitted(k.sender, -d)))); } if m == 0 { break; } m = r.parent; } rows.sort_by(|a, b| b.0.total_cmp(&a.0)); for r in rows.iter().take(3) { println!("    {} {}", r.0, r.1); } } return; }
    if let Ok(f) = std::env::var("CSV") { let sol = &s.solution; let text = std::fs::read_to_string(f).unwrap(); let mut by: std::collections::BTreeMap<String, (f64, f64, f64)> = Default::default();
      for l in text.lines().skip(1) { let c: Vec<&str> = l.split(',').collect(); let v = |i: usize| c[i].parse::<f64>().unwrap(); let p = sol.scene.normalization.to_unit(glam::DVec3::new(v(5), v(6), v(7)));
        let mut best: Option<(f32, hr_diffuse::Hit)> = None; for d in [glam::Vec3::X, glam::Vec3::Y, glam::Vec3::Z, -glam::Vec3::X, -glam::Vec3::Y, -glam::Vec3::Z] { if let Some(h) = sol.scene.visibility.closest(p - d * 0.002, d, 0.0, 0.004) { if best.is_none_or(|b| (h.point - p).length() < b.0) && h.front { best = Some(((h.point - p).length(), h)); } } }
        if let Some((_, h)) = best { if let Some(leaf) = sol.leaf(&h) { let e = f64::from(sol.irradiance(leaf, h.uv).element_sum()); let el = f64::from(sol.exitant.irradiance[leaf.index()].element_sum()); let r = v(8) + v(9) + v(10); let k = format!("{} {:?}", c[3], h.normal.round()); let t = by.entry(k).or_default(); t.0 += e * v(4); t.1 += r * v(4); t.2 += el * v(4); } } }
      for (k, t) in by { println!("CSV {k}: vertex {:.3} leaf {:.3} of reference {:.2}", t.0 / t.1, t.2 / t.1, t.1); } return; }
    if std::env::var("EN").is_ok() { let sol = &s.solution; let (mut ab, mut em, mut vab) = (0.0f64, 0.0f64, 0.0f64); for n in sol.elements.patch_leaves() { let e = &sol.elements.nodes[n as usize]; let m = &sol.scene.materials[e.material as usize]; let g = hr_diffuse::LightField::active(&sol.field, e.material).unwrap_or_default(); let a = f64::from(e.area); let k = (glam::Vec3::ONE - e.reflectance - g).element_sum(); let _ = k;
      let abs = sol.exitant.irradiance[n as usize] * (glam::Vec3::ONE - e.reflectance - g); ab += a * f64::from(abs.element_sum());
      let f = sol.vertices.fan(n); let ve: glam::Vec3 = f.iter().map(|c| sol.vertices.irradiance[c.vertex as usize]).sum::<glam::Vec3>() / f.len() as f32; vab += a * f64::from((ve * (glam::Vec3::ONE - e.reflectance - g)).element_sum());
      if e.kind == hr_diffuse::hierarchy::Kind::Front { em += a * f64::from(m.exitance.element_sum()); } }
      let light = sol.light(); let (mut dir, mut exact, mut inn, mut inv, mut inu) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
      for n in sol.elements.patch_leaves() { let e = &sol.elements.nodes[n as usize]; let mut m = n; loop { for k in sol.links.of(m) { let q = &sol.elements.nodes[k.sender as usize]; let r = &sol.elements.nodes[m as usize];
         if q.is_patch() && sol.scene.materials[q.material as usize].exitance.element_sum() > 0.0 { let d = light.direction_to(r.center, k.sender); let f = if r.is_flat() { 1.0 } else { e.mean_cosine(d) }; let c = f64::from(e.area * k.factor * f * light.emitted(k.sender, -d).element_sum()); inv += c; dir += c * f64::from(k.visibility.abs()); exact += f64::from(e.area * light.irradiance_at(e.center, e.normals.axis, k.sender).element_sum()); }
         else { let d = light.direction_to(r.center, k.sender); let f = if r.is_flat() { 1.0 } else { e.mean_cosine(d) }; inn += f64::from(e.area * k.factor * f * light.emitted(k.sender, -d).element_sum() * k.visibility.abs()); inu += f64::from(e.area * k.factor * f * light.emitted(k.sender, -d).element_sum()); } } if m == 0 { break; } m = sol.elements.nodes[m as usize].parent; } }
      println!("EN indirect unoccluded {:.4}", inu / em); println!("EN direct {:.4} unoccluded {:.4} centre {:.4} indirect {:.4} total received {:.4}", dir / em, inv / em, exact / em, inn / em, { let mut t = 0.0f64; let mut b = 0.0f64; for n in sol.elements.patch_leaves() { let e = &sol.elements.nodes[n as usize]; t += f64::from(e.area * sol.exitant.irradiance[n as usize].element_sum()); b += f64::from(e.area * sol.exitant.radiosity[n as usize].element_sum()); } println!("EN emitted+reflected {:.4}", b / em); t / em });
      println!("EN E {} absorbed/emitted {:.4} by vertices {:.4} links {} nodes {} {:?}", a[2], ab / em, vab / em, sol.links.all().len(), sol.elements.nodes.len(), sol.stats.seconds); return; }
    let cam = scene.cameras.iter().find(|c| c.0 == a[3]).map(|c| c.1).unwrap_or_else(|| Camera::load(a[3].as_ref()).unwrap());
    let (x, y): (f64, f64) = (a[4].parse().unwrap(), a[5].parse().unwrap());
    let sol = &s.solution;
    let eye = sol.scene.normalization.to_unit(glam::DVec3::from(cam.eye));
    let hit = sol.scene.visibility.closest(eye, cam.direction(x, y).as_vec3(), 1e-6, 1e9).unwrap();
    let leaf = sol.leaf(&hit).unwrap();
    let e = &sol.elements.nodes[leaf.index()];
    println!("hit {hit:?}\nleaf {leaf:?} r {} area {} E {} vertexE {}", e.radius, e.area, sol.exitant.irradiance[leaf.index()], sol.irradiance(leaf, hit.uv));
    for (v, w) in sol.vertices.interpolation(leaf.0, hit.uv) { println!("vertex {v} w {w} E {} leaf {}", sol.vertices.irradiance[v as usize], sol.vertices.leaf[v as usize]); }
    let light = sol.light();
    let (v, _) = sol.vertices.interpolation(leaf.0, hit.uv)[0]; let leaf = hr_diffuse::NodeId(sol.vertices.leaf[v as usize]); let e = &sol.elements.nodes[leaf.index()]; let x = sol.vertices.positions[v as usize].lerp(e.center, 0.02);
    println!("vertex {v} x {x} leaf {leaf:?}");
    let mut n = leaf.0; let mut rows = vec![];
    loop { for l in sol.links.of(n) { let q = &sol.elements.nodes[l.sender as usize]; let i = light.irradiance_at(x, e.normals.axis, l.sender);
        rows.push((i.element_sum() * l.visibility.abs(), format!("recv {n} (r {:.3}) sender {} {:?} r {:.3} at {:.2} B {:.2} range {:.2} {:.2} f {:.5} V {:.3} E here {:.3}", sol.elements.nodes[n as usize].radius, l.sender, q.kind, q.radius, q.center, sol.exitant.radiosity[l.sender as usize], sol.exitant.range[l.sender as usize][0].x, sol.exitant.range[l.sender as usize][1].x, l.factor, l.visibility, i), i.element_sum())); }
      if n == 0 { break; } n = sol.elements.nodes[n as usize].parent; }
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!("{} links, total {}", rows.len(), rows.iter().map(|r| r.0).sum::<f32>());
    for r in rows.iter().take(14) { println!("{:.3} {}", r.0, r.1); }
 rows.sort_by(|a, b| b.2.total_cmp(&a.2)); println!("unoccluded"); for r in rows.iter().take(12) { println!("{:.3} {}", r.2, r.1); }
}
