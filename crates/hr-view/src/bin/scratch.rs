#![allow(missing_docs, clippy::print_stdout)]
use hr_scene::*; use hr_view::*; use std::sync::Arc; use std::ops::ControlFlow; use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Arc::new(Scene::load(&a[1]).unwrap());
    for w in &scene.warnings { println!("warn {} {} x{}", w.text, w.first, w.count); }
    let t = Instant::now();
    let s = solved::Solved::new(scene.clone(), hr_diffuse::Settings { error: a[2].parse().unwrap() }, std::env::var("ND").is_err(), &mut |p| { if std::env::var("PR").is_ok() { eprintln!("{:.1}s {p:?}", t.elapsed().as_secs_f64()); } ControlFlow::Continue(()) }).unwrap();
    println!("solve {:.2}s {:?}", t.elapsed().as_secs_f64(), s.solution.stats);
    let basis: usize = s.solution.reflected.iter().map(|h| h.basis_functions()).sum();
    let bytes: usize = s.solution.reflected.iter().map(|h| h.bytes()).sum();
    println!("verts {} evals {} basis {} haar MB {} samples {}", s.solution.vertices.positions.len(), s.solution.field.counters().brdf_evaluations(), basis, bytes/1000000, s.solution.incident.iter().map(|i| i.len()).sum::<usize>());
    for i in (3..a.len()).step_by(2) {
        let cam = scene.cameras.iter().find(|c| c.0 == a[i]).map(|c| c.1).unwrap_or_else(|| Camera::load(a[i].as_ref()).unwrap());
        for (m, n) in [(raycast::Mode::Samples, "s"), (raycast::Mode::Distributions, "d")] {
            let t = Instant::now();
            let im = raycast::RayCaster::new(&scene, &s.solution, m).render(&cam, &|_| ());
            println!("render {n} {:.2}s", t.elapsed().as_secs_f64());
            for e in ["pfm", "png"] { im.save(format!("{}_{n}.{e}", a[i+1]).as_ref(), &ToneMap::default(), scene.primaries).unwrap(); }
        }
    }
}
