//! Which tissue gets blood: supply of every segment and of every vertex of the organ.
//!
//! The supply of a segment is the flow that reaches the bed through the terminals below it, over what reached it in the
//! intact network: 1 where nothing has changed, 0 below a clamp. The supply of a vertex is that of the terminals next to
//! it. A simulator colours by it, and scores how much tissue is left without.

use crate::synthesis::haemodynamics::{FlowError, Network};
use crate::synthesis::tree::{NO_PARENT, VesselTree};
use bevy_math::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZeroUsize;

/// The supply of every segment of a tree.
#[derive(Clone, Debug, Default)]
pub struct Supply {
    /// Flow into the bed below every node in the intact network, in m³/s.
    intact: Vec<f64>,
    sums: Vec<f64>,
    segments: Vec<f32>,
}

impl Supply {
    /// The supply of a network, compared with the same without interruptions at the mean of its settings' root pressure.
    ///
    /// Make it anew after the tree has grown.
    ///
    /// # Errors
    /// When the intact network can't be solved.
    ///
    /// # Panics
    /// When the network is of another tree.
    pub fn new(tree: &VesselTree, network: &Network) -> Result<Self, FlowError> {
        let mut intact = network.clone();
        intact.set_interruptions(&[])?;
        intact.set_bed_pressure(intact.settings().bed.pressure)?;
        intact.set_root_pressure(intact.settings().root.mean())?;
        intact.solve()?;
        Ok(Self::against(tree, &intact))
    }

    /// The supply compared with that of a network as it is, which has been solved: for one that is joined with another,
    /// before the first wound.
    ///
    /// # Panics
    /// When the network is of another tree.
    pub fn against(tree: &VesselTree, intact: &Network) -> Self {
        let mut flows: Vec<f64> = (0..tree.len()).map(|node| intact.bed_flow(node)).collect();
        tree.fold_to_roots(&mut flows, |parent, child| *parent += child);
        Self { intact: flows, segments: vec![1.0; tree.len()], ..Self::default() }
    }

    /// Takes over the flows of a network that has been solved.
    ///
    /// A terminal whose flow runs backwards counts as having none: what the bed gives back supplies no tissue. A segment
    /// that never fed a terminal has nothing to lose, and counts as supplied.
    ///
    /// # Panics
    /// When tree or network have another number of nodes than when this was made.
    pub fn update(&mut self, tree: &VesselTree, network: &Network) {
        assert_eq!(self.intact.len(), network.len(), "one network, that the supply was made for");
        self.sums.clear();
        // Veins drain: their flows are negative throughout.
        let forwards = |node: usize| network.bed_flow(node) * self.intact[node].signum();
        self.sums.extend((0..tree.len()).map(|node| forwards(node).max(0.0)));
        tree.fold_to_roots(&mut self.sums, |parent, child| *parent += child);
        for ((segment, &sum), &intact) in self.segments.iter_mut().zip(&self.sums).zip(&self.intact) {
            *segment = if intact == 0.0 { 1.0 } else { (sum / intact.abs()).min(1.0) as f32 };
        }
    }

    /// Supply of every segment, from 0 to 1, by the node that it ends in.
    pub fn segments(&self) -> &[f32] {
        &self.segments
    }

    /// Share of the bed, weighted by what each terminal fed, whose terminals have a supply below `threshold`; from 0 to
    /// 1, and 0 for a tree without terminals.
    ///
    /// # Panics
    /// When the tree has another number of nodes than when this was made.
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

/// Which terminals supply every vertex of an organ, and how much.
///
/// Built once for a tree and a mesh; then each update is a gather.
#[derive(Clone, Debug, Default)]
pub struct TissueSupply {
    /// Terminals of every vertex, [`Self::NEAREST`] at most, with weights that add up to 1.
    sources: Vec<[(u32, f32); Self::NEAREST]>,
    vertices: Vec<f32>,
}

impl TissueSupply {
    /// Terminals that supply a vertex.
    pub const NEAREST: usize = 4;

    /// Finds the terminals next to every vertex; positions in tissue lengths.
    ///
    /// Their weights fall with the square of their distance, so that the supply is smooth between them. A tree without
    /// terminals supplies no vertex, and a vertex that is not finite has no neighbours: both count as supplied, having
    /// nothing to lose.
    pub fn new(tree: &VesselTree, vertices: &[Vec3]) -> Self {
        let terminals: Vec<u32> =
            tree.tips().into_iter().filter(|&node| tree.parents()[node as usize] != NO_PARENT).collect();
        let none =
            Self { sources: vec![[(0, 0.0); Self::NEAREST]; vertices.len()], vertices: vec![1.0; vertices.len()] };
        let points: Vec<[f32; 3]> = terminals.iter().map(|&node| tree.positions()[node as usize].to_array()).collect();
        if points.is_empty() {
            return none;
        }
        // Fails only on more points than a u32 counts, which no tree holds.
        let Ok(index) = ImmutableKdTree::<f32, 3>::new_from_slice(&points) else { return none };
        let Some(nearest) = NonZeroUsize::new(Self::NEAREST.min(points.len())) else { return none };
        let mut supply = none;
        for (sources, vertex) in supply.sources.iter_mut().zip(vertices).filter(|(_, vertex)| vertex.is_finite()) {
            let query = vertex.to_array();
            let found = index.query(&query).nearest_n::<SquaredEuclidean<f32>>(nearest).execute();
            let farthest = found.iter().map(|near| near.distance).fold(0.0, f32::max);
            // Where a vertex lies on a terminal, that one supplies it nearly alone.
            let weight = |distance: f32| 1.0 / (distance + 1e-6 * farthest).max(f32::MIN_POSITIVE);
            let total: f64 = found.iter().map(|near| f64::from(weight(near.distance))).sum();
            for (source, near) in sources.iter_mut().zip(&found) {
                *source = (terminals[near.item as usize], (f64::from(weight(near.distance)) / total) as f32);
            }
        }
        supply
    }

    /// Takes over the supply of all segments, from [`Supply::segments`].
    ///
    /// # Panics
    /// When there are fewer segments than when this was made.
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
    /// `areas` says how much tissue each vertex stands for, in any unit. Without it all count alike.
    ///
    /// # Panics
    /// When there are areas, and not one per vertex.
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
