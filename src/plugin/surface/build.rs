//! The work of making the surfaces of a vessel entity, in any thread.
//!
//! In: a copy of the tree at rest and of its wounds. Out: a [`Built`]: one surface for each level of detail, as Bevy
//! meshes, too, and bound to the nodes if these may move.

use crate::plugin::surface::{
    mesh::{box_around, mesh_around},
    messages::VesselSurfaceError,
};
use crate::synthesis::{
    binding::Skin,
    pace::Pace,
    surface::{Surface, SurfaceError, SurfaceSettings},
    tree::VesselTree,
    wound::{Remains, Wounds},
};
use bevy::{camera::primitives::Aabb, math::Vec3, mesh::Mesh};
use std::{ops::Range, sync::Arc};

/// How far the round ends of a surface reach beyond its tips, in radii.
const REACH: f32 = 1.0;
/// Room in the box around a surface for rounding, in radii of the widest vessel.
const ROOM: f32 = 0.01;
/// Number of items, as jobs count them, that a node is.
pub(super) const ITEMS: usize = 128;

/// What surfaces are made of.
pub(super) struct Source {
    /// At rest.
    pub tree: VesselTree,
    pub wounds: Option<Wounds>,
    /// Whether the nodes may move.
    pub is_followed: bool,
    /// Settings of the finest level.
    pub settings: SurfaceSettings,
    /// Number of levels.
    pub levels: usize,
}

/// The surfaces of a vessel entity.
#[derive(Debug)]
pub(super) struct Built {
    /// The tree at rest that they were made of, whole: their nodes are its nodes.
    pub tree: Arc<VesselTree>,
    /// What was left of it, if it was cut.
    remains: Option<Remains>,
    /// The finest first.
    pub levels: Vec<BuiltLevel>,
    /// Middle of the box around them at rest: the origin of the Bevy meshes.
    pub origin: Vec3,
    /// The box around them at rest, from the origin.
    pub aabb: Aabb,
    /// Room that boxes need around the vertices.
    room: f32,
}

/// A surface of one level of detail.
#[derive(Debug)]
pub(super) struct BuiltLevel {
    pub surface: Arc<Surface>,
    /// Its vertices, bound to the nodes.
    pub skin: Option<Skin>,
}

impl Built {
    /// Whether the surfaces can follow moving nodes.
    pub fn can_follow(&self) -> bool {
        self.levels.iter().all(|level| level.skin.is_some())
    }

    /// The positions of the nodes to which skins are bound, for the present tree.
    pub fn nodes<'a>(&self, tree: &'a VesselTree, scratch: &'a mut Vec<Vec3>) -> &'a [Vec3] {
        match &self.remains {
            None => tree.positions(),
            Some(remains) => {
                remains.positions_into(tree, scratch);
                scratch
            }
        }
    }

    /// The box around some vertices, from the origin.
    pub fn box_around(&self, vertices: impl Iterator<Item = Vec3>) -> Aabb {
        box_around(vertices, self.origin, self.room)
    }
}

/// Makes surfaces, with a Bevy mesh for each.
pub(super) async fn build(source: Source, pace: Pace) -> Result<(Built, Vec<Mesh>), VesselSurfaceError> {
    let Source { tree, wounds, is_followed, settings, levels } = source;
    let remains = match &wounds {
        Some(wounds) => Some(Remains::of_paced(wounds, &tree, REACH, &pace.part(0.0..0.05)).await),
        None => None,
    };
    let left = remains.as_ref().map_or(&tree, |remains| &remains.tree);
    let (mut built, mut tangents) = (Vec::with_capacity(levels), Vec::with_capacity(levels));
    for level in 0..levels {
        let pace = pace.part(share_of(level, levels));
        let mut surface = surface_of(left, &settings, level, &pace.part(0.0..0.8)).await?;
        let along = surface.mesh.tangents_paced(&pace.part(0.8..0.85)).await;
        let skin = match is_followed {
            true => Some(Skin::with_tangents_paced(&surface.mesh, &along, left, &pace.part(0.85..0.9)).await?),
            false => None,
        };
        tangents.push(along);
        if let Some(remains) = &remains {
            let whole = |node: u32| remains.places.get(node as usize).map_or(node, |place| place.node.0);
            surface.rename_nodes(whole);
        }
        built.push(BuiltLevel { surface: Arc::new(surface), skin });
        pace.rest(1.0).await;
    }
    let widest = tree.widest_radius();
    // One box for all levels, so that each is seen as far to the side as the others.
    let vertices = || built.iter().flat_map(|level| level.surface.mesh.positions.iter().copied());
    let origin = Vec3::from(box_around(vertices(), Vec3::ZERO, 0.0).center);
    let room = ROOM * widest;
    let aabb = box_around(vertices(), origin, room);
    let mut meshes = Vec::with_capacity(built.len());
    for (level, tangents) in built.iter().zip(tangents) {
        meshes.push(mesh_around(&level.surface.mesh, origin, tangents));
        pace.rest(1.0).await;
    }
    Ok((Built { tree: Arc::new(tree), remains, levels: built, origin, aabb, room }, meshes))
}

/// The surface of a tree at a level of detail.
async fn surface_of(
    tree: &VesselTree,
    settings: &SurfaceSettings,
    level: usize,
    pace: &Pace,
) -> Result<Surface, SurfaceError> {
    match level {
        0 => Surface::new_paced(tree, settings, pace).await,
        1 => Surface::coarse_paced(tree, settings, pace).await,
        _ => Ok(Surface::sketch_paced(tree, pace).await),
    }
}

/// The share of all work that a level is: the finest takes most.
fn share_of(level: usize, levels: usize) -> Range<f32> {
    let end = |level: usize| if level == levels { 0.95 } else { 0.95 - 0.9 * 0.3f32.powi(level as i32) };
    end(level)..end(level + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::{pace::at_once, tree::NO_PARENT};

    #[test]
    fn progress_rises_through_all_levels_to_its_end() {
        for levels in 1..=3 {
            let shares: Vec<_> = (0..levels).map(|level| share_of(level, levels)).collect();
            assert!((shares[0].start - 0.05).abs() < 1e-6 && (shares[levels - 1].end - 0.95).abs() < 1e-6);
            assert!(shares.windows(2).all(|pair| pair[0].end == pair[1].start && pair[0].start < pair[0].end));
        }
        let tree =
            VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![0.1; 2]).expect("a tree");
        let pace = Pace::new(|| false);
        let settings = SurfaceSettings::default();
        let source = Source { tree, wounds: None, is_followed: true, settings, levels: 3 };
        let (built, meshes) = at_once(build(source, pace.clone())).expect("a surface");
        assert_eq!((pace.progress(), built.levels.len(), meshes.len(), built.can_follow()), (1.0, 3, 3, true));
    }

    #[test]
    fn an_empty_tree_has_an_empty_surface() {
        let (tree, settings) = (VesselTree::new(), SurfaceSettings::default());
        let source = Source { tree, wounds: None, is_followed: true, settings, levels: 3 };
        let (built, meshes) = at_once(build(source, Pace::default())).expect("a surface");
        assert_eq!((built.levels[0].surface.mesh.positions.len(), meshes[0].count_vertices()), (0, 0));
    }
}
