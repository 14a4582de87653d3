//! Blood supply of every segment and of every vertex of the organ.
//!
//! The supply of a segment is the flow that reaches the bed through the terminals below it, divided by that in the
//! intact network: 1 without a change, 0 below a clamp. The supply of a vertex is that of the nearest terminals. A
//! simulator uses it for colours and to score the amount of unsupplied tissue.

use crate::synthesis::{
    haemodynamics::{FlowError, Network},
    pace::{Pace, SHORT_STRETCH, at_once},
    space::{morton::Curve, packed_boxes::PackedBoxes},
    tree::{NO_PARENT, VesselTree},
};
use bevy_math::Vec3;
use std::ops::Range;

/// The supply of every segment of a tree.
#[derive(Clone, Debug, Default)]
pub struct Supply {
    /// Flow into the bed below every node in the intact network, in m³/s.
    intact: Vec<f64>,
    sums: Vec<f64>,
    segments: Vec<f32>,
}

impl Supply {
    /// The supply of a network, relative to the same network without interruptions at the mean root pressure of its
    /// settings.
    ///
    /// Make it again after the tree has grown.
    ///
    /// # Errors
    /// If the intact network can't be solved.
    ///
    /// # Panics
    /// If the network is that of another tree.
    pub fn new(tree: &VesselTree, network: &Network) -> Result<Self, FlowError> {
        let mut intact = network.clone();
        intact.set_interruptions(&[])?;
        intact.set_bed_pressure(intact.settings().bed.pressure)?;
        intact.set_root_pressure(intact.settings().root.mean())?;
        intact.solve()?;
        Ok(Self::against(tree, &intact))
    }

    /// The supply relative to a solved network in its present state: for a network that is joined with another, call
    /// this before the first wound.
    ///
    /// # Panics
    /// If the network is that of another tree.
    pub fn against(tree: &VesselTree, intact: &Network) -> Self {
        at_once(Self::against_paced(tree, intact, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Panics
    /// If the network is that of another tree.
    pub async fn against_paced(tree: &VesselTree, intact: &Network, pace: &Pace) -> Self {
        let mut flows: Vec<f64> = pace.collect(tree.len(), |node| intact.bed_flow(node)).await;
        tree.fold_to_roots(&mut flows, |parent, child| *parent += child);
        Self { intact: flows, segments: vec![1.0; tree.len()], ..Self::default() }
    }

    /// Takes over the flows of a network that has been solved.
    ///
    /// A terminal with backward flow counts as having none, since blood from the bed supplies no tissue. A segment that
    /// never fed a terminal counts as supplied.
    ///
    /// # Panics
    /// If tree or network have a different number of nodes than when this was made.
    pub fn update(&mut self, tree: &VesselTree, network: &Network) {
        at_once(self.update_paced(tree, network, &Pace::default()));
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Panics
    /// If tree or network have a different number of nodes than when this was made.
    pub async fn update_paced(&mut self, tree: &VesselTree, network: &Network, pace: &Pace) {
        let Self { intact, sums, segments } = self;
        assert_eq!(intact.len(), network.len(), "one network, that the supply was made for");
        sums.clear();
        // Veins drain: their flows are negative throughout.
        let forwards = |node: usize| network.bed_flow(node) * intact[node].signum();
        pace.part(0.0..0.5).each(tree.len(), |node| sums.push(forwards(node).max(0.0))).await;
        tree.fold_to_roots(sums, |parent, child| *parent += child);
        let share = |node: usize| {
            let intact = intact[node];
            segments[node] = if intact == 0.0 { 1.0 } else { (sums[node] / intact.abs()).min(1.0) as f32 };
        };
        pace.part(0.5..1.0).each(tree.len(), share).await;
    }

    /// Supply of every segment, from 0 to 1, by its end node.
    pub fn segments(&self) -> &[f32] {
        &self.segments
    }

    /// Share of the bed whose terminals have a supply below `threshold`, weighted by each terminal's intact flow; from
    /// 0 to 1, and 0 for a tree without terminals.
    ///
    /// # Panics
    /// If the tree has a different number of nodes than when this was made.
    pub fn ischaemic_share(&self, tree: &VesselTree, threshold: f32) -> f32 {
        let (mut all, mut lacking) = (0.0, 0.0);
        for node in tree.tips() {
            let fed = self.intact[node as usize].abs();
            all += fed;
            if self.segments[node as usize] < threshold {
                lacking += fed;
            }
        }
        if all > 0.0 { (lacking / all) as f32 } else { 0.0 }
    }
}

/// The terminals of a tree, and an index over their positions.
struct Terminals {
    boxes: PackedBoxes,
    /// Node and position of each slot.
    slots: Vec<(u32, Vec3)>,
}

impl Terminals {
    async fn of(tree: &VesselTree, pace: &Pace) -> Self {
        let mut nodes = tree.tips();
        nodes.retain(|&node| tree.parents()[node as usize] != NO_PARENT);
        let at = |node: u32| tree.positions()[node as usize];
        let curve = Curve::around(nodes.iter().map(|&node| at(node)), 1.0);
        let place = |number: usize| (curve.key(at(nodes[number])), nodes[number]);
        let mut places: Vec<(u64, u32)> = pace.part(0.0..0.2).collect(nodes.len(), place).await;
        pace.part(0.2..0.6).sort(&mut places).await;
        let slots: Vec<(u32, Vec3)> = places.into_iter().map(|(_, node)| (node, at(node))).collect();
        let boxes = PackedBoxes::new(slots.len(), |slot| (slots[slot].1, slots[slot].1), &pace.part(0.6..1.0)).await;
        Self { boxes, slots }
    }

    /// The terminals nearest to a point with their squared distances, the nearest first; of equally near ones, the
    /// lower nodes first. Infinitely far if there is none, or if the point is not finite.
    fn nearest(&self, point: Vec3) -> [(f32, u32); TissueSupply::NEAREST] {
        let mut found = [(f32::INFINITY, u32::MAX); TissueSupply::NEAREST];
        if point.is_finite() {
            let visit = |slot: usize, _: f32| {
                let (node, position) = self.slots[slot];
                let mut offer = (position.distance_squared(point), node);
                for place in &mut found {
                    if offer < *place {
                        std::mem::swap(&mut offer, place);
                    }
                }
                found[TissueSupply::NEAREST - 1].0
            };
            self.boxes.best_first(f32::INFINITY, |pack| pack.distances_squared(point), visit);
        }
        found
    }
}

/// The terminals that supply every vertex of an organ, with their weights.
///
/// Built once for a tree and a mesh. Each update only gathers values.
#[derive(Clone, Debug, Default)]
pub struct TissueSupply {
    /// Terminals of every vertex, at most [`Self::NEAREST`], with weights that add up to 1.
    sources: Vec<[(u32, f32); Self::NEAREST]>,
    vertices: Vec<f32>,
}

impl TissueSupply {
    /// Number of terminals that supply a vertex.
    pub const NEAREST: usize = 4;

    /// Finds the terminals nearest to every vertex. Positions are in tissue lengths.
    ///
    /// Their weights fall with the square of their distance, so that the supply is smooth between them. Vertices count
    /// as supplied if the tree has no terminals or they are not finite.
    pub fn new(tree: &VesselTree, vertices: &[Vec3]) -> Self {
        at_once(Self::new_paced(tree, vertices, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn new_paced(tree: &VesselTree, vertices: &[Vec3], pace: &Pace) -> Self {
        let terminals = Terminals::of(tree, &pace.part(0.0..0.2)).await;
        let mut supply =
            Self { sources: vec![[(0, 0.0); Self::NEAREST]; vertices.len()], vertices: vec![1.0; vertices.len()] };
        let sources = &mut supply.sources;
        let find = |stretch: Range<usize>| {
            for (sources, &vertex) in sources[stretch.clone()].iter_mut().zip(&vertices[stretch]) {
                let found = terminals.nearest(vertex);
                let found = found.iter().filter(|(distance, _)| distance.is_finite());
                let farthest = found.clone().map(|&(distance, _)| distance).fold(0.0, f32::max);
                // A vertex that lies on a terminal is supplied almost only by it.
                let weight = |distance: f32| 1.0 / (distance + 1e-6 * farthest).max(f32::MIN_POSITIVE);
                let total: f64 = found.clone().map(|&(distance, _)| f64::from(weight(distance))).sum();
                for (source, &(distance, node)) in sources.iter_mut().zip(found) {
                    *source = (node, (f64::from(weight(distance)) / total) as f32);
                }
            }
        };
        pace.part(0.2..1.0).stretches(vertices.len(), SHORT_STRETCH, find).await;
        supply
    }

    /// Takes over the supply of all segments, from [`Supply::segments`].
    ///
    /// # Panics
    /// If there are fewer segments than when this was made.
    pub fn update(&mut self, segments: &[f32]) {
        for (vertex, sources) in self.vertices.iter_mut().zip(&self.sources) {
            let lacking: f32 = sources
                .iter()
                .filter(|&&(_, weight)| weight > 0.0)
                .map(|&(node, weight)| weight * (1.0 - segments[node as usize]))
                .sum();
            *vertex = (1.0 - lacking).clamp(0.0, 1.0);
        }
    }

    /// Supply of every vertex, from 0 to 1.
    pub fn vertices(&self) -> &[f32] {
        &self.vertices
    }

    /// Share of the tissue whose supply is below `threshold`, from 0 to 1; 0 for an organ without vertices.
    ///
    /// `areas` gives the amount of tissue of each vertex, in any unit. Without it all count alike.
    ///
    /// # Panics
    /// If the number of areas differs from that of vertices.
    pub fn ischaemic_share(&self, threshold: f32, areas: Option<&[f32]>) -> f32 {
        assert!(areas.is_none_or(|areas| areas.len() == self.vertices.len()), "one area per vertex");
        let area = |vertex: usize| areas.map_or(1.0, |areas| f64::from(areas[vertex]));
        let (mut all, mut lacking) = (0.0, 0.0);
        for (vertex, &supply) in self.vertices.iter().enumerate() {
            all += area(vertex);
            lacking += if supply < threshold { area(vertex) } else { 0.0 };
        }
        if all > 0.0 { (lacking / all) as f32 } else { 0.0 }
    }
}
