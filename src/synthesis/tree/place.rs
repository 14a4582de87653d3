//! A place on a vessel: a point of a segment's centre line.

use super::{NO_PARENT, NodeId, VesselTree};
use bevy_math::Vec3;

/// A point of a tree's centre line, between a node's parent and the node.
///
/// Places stay valid while a tree grows, since growth only appends, and while its nodes move.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Place {
    /// The node in which the segment ends.
    pub node: NodeId,
    /// Share of the way from the node's parent to the node. Limits: 0 to 1.
    pub along: f32,
}

impl Place {
    /// The place at a share of a segment, from its end towards the root.
    pub fn new(node: NodeId, along: f32) -> Self {
        Self { node, along }
    }
}

impl VesselTree {
    /// Position of a place. A root has no segment: every place on it is the root itself.
    ///
    /// # Panics
    /// If the node is not in this tree.
    pub fn position_at(&self, place: Place) -> Vec3 {
        let end = self.positions()[place.node.index()];
        match self.parents()[place.node.index()] {
            NO_PARENT => end,
            parent => self.positions()[parent as usize].lerp(end, place.along),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_lies_between_the_ends_of_its_segment() {
        let tree = VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X * 4.0], vec![NO_PARENT, 0], vec![1.0; 2]).unwrap();
        assert_eq!(tree.position_at(Place::new(NodeId(1), 0.25)), Vec3::X);
        assert_eq!(tree.position_at(Place::new(NodeId(0), 0.25)), Vec3::ZERO);
    }
}
