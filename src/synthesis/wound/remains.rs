//! The tree that is left of a cut one.
//!
//! In: a tree with its [`Wounds`]. Out: [`Remains`], a tree of the remaining pieces: cut ends are tips and roots, and
//! what was severed is a tree of its own. Products that know nothing of wounds, such as a closed surface, take it in
//! place of the whole tree.

use crate::synthesis::{
    pace::{Pace, at_once},
    segment_index::start_radius,
    tree::{NO_PARENT, NodeId, Place, VesselTree},
    wound::{PieceKind, SegmentPiece, Wounds},
};
use bevy_math::Vec3;

/// Largest share of a piece that its ends may be drawn in.
const MOST_DRAWN_IN: f32 = 0.9;

/// No node.
const NONE: u32 = u32::MAX;

/// What is left of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Remains {
    /// The remaining pieces, as a tree of their own. Without wounds it is the tree itself.
    pub tree: VesselTree,
    /// The place in the whole tree of each node of [`tree`](Self::tree), in rising order of nodes: at the end of a
    /// segment for a node that both trees have, within a segment for a cut end.
    pub places: Vec<Place>,
}

impl Remains {
    /// What wounds leave of their tree.
    ///
    /// `reach` is for products whose closed ends reach beyond a tip: cut ends are drawn in by so much, so that gaps stay
    /// as wide as in the ledger, but never by more than nine tenths of a piece. Units: radii of the vessel; 0 for ends
    /// exactly as in the ledger.
    ///
    /// Every remaining part of a segment is there once, and in one piece. Segments of the ledger that the tree doesn't
    /// have are left out. The cost is that of the whole tree.
    pub fn of(wounds: &Wounds, tree: &VesselTree, reach: f32) -> Self {
        at_once(Self::of_paced(wounds, tree, reach, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn of_paced(wounds: &Wounds, tree: &VesselTree, reach: f32, pace: &Pace) -> Self {
        let mut nodes = Nodes { holds: vec![false; tree.len()], has_children: vec![false; tree.len()] };
        pace.part(0.0..0.3).each(tree.len(), |node| nodes.note(wounds, tree, node)).await;
        let reach = if reach.is_finite() { reach.max(0.0) } else { 0.0 };
        let mut maker = Maker { wounds, tree, reach, nodes, own: vec![NONE; tree.len()], remains: Self::default() };
        pace.part(0.3..1.0).each(tree.len(), |node| maker.add(node)).await;
        maker.remains
    }

    /// Writes the present positions of all nodes, from those of the whole tree: `tree` with moved nodes.
    ///
    /// # Panics
    /// If the tree has fewer nodes than it had.
    pub fn positions_into(&self, tree: &VesselTree, positions: &mut Vec<Vec3>) {
        positions.clear();
        positions.extend(self.places.iter().map(|&place| tree.position_at(place)));
    }
}

/// Which nodes of a tree remain.
struct Nodes {
    /// Whether some piece ends in the node or begins there.
    holds: Vec<bool>,
    has_children: Vec<bool>,
}

impl Nodes {
    fn note(&mut self, wounds: &Wounds, tree: &VesselTree, node: usize) {
        let parent = tree.parents()[node];
        if parent == NO_PARENT {
            return;
        }
        let (parent, segment) = (parent as usize, NodeId(node as u32));
        self.has_children[parent] = true;
        if !wounds.is_severed(segment) {
            (self.holds[node], self.holds[parent]) = (true, true);
            return;
        }
        for piece in wounds.pieces(segment) {
            match piece.kind {
                PieceKind::Proximal => self.holds[parent] = true,
                PieceKind::Distal => self.holds[node] = true,
                PieceKind::Floating => {}
            }
        }
    }

    /// Whether a node remains. A root that never had a segment does, too.
    fn remains(&self, tree: &VesselTree, node: usize) -> bool {
        self.holds[node] || (tree.parents()[node] == NO_PARENT && !self.has_children[node])
    }
}

struct Maker<'a> {
    wounds: &'a Wounds,
    tree: &'a VesselTree,
    reach: f32,
    nodes: Nodes,
    /// For each node of the whole tree, that of the remains; `NONE` for one that is gone.
    own: Vec<u32>,
    remains: Remains,
}

impl Maker<'_> {
    /// Adds what is left of a node's segment, and the node itself.
    fn add(&mut self, node: usize) {
        let (segment, parent) = (NodeId(node as u32), self.tree.parents()[node]);
        if parent != NO_PARENT && !self.wounds.is_severed(segment) {
            self.own[node] = self.push(self.own[parent as usize], segment, 1.0);
            return;
        }
        for piece in self.wounds.pieces(segment).filter(|_| parent != NO_PARENT) {
            let [from, to] = self.drawn_in(&piece);
            match piece.kind {
                PieceKind::Proximal => drop(self.push(self.own[parent as usize], segment, to)),
                PieceKind::Floating => {
                    let start = self.push(NONE, segment, from);
                    self.push(start, segment, to);
                }
                PieceKind::Distal => {
                    let start = self.push(NONE, segment, from);
                    self.own[node] = self.push(start, segment, 1.0);
                }
            }
        }
        if self.own[node] == NONE && self.nodes.remains(self.tree, node) {
            self.own[node] = self.push(NONE, segment, 1.0);
        }
    }

    /// Appends a node at a share of a segment, and returns it.
    fn push(&mut self, parent: u32, segment: NodeId, along: f32) -> u32 {
        let (place, node) = (Place::new(segment, along), segment.index());
        let (position, radius) = if along < 1.0 {
            (self.tree.position_at(place), self.radius_at(node, along))
        } else {
            (self.tree.positions()[node], self.tree.radii()[node])
        };
        self.remains.places.push(place);
        let tree = &mut self.remains.tree;
        if parent == NONE {
            tree.push_root(position, radius).0
        } else {
            tree.push_child(NodeId(parent), position, radius).0
        }
    }

    /// Radius at a share of a segment, which tapers from its start.
    fn radius_at(&self, node: usize, along: f32) -> f32 {
        let start = start_radius(self.tree, node);
        start + (self.tree.radii()[node] - start) * along
    }

    /// The shares of a piece whose cut ends have been drawn in.
    fn drawn_in(&self, piece: &SegmentPiece) -> [f32; 2] {
        let (node, [from, to]) = (piece.node.index(), [piece.from, piece.to]);
        let length = self.tree.segment_vector(node).length();
        let is_cut = [piece.kind != PieceKind::Proximal, piece.kind != PieceKind::Distal];
        let size = |along: f32| self.reach * self.radius_at(node, along) / length;
        let [back, ahead] =
            [(from, is_cut[0]), (to, is_cut[1])].map(|(along, cut)| if cut { size(along) } else { 0.0 });
        let fit = (MOST_DRAWN_IN * (to - from) / (back + ahead)).min(1.0);
        // Without a length or a radius there is nothing to draw in.
        if fit.is_nan() || !(back + ahead).is_finite() {
            return [from, to];
        }
        [from + fit * back, to - fit * ahead]
    }
}

impl Wounds {
    /// A number that tells what is left of the tree: it changes when a cut or its undo changes that, and not with clamps
    /// and ties. The cost is that of the injured segments.
    pub fn shape(&self) -> u64 {
        // FNV-1a, over whole words.
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut enter = |word: u64| hash = (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
        for (node, injury) in self.injuries().filter(|(_, injury)| !injury.gaps().is_empty()) {
            enter(u64::from(node.0));
            for gap in injury.gaps() {
                enter(u64::from(gap.from.to_bits()) << 32 | u64::from(gap.to.to_bits()));
            }
        }
        hash
    }
}
