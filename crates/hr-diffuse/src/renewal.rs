//! Which pairs are to be looked at again after something has moved: found from the root down, so that only what the move
//! concerns is visited.
//!
//! Links and pairs that wait for light divide the pairs of all leaves among them; what is missing was dropped: it was black,
//! faced away, or was proved to be hidden. So a pair of nodes between parts of which nothing is known was dropped as a whole, and
//! where it is concerned it may have light now.

use crate::hierarchy::{Element, Elements, SceneData};
use crate::links::Link;
use crate::moved::Moved;
use crate::refine::Pair;
use std::ops::Range;

/// What is left as it is, and what is to be looked at.
#[derive(Debug)]
pub(crate) struct Renewal {
    /// By link: whether it stays.
    pub(crate) stays: Vec<bool>,
    /// Pairs that wait for light as before.
    pub(crate) waiting: Vec<Pair>,
    /// Pairs to be looked at as if there had never been a link.
    pub(crate) again: Vec<Pair>,
}

/// Finds it for links and pairs that wait for light.
pub(crate) fn renewal(
    scene: &SceneData,
    elements: &Elements,
    moved: &Moved,
    links: &[Link],
    waiting: Vec<Pair>,
) -> Renewal {
    let linked = links.iter().map(|link| Pair { receiver: link.receiver, sender: link.sender });
    let mut known: Vec<(usize, Pair)> = linked.chain(waiting.iter().copied()).enumerate().collect();
    let mut stays = vec![true; known.len()];
    let mut again = Vec::new();
    let tour = Tour::new(elements);
    let mut open = vec![(Pair { receiver: 0, sender: 0 }, 0..known.len())];
    while let Some((pair, range)) = open.pop() {
        let receives = elements.nodes[pair.receiver as usize].importance > 0.0;
        if !receives || !moved.concerns(scene, elements, pair) {
            continue;
        }
        let within = &known[range.clone()];
        let renewed = moved.is_all_of(pair.receiver) || moved.is_all_of(pair.sender);
        if renewed || within.iter().all(|(_, part)| *part == pair) {
            within.iter().for_each(|(index, _)| stays[*index] = false);
            again.push(pair);
            continue;
        }
        let [receivers, senders] = parts(elements, pair, within.iter().map(|(_, part)| *part));
        let mut row = range.start;
        for receiver in receivers {
            let end = row + sort_out(&mut known[row..range.end], |(_, part)| tour.holds(receiver, part.receiver));
            for sender in senders.clone() {
                let next = row + sort_out(&mut known[row..end], |(_, part)| tour.holds(sender, part.sender));
                open.push((Pair { receiver, sender }, row..next));
                row = next;
            }
            row = end;
        }
    }
    let waiting = waiting.into_iter().zip(&stays[links.len()..]).filter(|(_, stays)| **stays).map(|(pair, _)| pair);
    let waiting = waiting.collect();
    stays.truncate(links.len());
    Renewal { stays, waiting, again }
}

/// Receivers and senders that a pair was divided into: what is known of its parts lies within pairs of these.
fn parts(elements: &Elements, pair: Pair, mut within: impl Iterator<Item = Pair> + Clone) -> [Range<u32>; 2] {
    let [r, s] = [pair.receiver, pair.sender].map(|node| &elements.nodes[node as usize]);
    let [whole_receiver, whole_sender] = [pair.receiver..pair.receiver + 1, pair.sender..pair.sender + 1];
    let children = |element: &Element| element.first_child..element.first_child + element.child_count;
    if pair.receiver == pair.sender {
        return [children(r), children(s)];
    }
    let receives_whole = within.clone().any(|part| part.receiver == pair.receiver);
    let sends_whole = within.any(|part| part.sender == pair.sender);
    let larger = r.radius >= s.radius && r.child_count > 0 || s.child_count == 0;
    if sends_whole || larger && !receives_whole { [children(r), whole_sender] } else { [whole_receiver, children(s)] }
}

/// Moves what passes to the front, and counts it.
fn sort_out<T>(items: &mut [T], passes: impl Fn(&T) -> bool) -> usize {
    let mut count = 0;
    for i in 0..items.len() {
        if passes(&items[i]) {
            items.swap(count, i);
            count += 1;
        }
    }
    count
}

/// Nodes by a tour of the tree, in which those below each node follow it.
struct Tour {
    /// By node: its place, and the end of those below it.
    places: Vec<Range<usize>>,
}

impl Tour {
    fn new(elements: &Elements) -> Self {
        let nodes = &elements.nodes;
        let mut sizes = vec![1_usize; nodes.len()];
        for node in (1..nodes.len()).rev() {
            sizes[nodes[node].parent as usize] += sizes[node];
        }
        let mut places = vec![0..nodes.len(); nodes.len()];
        for (node, element) in nodes.iter().enumerate() {
            let mut next = places[node].start + 1;
            for child in element.first_child..element.first_child + element.child_count {
                places[child as usize] = next..next + sizes[child as usize];
                next += sizes[child as usize];
            }
        }
        Self { places }
    }

    /// Whether a node is another one or below it.
    fn holds(&self, above: u32, node: u32) -> bool {
        self.places[above as usize].contains(&self.places[node as usize].start)
    }
}
