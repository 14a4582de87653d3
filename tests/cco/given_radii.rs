//! Given trees of any size: a growth with sound trees, or a refusal.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoError, CcoSettings},
    roots::{RootPlacement, RootPlacements, Roots},
    tissue::Disc,
    tree::{ByKind, NO_PARENT, VesselKind, VesselTree},
};
use std::sync::Arc;

#[test]
fn given_trees_of_any_radius_are_sound_or_refused() {
    for radius in [1e-30, 1e-9, 1.0, 1e9, 1e30] {
        let ends = vec![Vec3::Y * 0.5, Vec3::Y * 0.1];
        let given = VesselTree::from_arrays(ends, vec![NO_PARENT, 0], vec![radius; 2]).expect("a tree");
        let placed = RootPlacements { artery: RootPlacement::None, vein: RootPlacement::None, ..Default::default() };
        let roots = Roots { placed, given: ByKind { artery: Some(given), ..ByKind::default() } };
        let settings = CcoSettings { terminals: 20, ..CcoSettings::default() };
        match Cco::new(Arc::new(Disc::flat(0.5).expect("a disc")), settings, &roots, 1) {
            Ok(mut growth) => {
                // Radii follow from the flow, whatever was given.
                growth.run().unwrap_or_else(|error| panic!("{radius}: {error}"));
                let tree = growth.tree(VesselKind::Artery);
                tree.validate().unwrap_or_else(|error| panic!("{radius}: {error}"));
                assert!(tree.radii().iter().all(|&own| own < 0.1), "{radius}");
            }
            Err(CcoError::GivenTree { .. }) => {}
            Err(error) => panic!("{radius}: {error}"),
        }
    }
}
