#![allow(missing_docs)]
use glam::DVec3;
use hr_diffuse::*;
use std::ops::ControlFlow;
#[test]
fn rows() {
    let mut surfaces = Vec::new();
    for axis in 0..3 { for sign in [-1.0, 1.0] {
        let n = DVec3::AXES[axis] * -sign;
        let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
        let c = n * -1.0;
        let mut k = [c - u - v, c + u - v, c + u + v, c - u + v];
        if sign > 0.0 { k.reverse(); }
        surfaces.push(Surface::new(Shape::Quad(k), 0));
    } }
    let m = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::splat(0.5), two_sided: false };
    let input = SceneInput { surfaces, materials: vec![m], ..SceneInput::default() };
    for e in [0.5,0.2,0.1,0.05] {
    let mut solver = Solver::new(&input, Settings { error: e }, ()).unwrap();
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let s = solver.finish(&mut |_| ControlFlow::Continue(()));
    let leaves: Vec<u32> = s.elements.patch_leaves().collect();
    let irr: Vec<f32> = leaves.iter().map(|&l| s.exitant.irradiance[l as usize].x).collect();
    let mean = leaves.iter().map(|&l| s.exitant.irradiance[l as usize].x * s.elements.nodes[l as usize].area).sum::<f32>() / leaves.iter().map(|&l| s.elements.nodes[l as usize].area).sum::<f32>();
    let kinds: usize = leaves.iter().filter(|&&l| s.elements.nodes[l as usize].kind == hierarchy::Kind::Front).count();
    println!("E {e} leaves {} front {kinds} mean {mean} min {} max {}", leaves.len(), irr.iter().cloned().fold(9., f32::min), irr.iter().cloned().fold(0., f32::max));
    let vis = s.links.all().iter().map(|l| l.visibility).fold(2.0, f32::min);
    for l in s.links.all().iter().take(12) { println!("L {} {} {} {}", l.receiver, l.sender, l.factor, l.visibility); }
    println!("min vis {vis}; vertex min {} max {}", s.vertices.irradiance.iter().map(|v| v.x).fold(9.0, f32::min), s.vertices.irradiance.iter().map(|v| v.x).fold(0.0, f32::max));
    let mut worst: Vec<_> = leaves.iter().map(|&l| (s.exitant.irradiance[l as usize].x, s.elements.nodes[l as usize].center, s.elements.nodes[l as usize].radius)).collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!("{:?}", &worst[..3]);
    }
}
#[test]
fn quad() {
    let s = Surface::new(Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::X+DVec3::Y, DVec3::Y]), 0);
    let g = Geometry::from_surface(&s, &Normalization::default()).unwrap();
    println!("Q {:?} {:?} {}", g.quadrature(Domain::WHOLE), g.split(Domain::WHOLE), g.area(Domain::WHOLE));
    for p in g.split(Domain::WHOLE) { println!("Q {:?} {}", g.quadrature(p), g.area(p)); }
}
