use super::{
    DIMMEST_SHARE, FAINT_SHARE, Found, HARDLY_VISIBLE, LEAST_VISIBLE, Looked, Place, Push, Spread, Told, is_shared,
    spreads, visible,
};
use crate::effort::Aim;
use crate::gather::{GROUPS, Group};
use crate::links::{Link, Links};
use crate::sampling::{hash, unit};
use crate::skips::Skips;
use crate::skips::tests::{room, solve};
use crate::{DiffuseMaterial, Rgb, SceneInput, Shape, Surface};
use glam::{DVec3, Vec3};
use std::ops::ControlFlow;

const ERROR: f32 = 0.1;

fn link_share(link: &Link, spread: Spread) -> f32 {
    link.factor * visible(link, spread)
}

/// Factors of links are means over their receivers, so weights of the leaves below are 1 on average.
#[test]
fn weights_are_means_over_the_receiver() {
    let solver = solve(&room(), 0.3 * ERROR, (), Skips::ALL);
    let (light, links) = (solver.light(), &solver.links);
    let push = Push::new(light, links, Some(Aim::of(ERROR)), (u64::MAX, None), &mut || ControlFlow::Continue(()));
    // By link: weight × area of the leaves below, and their area.
    let mut below = vec![[0.0_f64; 2]; links.all().len()];
    for (index, &leaf) in push.places.nodes.iter().enumerate() {
        let mut weights = push.weights[push.first[index]..push.first[index + 1]].iter();
        push.each(light, leaf, |_, at| {
            let weight = weights.next().expect("a weight for each");
            let area = f64::from(light.element(leaf).area);
            below[at][0] += area * f64::from(*weight);
            below[at][1] += area;
        });
    }
    let (mut off, mut all) = (0.0, 0.0);
    for (at, link) in links.all().iter().enumerate() {
        let receiver = light.element(link.receiver);
        // Of what is proved free no ray finds anything else than segments did.
        if push.spreads[at] != Spread::Exact || !receiver.is_flat() || link.visibility >= 0.0 {
            continue;
        }
        let [sum, area] = below[at];
        assert!((area / f64::from(receiver.area) - 1.0).abs() < 1e-4, "the leaves are all of the receiver");
        let brought = f64::from(push.means[at]) * area;
        off += brought * (sum / area - 1.0);
        all += brought;
    }
    assert!(all > 0.0, "there are such links");
    assert!((off / all).abs() < 0.03, "leaves get {:.4} of what their links bring", 1.0 + off / all);
}

/// In a heap of balls under a lamp what is near hides what is far. What leaves would find out for themselves about the rest is found out by
/// chance, and is the same on average.
#[test]
fn looks_that_are_spared_are_made_up_for() {
    let at = |seed: u32| unit(hash(0x4ea9, seed));
    let ball = |i: u32| {
        let center = Vec3::new(at(4 * i), at(4 * i + 1), 0.5 * at(4 * i + 2)).as_dvec3();
        Surface::new(Shape::Sphere { center, radius: 0.07 }, 0)
    };
    let corner = DVec3::new(0.2, 0.2, 1.5);
    let (x, y) = (0.6 * DVec3::X, 0.6 * DVec3::Y);
    let lamp = Surface::new(Shape::Quad([corner, corner + y, corner + x + y, corner + x]), 1);
    let material =
        |reflectance, exitance| DiffuseMaterial { reflectance, exitance: Rgb::splat(exitance), two_sided: false };
    let materials = vec![material(Rgb::splat(0.6), 0.0), material(Rgb::ZERO, 10.0)];
    let surfaces = std::iter::once(lamp).chain((0..120).map(ball)).collect();
    let solver = solve(&SceneInput { surfaces, materials, ..SceneInput::default() }, ERROR, (), Skips::ALL);
    let (light, links) = (solver.light(), &solver.links);
    let of = |error| Push::new(light, links, Some(Aim::of(error)), (u64::MAX, None), &mut || ControlFlow::Continue(()));
    let (some, all) = (of(ERROR), of(0.0));
    assert_eq!(all.spared_looks, 0, "all is looked at");
    assert!(all.unseen_senders > 0, "balls hide each other");
    let looks = some.weights.len() as u64;
    assert!(10 * some.spared_looks > looks, "{} of {looks} are spared", some.spared_looks);
    // Many places would draw more looks than they may: theirs are made rarer.
    let are_rarer = |&&node: &&u32| {
        let place = Place::new(light, node, some.places.middle(light.elements, node), Aim::of(ERROR));
        some.outlooks(light, links, &place).1 < 1.0
    };
    let many = some.places.nodes.iter().filter(are_rarer).count();
    let places = some.places.nodes.len();
    assert!(3 * many > places, "{many} of {places} places");
    // Power that links bring that hardly let anything through, and that leaves look at.
    let power = |push: &Push| {
        let mut power = 0.0;
        for (index, &leaf) in push.places.nodes.iter().enumerate() {
            push.each_weight(light, links, index, |at, weight| {
                let link = &links.all()[at];
                if some.spreads[at] == Spread::Exact && (0.0..HARDLY_VISIBLE).contains(&link.visibility) {
                    let mean = some.means[at] * visible(link, Spread::Exact);
                    power += f64::from(mean * weight.value * light.element(leaf).area);
                }
            });
        }
        power
    };
    let [some, all] = [&some, &all].map(power);
    assert!(all > 0.0 && (some / all - 1.0).abs() < 0.05, "{some} of {all}");
}

/// Where weights do not fit in memory, leaves get about the same light.
#[test]
fn weights_that_are_not_kept_are_found_again() {
    let solver = solve(&room(), ERROR, (), Skips::ALL);
    let (light, links) = (solver.light(), &solver.links);
    let of = |room: u64| Push::new(light, links, Some(Aim::of(ERROR)), (room, None), &mut || ControlFlow::Continue(()));
    let (all, none) = (of(u64::MAX), of(0));
    assert_eq!((none.weight_bytes(), all.weight_bytes() > 10_000), (0, true), "bytes that are kept");
    let groups = vec![Group::Rest; links.all().len()];
    let bring = |(link, spread): (&_, &_)| link_share(link, *spread);
    let arriving: Vec<f32> = links.all().iter().zip(&all.spreads).map(bring).collect();
    let (mut apart, mut total) = (0.0, 0.0);
    let [kept, found] = [&all, &none].map(|push| push.sums(light, links, (&groups, &arriving)));
    for (&leaf, ([.., kept, _], [.., found, _])) in all.places.nodes.iter().zip(kept.into_iter().zip(found)) {
        apart += light.element(leaf).area * (kept - found);
        total += light.element(leaf).area * kept;
    }
    assert!(total > 0.0 && (apart / total).abs() < ERROR, "{apart} of {total}");
}

/// Where all segments of a link happened to be blocked, leaves look for themselves: none of its light is lost.
#[test]
fn links_that_look_blocked_lose_nothing() {
    const FINE: f32 = 0.05 * ERROR;
    let solver = solve(&room(), ERROR, (), Skips::ALL);
    let light = solver.light();
    let watch = &mut || ControlFlow::Continue(());
    let spreads = Push::new(light, &solver.links, Some(Aim::of(FINE)), (0, None), watch).spreads;
    // Links that still matter with the least that is taken to be visible.
    let blocked = |(link, spread): (&Link, &Spread)| {
        let partial = link.visibility > 0.1 && link.visibility < 1.0;
        let brings = light.emitted(link.sender, Vec3::Z).element_sum() * link.factor;
        let all = light.exitant.irradiance[link.receiver as usize].element_sum();
        let matters = brings * LEAST_VISIBLE > 2.0 * FAINT_SHARE * FINE.sqrt() * all;
        let flat = light.element(link.receiver).is_flat() && light.element(link.sender).is_flat();
        *spread == Spread::Exact && is_shared(light, link.receiver) && partial && matters && flat
    };
    let chosen: Vec<Link> =
        solver.links.all().iter().zip(&spreads).filter(|both| blocked(*both)).map(|(link, _)| *link).collect();
    assert!(!chosen.is_empty(), "there are such links");
    let nodes = light.elements.nodes.len();
    let brought = |visibility: fn(f32) -> f32| {
        let links = chosen.iter().map(|link| Link { visibility: visibility(link.visibility), ..*link }).collect();
        let links = Links::new(links, nodes);
        let push = Push::new(light, &links, Some(Aim::of(FINE)), (u64::MAX, None), &mut || ControlFlow::Continue(()));
        let carries = |(link, spread): (&Link, &Spread)| {
            light.emitted(link.sender, Vec3::Z).element_sum() * link_share(link, *spread)
        };
        let arriving: Vec<f32> = links.all().iter().zip(&push.spreads).map(carries).collect();
        let groups = vec![Group::Rest; links.all().len()];
        let sums = push.sums(light, &links, (&groups, &arriving));
        let leaf = |(&leaf, sums): (&u32, [f32; GROUPS])| light.element(leaf).area * sums.iter().sum::<f32>();
        push.places.nodes.iter().zip(sums).map(leaf).sum::<f32>()
    };
    let (open, blocked) = (brought(|visibility| visibility), brought(|_| 0.0));
    assert!((blocked / open - 1.0).abs() < 0.1, "{blocked} of {open}");
}

/// Where a wall goes on into the dark, what is faint beside the light of all of it may be all that arrives there: the dark leaf looks at it,
/// the others do not.
#[test]
fn what_is_faint_to_a_wall_counts_in_the_dark() {
    let mut solver = solve(&room(), ERROR, (), Skips::ALL);
    let aim = Aim::of(ERROR);
    let looked = |solver: &crate::Solver| spreads(solver.light(), &solver.links, Some(aim)).0;
    let before = looked(&solver);
    let links = solver.links.all().to_vec();
    let above = |solver: &crate::Solver, leaf: u32| {
        let up = |&node: &u32| (node > 0).then(|| solver.elements.nodes[node as usize].parent);
        std::iter::successors(Some(leaf), up).collect::<Vec<u32>>()
    };
    let faint = |&at: &usize| before[at] != Spread::Exact && is_shared(solver.light(), links[at].receiver);
    let faint: Vec<usize> = (0..links.len()).filter(faint).collect();
    let reflects = |leaf: &u32| solver.elements.nodes[*leaf as usize].importance > 0.0;
    let faint_to = |leaf: u32| {
        let above = above(&solver, leaf);
        faint.iter().filter(|&&at| above.contains(&links[at].receiver)).count()
    };
    let dark = solver.elements.patch_leaves().filter(reflects).max_by_key(|&leaf| faint_to(leaf));
    let dark = dark.expect("there are leaves");
    solver.exitant.irradiance[dark as usize] = DIMMEST_SHARE * solver.exitant.irradiance[0];
    let after = looked(&solver);
    let (all_above, mut counted) = (above(&solver, dark), Vec::new());
    for (at, link) in links.iter().enumerate() {
        if !all_above.contains(&link.receiver) {
            assert_eq!(before[at], after[at], "a link to elsewhere: {link:?}");
        } else if before[at] != after[at] {
            assert!(faint.contains(&at) && after[at] == Spread::Exact, "{link:?}");
            counted.push(at);
        }
    }
    assert!(!counted.is_empty(), "of {} links", faint.len());
    let (light, places) = (solver.light(), solver.gather.places());
    let looks = |leaf: u32| {
        let place = Place::new(light, leaf, places.middle(light.elements, leaf), aim);
        let rays = |&at: &usize| {
            let link = &links[at];
            let mean = light.emitted_toward(link).element_sum() * link.factor;
            place.weight(light, link, (mean, place.outlook(light, link, mean), 1.0), &Looked::default()).rays
        };
        let own = above(&solver, leaf);
        counted.iter().filter(|&&at| own.contains(&links[at].receiver)).map(rays).sum::<u32>()
    };
    assert!(looks(dark) > 0, "the dark leaf looks");
    let others = places.nodes.iter().filter(|&&place| place != dark && reflects(&place));
    assert_eq!(others.map(|&place| looks(place)).sum::<u32>(), 0, "all others have light enough");
}

/// A place that saw less of emitters than links let through takes fewer rays for the others, and as many where it saw as much; what it is told
/// of the emitters of which it sees all or nothing is the same.
#[test]
fn emitters_that_others_hid_are_worth_few_rays() {
    let solver = solve(&room(), ERROR, (), Skips::ALL);
    let (light, links, aim) = (solver.light(), &solver.links, Aim::of(ERROR));
    let push = Push::new(light, links, Some(aim), (u64::MAX, None), &mut || ControlFlow::Continue(()));
    let looks = |told: Told| {
        let before = Looked { emitters: told, ..Looked::default() };
        let mut found = Vec::new();
        for &node in &push.places.nodes {
            let place = Place::new(light, node, push.places.middle(light.elements, node), aim);
            push.weighted_above(light.elements, node, |at| {
                let link = &links.all()[at];
                let mean = light.emitted_toward(link).element_sum() * link.factor;
                let outlook = place.outlook(light, link, mean);
                if Group::of(light, link.sender) == Group::Emitter && link.visibility >= 0.0 {
                    found.push(place.weight(light, link, (mean, outlook, 1.0), &before));
                }
            });
        }
        found
    };
    let all = looks(Told::default());
    let rays = |found: &[Found]| found.iter().map(|found| found.rays).sum::<u32>();
    let [as_told, hidden] = [320.0, 0.0].map(|free| looks(Told { expected: 320.0, free }));
    assert_eq!(rays(&all), rays(&as_told), "links are right");
    assert!(rays(&all) > 1000 && 3 * rays(&hidden) < rays(&all), "{} of {} rays", rays(&hidden), rays(&all));
    let is_clear = |all: &Found| all.free == 0.0 || all.free == all.rays as f32;
    for (all, hidden) in all.iter().zip(&hidden).filter(|(all, _)| is_clear(all)) {
        assert_eq!(all.weight.value, hidden.weight.value, "all or nothing is seen");
    }
}
