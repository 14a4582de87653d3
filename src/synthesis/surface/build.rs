//! The surface of a tree, with a report of what was done.

use super::builder::{Builder, Built};
use super::cage_mesh::as_it_is;
use super::half_edges::HalfEdges;
use super::limit::finish;
use super::loops::{ClosingVessel, Looped};
use super::mesh::SurfaceMesh;
use super::remake::{Plan, Remade, remake};
use super::report::SurfaceReport;
use super::settings::{SurfaceError, SurfaceSettings};
use super::shape::Shape;
use crate::synthesis::pace::{Pace, at_once};
use crate::synthesis::tree::{NodeId, VesselTree};
use bevy_math::Vec3;

/// The surface of a tree, and what was done for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The mesh.
    pub mesh: SurfaceMesh,
    /// What was done.
    pub report: SurfaceReport,
}

impl Surface {
    /// The surface of a tree; without vertices for an empty one.
    ///
    /// # Errors
    /// Settings out of their limits, and more faces than 32-bit indices can count.
    pub fn new(tree: &VesselTree, settings: &SurfaceSettings) -> Result<Self, SurfaceError> {
        at_once(Self::new_paced(tree, settings, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(tree: &VesselTree, settings: &SurfaceSettings, pace: &Pace) -> Result<Self, SurfaceError> {
        Self::looped_paced(tree, &[], settings, pace).await
    }

    /// The surface of a network with loops: a tree, and the vessels that close its loops. Each of them adds a handle, so
    /// that V − E + F is 2 less, or joins two trees; what could not be closed is in [`SurfaceReport::unclosed`].
    ///
    /// # Errors
    /// Those of [`new`](Self::new); closing vessels between nodes that don't exist or lie at one place, and radii that are
    /// not above 0.
    pub fn looped(
        tree: &VesselTree,
        closing: &[ClosingVessel],
        settings: &SurfaceSettings,
    ) -> Result<Self, SurfaceError> {
        at_once(Self::looped_paced(tree, closing, settings, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`looped`](Self::looped).
    pub async fn looped_paced(
        tree: &VesselTree,
        closing: &[ClosingVessel],
        settings: &SurfaceSettings,
        pace: &Pace,
    ) -> Result<Self, SurfaceError> {
        settings.validate()?;
        let looped = Looped::of(tree, closing)?;
        let shape = Shape::new(settings, looped.tree.widest_radius());
        // Coordinates from the middle of the tree: rounding doesn't depend on where the organ lies.
        let origin = middle(tree.positions());
        let built = Builder::new(&looped, &shape, settings.tips, origin).build_paced(&pace.part(0.0..0.3)).await;
        let Built { cage, trunks, curves, layout, mut report } = built;
        let faces = cage.corners.len() as u64 * 4u64.pow(settings.level.saturating_sub(1));
        if 2 * faces > u64::from(u32::MAX) {
            return Err(SurfaceError::TooManyFaces { faces });
        }
        let mut half_edges = HalfEdges::of_paced(cage, &pace.part(0.3..0.4)).await;
        let mut mesh = if settings.level == 0 {
            as_it_is(half_edges, origin, &pace.part(0.4..1.0)).await
        } else {
            for _ in 1..settings.level {
                half_edges = half_edges.refined_paced(&pace.part(0.4..0.6)).await;
            }
            finish(half_edges, origin, &pace.part(0.6..0.9)).await
        };
        if settings.level > 0 && !layout.doubts.is_empty() {
            let faces_per_corner = 4u32.pow(settings.level - 1);
            let plan = Plan { trunks, curves, layout, origin, faces_per_corner };
            let Remade { remade, left } = remake(&mut mesh, plan, &pace.part(0.9..1.0)).await;
            (report.remade, report.left) = (remade, left);
        }
        let mut surface = Self { mesh, report };
        if looped.len() > 0 {
            surface.rename_nodes(|node| looped.own(node));
        }
        Ok(surface)
    }

    /// Names other nodes in place of those of the tree that it was made of.
    pub(crate) fn rename_nodes(&mut self, name: impl Fn(u32) -> u32) {
        let Self { mesh, report } = self;
        mesh.nodes.iter_mut().for_each(|node| *node = name(*node));
        for nodes in [&mut report.remade, &mut report.left, &mut report.unclosed, &mut report.absorbed] {
            nodes.iter_mut().for_each(|node| *node = NodeId(name(node.0)));
        }
    }
}

/// The middle of the box around some points.
fn middle(points: &[Vec3]) -> Vec3 {
    let Some(&first) = points.first() else { return Vec3::ZERO };
    let (low, high) = points.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)));
    low.midpoint(high)
}
