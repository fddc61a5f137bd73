use super::{Push, Spread, visible};
use crate::gather::Group;
use crate::links::Link;
use crate::skips::Skips;
use crate::skips::tests::{room, solve};
use std::ops::ControlFlow;

const ERROR: f32 = 0.1;

fn link_share(link: &Link, spread: Spread) -> f32 {
    link.factor * visible(link, spread)
}

/// Factors of links are means over their receivers, so weights of the leaves below are 1 on average.
#[test]
fn weights_are_means_over_the_receiver() {
    let solver = solve(&room(), ERROR, (), Skips::ALL);
    let (light, links) = (solver.light(), &solver.links);
    let push = Push::new(light, links, Some(ERROR), u64::MAX, &mut || ControlFlow::Continue(()));
    // By link: weight × area of the leaves below, and their area.
    let mut below = vec![[0.0_f64; 2]; links.all().len()];
    for (index, &leaf) in push.leaves.iter().enumerate() {
        let mut weights = push.weights[push.first[index]..push.first[index + 1]].iter();
        push.each(light, links, leaf, |_, at| {
            let weight = weights.next().expect("a weight for each");
            let area = f64::from(light.element(leaf).area);
            below[at][0] += area * f64::from(*weight);
            below[at][1] += area;
        });
    }
    let (mut off, mut all) = (0.0, 0.0);
    for (at, link) in links.all().iter().enumerate() {
        let receiver = light.element(link.receiver);
        if push.spreads[at] != Spread::Exact || !receiver.is_flat() || link.visibility.abs() < 1.0 {
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

/// Where weights do not fit in memory, leaves get about the same light.
#[test]
fn weights_that_are_not_kept_are_found_again() {
    let solver = solve(&room(), ERROR, (), Skips::ALL);
    let (light, links) = (solver.light(), &solver.links);
    let of = |room: u64| Push::new(light, links, Some(ERROR), room, &mut || ControlFlow::Continue(()));
    let (all, none) = (of(u64::MAX), of(0));
    assert_eq!((none.weight_bytes(), all.weight_bytes() > 10_000), (0, true), "bytes that are kept");
    let groups = vec![Group::Rest; links.all().len()];
    let bring = |(link, spread): (&_, &_)| link_share(link, *spread);
    let arriving: Vec<f32> = links.all().iter().zip(&all.spreads).map(bring).collect();
    let even = vec![[0.0; 3]; light.elements.nodes.len()];
    let (mut apart, mut total) = (0.0, 0.0);
    for (index, &leaf) in all.leaves.iter().enumerate() {
        let [kept, found] = [&all, &none].map(|push| push.sum(light, links, index, (&groups, &arriving, &even))[2]);
        apart += light.element(leaf).area * (kept - found);
        total += light.element(leaf).area * kept;
    }
    assert!(total > 0.0 && (apart / total).abs() < ERROR, "{apart} of {total}");
}
