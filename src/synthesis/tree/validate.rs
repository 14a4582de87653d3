//! Checks whether a tree is well formed, and how much it deviates from Murray's law.

pub use super::error::TreeError;

use super::{NO_PARENT, VesselTree};
use bevy_math::ops;

impl VesselTree {
    /// Checks every invariant of a tree: arrays of equal length, parents before children, finite positions, finite
    /// radii above zero. An empty tree and a forest are well formed.
    ///
    /// # Errors
    /// The first broken invariant, with the node and the value.
    pub fn validate(&self) -> Result<(), TreeError> {
        let (positions, parents, radii) = (self.positions().len(), self.parents().len(), self.radii().len());
        if positions != parents || positions != radii {
            return Err(TreeError::Lengths { positions, parents, radii });
        }
        if positions >= NO_PARENT as usize {
            return Err(TreeError::TooManyNodes { nodes: positions });
        }
        for (node, &parent) in self.parents().iter().enumerate() {
            if parent != NO_PARENT && parent as usize >= node {
                return Err(TreeError::ParentNotBefore { node, parent });
            }
            let position = self.positions()[node];
            if !position.is_finite() {
                return Err(TreeError::Position { node, position });
            }
            let radius = self.radii()[node];
            if !(radius.is_finite() && radius > 0.0) {
                return Err(TreeError::Radius { node, radius });
            }
        }
        Ok(())
    }

    /// The largest relative error of Murray's law over all nodes with children: `|r_p^κ − Σ r_c^κ| / r_p^κ`, where p is
    /// the node, c its children and κ the `exponent`. 0 for a tree in which no node has children.
    ///
    /// The terms are computed as `(r_c / r_p)^κ`, so that small radii do not underflow for κ = 3, and summed in f64.
    ///
    /// Source: Murray, "The physiological principle of minimum work" (1926), in the general form of Rauch & Harders 2021,
    /// section 2.
    pub fn murray_residual(&self, exponent: f32) -> f32 {
        let mut sums = vec![0.0f64; self.len()];
        let mut has_child = vec![false; self.len()];
        for (node, parent) in self.segments() {
            let ratio = self.radii()[node] / self.radii()[parent];
            sums[parent] += f64::from(ops::powf(ratio, exponent));
            has_child[parent] = true;
        }
        let residual = |(sum, has_child): (f64, bool)| if has_child { (1.0 - sum).abs() } else { 0.0 };
        sums.into_iter().zip(has_child).map(residual).fold(0.0, f64::max) as f32
    }
}
