//! One growth step of one system: associate, grow, kill (Rauch & Harders 2021, section 3).

use super::direction::{Decision, decide};
use super::drains::{Attraction, Drains, News};
use super::forest::Forest;
use super::lengths::Lengths;
use super::perception::{self, Pull, Search};
use super::report::SystemReport;
use super::settings::SystemSettings;
use crate::synthesis::parallel;
use crate::synthesis::space::point_grid::{Blockers, PointGrid};
use crate::synthesis::tissue::{NoGoField, Tissue, TissuePoint};
use crate::synthesis::tree::BedLink;
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use bevy_math::{Vec3, bounding::Aabb3d};
use std::ops::Range;

/// The tissue and rules for placing new nodes in a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground<'a> {
    /// The tissue in force.
    pub tissue: &'a dyn Tissue,
    /// Where no node may be placed.
    pub no_go: Option<&'a NoGoField>,
    /// Whether nodes that leave the tissue are brought back.
    pub confine: bool,
    /// Whether nodes need the tissue's normal even if they are not brought back.
    pub normals: bool,
}

impl Ground<'_> {
    /// Where a vessel comes to that grows from a point by a step; `None` if there is no way, or the middle or end of one
    /// of its segments is forbidden.
    fn place(&self, from: &TissuePoint, direction: Vec3, lengths: &Lengths) -> Option<Tip> {
        let forbids = |point| self.no_go.is_some_and(|no_go| no_go.forbids(point));
        let (mut end, mut bends, mut forbidden, mut before) = (None, 0, false, from.position);
        self.walk(from, direction, lengths, &mut |place| {
            forbidden |= forbids(place.position) || forbids(before.midpoint(place.position));
            bends += u32::from(end.replace(place).is_some());
            before = place.position;
        });
        let tip = end.map(|end| Tip { end, bend: (bends > 0).then_some(direction) });
        tip.filter(|_| !forbidden)
    }

    /// Calls `arrive` for the end of each segment of a step.
    fn walk(&self, from: &TissuePoint, direction: Vec3, lengths: &Lengths, arrive: &mut dyn FnMut(TissuePoint)) {
        if self.confine {
            return self.tissue.walk(from, direction, lengths.step, lengths.bend_tolerance(), arrive);
        }
        let position = from.position + direction * lengths.step;
        let normal = if self.normals { self.tissue.closest_point(position).normal } else { Vec3::ZERO };
        arrive(TissuePoint::new(position, normal));
    }

    /// Whether vessels keep to one side of a surface.
    fn has_sides(&self) -> bool {
        self.confine && self.tissue.has_facets()
    }

    /// Normal of the facet at a place of the tissue, zero without one.
    fn side(&self, position: Vec3) -> Vec3 {
        let facet = if self.has_sides() { self.tissue.closest_point(position).facet } else { None };
        facet.map_or(Vec3::ZERO, |facet| facet.normal)
    }

    /// A point as the start of vessels that may leave the tissue, or may not.
    fn start(&self, at: TissuePoint) -> TissuePoint {
        TissuePoint { facet: at.facet.filter(|_| self.confine), ..at }
    }
}

/// The end of a step.
#[derive(Clone, Copy, Debug)]
struct Tip {
    end: TissuePoint,
    /// The direction of a way that bends before its end.
    bend: Option<Vec3>,
}

/// A drain that a vessel has supplied.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Supplied {
    /// Its old slot.
    pub drain: u32,
    /// Its place.
    pub at: Attraction,
    /// The node that supplied it: its nearest open one.
    pub node: u32,
}

/// A growing node, and the ends of its steps, at most two.
#[derive(Clone, Copy, Debug, Default)]
struct Growing {
    node: u32,
    tips: [Option<Tip>; 2],
}

/// The forest and the drains of one system, with the lengths in force.
#[derive(Debug, Default)]
pub(crate) struct SystemGrowth {
    pub forest: Forest,
    pub drains: Drains,
    pub lengths: Lengths,
    /// Size σ_t of the tissue for this system.
    size: f32,
    settings: SystemSettings,
    search: Search,
    pulls: Vec<Pull>,
    /// Ranges of pulls on the same node, and the growth of that node.
    pulled: Vec<Range<usize>>,
    growing: Vec<Growing>,
    /// The places of a way that bends.
    way: Vec<TissuePoint>,
    news: News,
    /// Drains supplied in the last step.
    supplied: Vec<Supplied>,
    /// For drains from the other system, the node there that supplied them, by slot.
    givers: Vec<u32>,
}

/// A new node is not made nearer than this share of a step length to another one.
const LEAST_SEPARATION: f32 = 1e-3;
/// Cells are laid out again once their side has left this range, relative to the fitting side.
const FITTING_CELLS: Range<f32> = 0.6..1.5;

impl SystemGrowth {
    /// A system without nodes or drains.
    pub fn new(settings: &SystemSettings, bounds: &Aabb3d) -> Self {
        let mut system = Self::default();
        system.restart(settings, bounds);
        system
    }

    /// Removes all nodes and drains, and takes new settings, keeping memory.
    pub fn restart(&mut self, settings: &SystemSettings, bounds: &Aabb3d) {
        self.settings.clone_from(settings);
        self.size = 1.0;
        self.lengths = Lengths::at_size(settings, 1.0);
        self.forest.reset(bounds, self.lengths.cell(), settings.terminal_radius, settings.bifurcation_exponent);
        self.drains.reset(bounds, self.lengths.cell());
        self.supplied.clear();
        self.givers.clear();
    }

    /// Adds roots, and given trees.
    pub fn plant(&mut self, roots: &[TissuePoint], given: Option<&VesselTree>, ground: Ground<'_>) {
        for &root in roots {
            self.forest.add_root(ground.start(root), self.settings.terminal_radius);
        }
        let first = self.forest.tree.len() as u32;
        if let Some(tree) = given {
            for (node, &parent) in tree.parents().iter().enumerate() {
                let (position, radius) = (tree.positions()[node], tree.radii()[node]);
                let at = ground.start(ground.tissue.point_at(position));
                match parent {
                    NO_PARENT => self.forest.add_root(at, radius),
                    parent => self.forest.add_given(first + parent, at, radius),
                }
            }
        }
        self.forest.sum_up(|_| ());
        self.forest.settle();
    }

    /// Marks candidates that cannot become drains: those in supplied tissue, within the birth distance of a node, or too near
    /// a drain.
    pub fn refuse(&self, candidates: &[Vec3], ground: Ground<'_>, refused: &mut [bool]) {
        let (nodes, drains) = (self.forest.index(), self.drains.index());
        let Lengths { node_birth, drain_birth, .. } = self.lengths;
        if ground.has_sides() {
            // Not every node near a candidate supplies it.
            let drains = Blockers::new([(drains, drain_birth)]);
            drains.mark_beside(candidates, refused);
            nodes.mark_beside_of(candidates, node_birth, refused, |node, place| !self.forest.is_steep(node, place));
            for (&candidate, refused) in candidates.iter().zip(refused).filter(|(_, refused)| !**refused) {
                *refused = drains.any(candidate)
                    || nodes.any_within(candidate, node_birth) && self.supplies(candidate, ground);
            }
        } else {
            let blockers = Blockers::new([(drains, drain_birth), (nodes, node_birth)]);
            blockers.mark_beside(candidates, refused);
            for (&candidate, refused) in candidates.iter().zip(refused).filter(|(_, refused)| !**refused) {
                *refused = blockers.any(candidate);
            }
        }
    }

    /// Whether a node within the birth distance of a place is on the same side of the surface.
    fn supplies(&self, place: Vec3, ground: Ground<'_>) -> bool {
        let (forest, reach) = (&self.forest, self.lengths.node_birth);
        // A search for the side of the place is seldom needed.
        forest.index().any_of_within(place, reach, |node| !forest.is_steep(node, place)) || {
            let side = ground.side(place);
            forest.index().any_of_within(place, reach, |node| forest.supplies(node, side))
        }
    }

    /// Makes a candidate that has not been refused a drain, unless one has been born too near it meanwhile.
    pub fn offer_drain(&mut self, candidate: Vec3, ground: Ground<'_>) -> Option<u32> {
        let room = !self.drains.index().any_within(candidate, self.lengths.drain_birth);
        room.then(|| self.drains.add(Attraction { position: candidate, side: ground.side(candidate) }))
    }

    /// Takes drains that the other system has supplied.
    pub fn receive(&mut self, supplied: &[Supplied]) {
        for supplied in supplied {
            let slot = self.drains.add(supplied.at) as usize;
            if slot == self.givers.len() {
                self.givers.push(supplied.node);
            } else {
                self.givers[slot] = supplied.node;
            }
        }
    }

    /// Links from the other system by the drains supplied in the last step: that system's node, and this one's.
    pub fn links(&self) -> impl Iterator<Item = BedLink> + '_ {
        let giver = |supplied: &Supplied| NodeId(self.givers[supplied.drain as usize]);
        self.supplied.iter().map(move |supplied| BedLink { arterial: giver(supplied), venous: NodeId(supplied.node) })
    }

    /// Drains supplied in the last step.
    pub fn supplied(&self) -> &[Supplied] {
        &self.supplied
    }

    /// One step of growth. The next [`settle`](Forest::settle) updates the radii.
    pub fn grow(&mut self, ground: Ground<'_>, step: u32) -> SystemReport {
        let first_new = self.forest.tree.len() as u32;
        self.forest.set_tip_radius(self.lengths.terminal_radius);
        perception::associate(&self.forest, &self.lengths, &mut self.drains, &mut self.search, &mut self.pulls);
        self.decide(ground);
        self.extend(ground, step);
        self.spread_news(first_new);
        self.kill();
        SystemReport {
            first_new_node: first_new,
            new_nodes: self.forest.tree.len() as u32 - first_new,
            supplied: self.supplied.len() as u32,
            drains_left: self.drains.len() as u32,
        }
    }

    /// Decides for every node with acting drains where it grows to.
    fn decide(&mut self, ground: Ground<'_>) {
        let Self { forest, drains, lengths, pulls, pulled, growing, .. } = self;
        pulled.clear();
        pulled.extend(pulls.chunk_by(|a, b| a.node == b.node).map(<[Pull]>::len).scan(0, |end, len| {
            *end += len;
            Some(*end - len..*end)
        }));
        parallel::map_many_into(pulled, growing, Growing::default(), |range| {
            let pulls = &pulls[range.clone()];
            let node = pulls[0].node;
            let at = forest.point(node);
            let place = |direction: Vec3| ground.place(&at, direction, lengths);
            let drains = pulls.iter().map(|pull| forest.sight(node, drains.position(pull.drain)));
            let tips = match decide(forest, lengths, node, drains) {
                Decision::Extend(direction) => [place(direction), None],
                Decision::Bifurcate(directions) => directions.map(place),
                Decision::Rest => [None; 2],
            };
            Growing { node, tips }
        });
    }

    /// Adds the decided segments, except those that would end on another node or at no place.
    fn extend(&mut self, ground: Ground<'_>, step: u32) {
        let Self { forest, lengths, growing, way, .. } = self;
        for growing in growing {
            for &Tip { end, bend } in growing.tips.iter().flatten() {
                way.clear();
                match bend {
                    None => way.push(end),
                    Some(direction) => {
                        ground.walk(&forest.point(growing.node), direction, lengths, &mut |place| way.push(place));
                    }
                }
                let is_free = |place: &TissuePoint| {
                    place.position.is_finite()
                        && !forest.index().any_close(place.position, LEAST_SEPARATION * lengths.step)
                };
                if way.iter().all(is_free) {
                    let mut node = growing.node;
                    way.iter().for_each(|&place| node = forest.add_tip(node, place, step));
                }
            }
        }
    }

    /// Takes up another tissue, on which drains are seen in other directions.
    pub fn stand_on(&mut self, ground: Ground<'_>) {
        if ground.confine {
            self.forest.stand_on(ground.tissue);
            self.drains.turn(|position| ground.side(position));
        }
    }

    /// Wakes drains with a change: their node has new children or another sprout angle, or a new node is within reach.
    fn spread_news(&mut self, first_new: u32) {
        let Self { forest, drains, lengths, news, .. } = self;
        let nodes = forest.tree.len() as u32;
        for node in first_new..nodes {
            let parent = forest.tree.parents()[node as usize];
            drains.wake(parent, !perception::is_open(forest, lengths, parent));
        }
        forest.sum_up(|node| drains.wake(node, false));
        news.spread(drains, first_new, &forest.tree.positions()[first_new as usize..], lengths.reach());
        for heard in news.iter() {
            let is_open = perception::is_open(forest, lengths, heard.node);
            drains.hear(heard, |drain| forest.cos_to(heard.node, drain).filter(|_| is_open));
        }
    }

    /// Removes the drains that acted in this step and now have a node within the kill distance.
    fn kill(&mut self) {
        self.supplied.clear();
        let reach = self.lengths.kill * self.lengths.kill;
        for &Pull { drain, node } in &self.pulls {
            if self.drains.hearing(drain).closest <= reach {
                let (at, node) = (self.drains.attraction(drain), self.drains.hearing(drain).node().unwrap_or(node));
                self.supplied.push(Supplied { drain, at, node });
                self.drains.remove(drain);
            }
        }
        self.drains.forget_the_gone();
    }

    /// Grows the tissue, which shortens all lengths relative to it.
    pub fn advance_tissue(&mut self, step: u32) {
        self.size = self.settings.tissue_growth.advance(self.size, step);
        let before = self.lengths.reach();
        self.lengths = Lengths::at_size(&self.settings, self.size);
        if self.lengths.reach() > before {
            self.drains.wake_all();
        }
        let cell = self.lengths.cell();
        if needs_laying(self.forest.index(), cell) || needs_laying(self.drains.index(), cell) {
            self.forest.resize_cells(cell);
            self.drains.resize_cells(cell);
        }
    }

    /// λ_t: the factor of lengths at the present size of the tissue.
    pub fn length_scale(&self) -> f32 {
        self.size.recip()
    }
}

/// Whether an index needs new cells, with a side that fits the lengths.
fn needs_laying(index: &PointGrid, fitting: f32) -> bool {
    !FITTING_CELLS.contains(&(fitting / index.cell())) || index.is_scattered()
}

#[cfg(test)]
impl SystemGrowth {
    /// Compares the drains' knowledge of their nearest open node with a brute-force search.
    pub(crate) fn assert_association_exact(&mut self) {
        perception::associate(&self.forest, &self.lengths, &mut self.drains, &mut self.search, &mut self.pulls);
        perception::assert_none_sleeps_in(&self.forest, &self.lengths, &self.drains, &self.pulls);
        let positions = self.forest.tree.positions();
        let reach = self.lengths.influence * self.lengths.influence;
        for drain in self.drains.slots() {
            let at = self.drains.position(drain);
            let nearest = (0..positions.len() as u32)
                .filter(|&node| perception::is_open(&self.forest, &self.lengths, node))
                .filter(|&node| self.forest.sees(node, self.drains.attraction(drain).side))
                .map(|node| (positions[node as usize].distance_squared(at), node))
                .filter(|&(distance, _)| distance <= reach)
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let hearing = self.drains.hearing(drain);
            let known = hearing.node().map(|node| (hearing.distance, node)).filter(|&(distance, _)| distance <= reach);
            assert_eq!(known, nearest, "drain {drain}");
            let closest = positions.iter().map(|node| node.distance_squared(at)).fold(f32::INFINITY, f32::min);
            let kill = self.lengths.kill * self.lengths.kill;
            assert_eq!(hearing.closest <= kill, closest <= kill, "drain {drain}");
        }
    }
}
