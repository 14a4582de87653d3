//! Networks with loops: as many handles as loops, and nothing else changed.

use crate::measures::{loops_of, volume};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    io::{SwcReadOptions, load_swc},
    surface::{ClosingVessel, Surface, SurfaceError, SurfaceSettings},
    tree::{NO_PARENT, NodeId, VesselTree},
};
use std::{f64::consts::PI, path::Path};

/// A polygon whose last side is open, with a leg from each corner if wished.
fn polygon(corners: u32, has_legs: bool) -> VesselTree {
    let at = |corner: u32| {
        Vec3::new((TURN * corner as f32 / corners as f32).cos(), (TURN * corner as f32 / corners as f32).sin(), 0.0)
    };
    let mut positions: Vec<Vec3> = (0..corners).map(at).collect();
    let mut parents: Vec<u32> = (0..corners).map(|corner| corner.wrapping_sub(1)).collect();
    if has_legs {
        positions.extend((0..corners).map(|corner| 1.8 * at(corner)));
        parents.extend(0..corners);
    }
    let radii = vec![0.1; positions.len()];
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

const TURN: f32 = std::f32::consts::TAU;

fn closed(tree: &VesselTree, closing: &[ClosingVessel], settings: &SurfaceSettings, handles: i64) -> Surface {
    let surface = Surface::looped(tree, closing, settings).expect("a surface");
    let check = surface.mesh.validate();
    assert!(check.is_sound(), "{:?}", check.vessels);
    assert_eq!(check.closure.euler(), 2 * (check.closure.components as i64 - handles));
    assert!(surface.report.unclosed.is_empty());
    assert!(surface.mesh.nodes.iter().all(|&node| (node as usize) < tree.len()));
    surface
}

#[test]
fn a_polygon_is_a_ring_with_and_without_legs() {
    for sides in [4, 8, 16] {
        let settings = SurfaceSettings { most_sides: sides, least_sides: sides, ..SurfaceSettings::default() };
        for corners in [3, 4, 5, 12] {
            for has_legs in [false, true] {
                let tree = polygon(corners, has_legs);
                for (a, b) in [(corners - 1, 0), (0, corners - 1)] {
                    closed(&tree, &[ClosingVessel::between(&tree, NodeId(a), NodeId(b))], &settings, 1);
                }
            }
        }
    }
}

/// Pappus: the volume of a torus is that of its section times the way of its middle.
#[test]
fn a_ring_of_many_corners_is_a_torus() {
    let tree = polygon(60, false);
    let surface =
        closed(&tree, &[ClosingVessel::between(&tree, NodeId(59), NodeId(0))], &SurfaceSettings::default(), 1);
    let exact = 2.0 * PI * PI * f64::from(0.1f32).powi(2);
    assert!((volume(&surface.mesh) / exact - 1.0).abs() < 0.02, "{} of {exact}", volume(&surface.mesh));
    // Nothing marks the place where it was cut: all vertices lie on the torus.
    for position in &surface.mesh.positions {
        let distance = (position.truncate().length() - 1.0).hypot(position.z);
        assert!((distance / 0.1 - 1.0).abs() < 0.05, "{distance} at {position}");
    }
}

#[test]
fn a_ladder_has_as_many_handles_as_rungs_that_close_it() {
    // Two rails, joined by the first rung; the others close loops.
    let mut nodes = vec![(Vec3::ZERO, NO_PARENT), (Vec3::Y, 0)];
    for step in 1..8u32 {
        let before = 2 * step - 2;
        nodes.extend([(Vec3::X * step as f32, before), (Vec3::X * step as f32 + Vec3::Y, before + 1)]);
    }
    let (positions, parents): (Vec<_>, Vec<_>) = nodes.into_iter().unzip();
    let tree = VesselTree::from_arrays(positions, parents, vec![0.08; 16]).expect("a tree");
    let rung = |step: u32| ClosingVessel { ends: [NodeId(2 * step), NodeId(2 * step + 1)], radius: 0.05 };
    let rungs: Vec<_> = (1..8).map(rung).collect();
    for count in 0..=rungs.len() {
        closed(&tree, &rungs[..count], &SurfaceSettings::default(), count as i64);
    }
}

#[test]
fn a_vessel_between_two_trees_makes_them_one() {
    let positions = vec![Vec3::ZERO, Vec3::Z, Vec3::X, Vec3::X + Vec3::Z];
    let tree = VesselTree::from_arrays(positions, vec![NO_PARENT, 0, NO_PARENT, 2], vec![0.1; 4]).expect("a forest");
    let surface = closed(&tree, &[ClosingVessel::between(&tree, NodeId(1), NodeId(3))], &SurfaceSettings::default(), 0);
    assert_eq!(surface.mesh.closure().components, 1);
}

#[test]
fn closing_vessels_that_cannot_be_are_refused() {
    let tree = polygon(4, false);
    let refused = |ends: [u32; 2], radius: f32| {
        let vessel = ClosingVessel { ends: ends.map(NodeId), radius };
        Surface::looped(&tree, &[vessel], &SurfaceSettings::default()).expect_err("a wrong vessel")
    };
    assert_eq!(refused([0, 4], 0.1), SurfaceError::ClosingNode { node: NodeId(4), nodes: 4 });
    assert_eq!(refused([2, 2], 0.1), SurfaceError::ClosingLength { ends: [NodeId(2); 2] });
    let ends = [NodeId(0), NodeId(3)];
    assert_eq!(refused([0, 3], 0.0), SurfaceError::ClosingRadius { ends, radius: 0.0 });
    for radius in [f32::NAN, -1.0, f32::INFINITY] {
        assert!(matches!(refused([0, 3], radius), SurfaceError::ClosingRadius { .. }));
    }
    assert!(refused([0, 4], 0.1).to_string().contains("the tree has 4 nodes"));
}

/// The closing vessels of these are shorter than they are wide.
#[test]
fn real_networks_have_as_many_handles_as_loops() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/vessels"));
    for name in ["vascpy_one_loop", "microvesselchaste_tapmeier"] {
        let path = folder.join(format!("{name}.swc"));
        if !path.exists() {
            println!("skipped: no {}", path.display());
            continue;
        }
        let tree = load_swc(&path, &SwcReadOptions { least_radius: Some(1.0) }).expect(name);
        let closing = loops_of(&folder.join(format!("{name}.loop_edges.csv")), &tree);
        let surface = Surface::looped(&tree, &closing, &SurfaceSettings::default()).expect(name);
        let closure = surface.mesh.closure();
        assert!(closure.is_closed() && closure.is_oriented() && closure.is_manifold(), "{name}: {closure:?}");
        let trees = tree.roots().count() as i64;
        assert_eq!((closure.components as i64, closure.euler()), (trees, 2 * (trees - closing.len() as i64)), "{name}");
    }
}
