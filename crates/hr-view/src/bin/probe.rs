#![allow(missing_docs, clippy::print_stdout)]
use hr_scene::*; use hr_view::*; use std::sync::Arc; use std::ops::ControlFlow;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Arc::new(Scene::load(&a[1]).unwrap());
    let s = solved::Solved::new(scene.clone(), hr_diffuse::Settings { error: a[2].parse().unwrap() }, &mut |_| ControlFlow::Continue(())).unwrap();
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
