//! Errors of trees.

use bevy_math::Vec3;

/// Errors in the arrays of a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TreeError {
    /// The arrays have different lengths.
    #[error("a tree of {positions} positions has {parents} parents and {radii} radii; give one of each per node")]
    Lengths {
        /// Number of positions.
        positions: usize,
        /// Number of parents.
        parents: usize,
        /// Number of radii.
        radii: usize,
    },
    /// More nodes than indices can count.
    #[error("a tree of {nodes} nodes is too large; split it into trees of fewer than 2^32 nodes")]
    TooManyNodes {
        /// Number of nodes.
        nodes: usize,
    },
    /// A parent that does not come before its child.
    #[error("node {node} has parent {parent}; sort the nodes so that every parent comes before its children")]
    ParentNotBefore {
        /// The child.
        node: usize,
        /// Its parent.
        parent: u32,
    },
    /// A position that is infinite or NaN.
    #[error("node {node} lies at {position}; every coordinate must be a finite number")]
    Position {
        /// The node.
        node: usize,
        /// Its position.
        position: Vec3,
    },
    /// A radius that is zero, negative, infinite or NaN.
    #[error("node {node} has radius {radius}; every radius must be finite and above 0")]
    Radius {
        /// The node.
        node: usize,
        /// Its radius.
        radius: f32,
    },
}
