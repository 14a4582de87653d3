//! No-go regions: no attraction point is born in one, no node is placed there, and vessels grow around it.

use super::{Outcome, ball_soup};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationError, ColonizationSettings},
    mesh::TriangleMesh,
    roots::{RootError, RootPlacement, RootPlacements, Roots},
    tissue::*,
    tree::{NO_PARENT, VesselKind, VesselTree, hash_trees},
};
use std::sync::Arc;

const KINDS: [VesselKind; 2] = Colonization::KINDS;
/// A ball of this radius around a point of the organ's surface, which is a ball of radius 1.
const REGION: NoGoRegion = NoGoRegion::Ball { center: Vec3::X, radius: 0.5 };

fn modes() -> [TissueMode; 3] {
    [TissueMode::Surface, TissueMode::Volume, TissueMode::Staged { surface_steps: 25 }]
}

fn prepared(mode: TissueMode) -> Result<PreparedTissue, Box<dyn std::error::Error>> {
    Ok(MeshTissue { mode, resolution: 24 }.prepare(ball_soup(24, false)?)?)
}

fn no_go(no_go: NoGo) -> TissuePaint {
    TissuePaint { no_go, ..TissuePaint::default() }
}

fn regions(regions: impl Into<Vec<NoGoRegion>>) -> TissuePaint {
    no_go(NoGo { regions: regions.into(), ..NoGo::default() })
}

/// Vertices in the region, and the points that they forbid by the nearest corner: wrong by at most an edge.
fn painted(mesh: &TriangleMesh) -> TissuePaint {
    let vertices = mesh.positions().iter().map(|&position| REGION.contains(position)).collect();
    no_go(NoGo { vertices: Some(vertices), ..NoGo::default() })
}

fn settings() -> ColonizationSettings {
    ColonizationSettings { steps: 70, samples: 800, ..ColonizationSettings::default() }
}

/// Grows step by step, and checks after each that nothing is at a forbidden point.
fn grow(tissue: &Arc<dyn Tissue>, roots: &Roots, seed: u64, forbidden: impl Fn(Vec3) -> bool) -> Colonization {
    grow_by(settings().fit(tissue.extent()), tissue, roots, seed, forbidden)
}

fn grow_by(
    settings: ColonizationSettings,
    tissue: &Arc<dyn Tissue>,
    roots: &Roots,
    seed: u64,
    forbidden: impl Fn(Vec3) -> bool,
) -> Colonization {
    let mut growth = Colonization::new(tissue.clone(), settings, roots, seed).expect("a growth");
    let mut known = [0; 2];
    while !growth.is_finished() {
        let step = growth.step().step;
        for (kind, known) in KINDS.into_iter().zip(&mut known) {
            let nodes = &growth.tree(kind).positions()[*known..];
            *known += nodes.len();
            let node = nodes.iter().find(|&&node| forbidden(node));
            assert_eq!(node, None, "seed {seed}, step {step}: a node of the {kind:?}s");
            let drain = growth.drains(kind).find(|&drain| forbidden(drain));
            assert_eq!(drain, None, "seed {seed}, step {step}: a drain of the {kind:?}s");
        }
    }
    growth
}

#[test]
fn no_drain_is_born_and_no_node_is_placed_in_a_region() -> Outcome {
    for mode in modes() {
        let prepared = prepared(mode)?;
        let tissue = prepared.painted(&regions([REGION]))?;
        for seed in 0..3 {
            // Without the region, vessels grow there, so the test can fail.
            let free = grow(prepared.tissue(), &Roots::default(), seed, |_| false);
            let there = free.tree(VesselKind::Artery).positions().iter().filter(|&&node| REGION.contains(node)).count();
            let growth = grow(&tissue, &Roots::default(), seed, |point| REGION.contains(point));
            let nodes = growth.tree(VesselKind::Artery).len();
            assert!(there > 20 && nodes > 300, "{mode:?}, seed {seed}: {there} nodes there, {nodes} in all");
        }
    }
    Ok(())
}

#[test]
fn painted_vertices_forbid_what_is_nearest_to_them() -> Outcome {
    let mesh = ball_soup(24, false)?;
    for mode in modes() {
        let tissue = prepared(mode)?.painted(&painted(&mesh))?;
        for seed in 0..2 {
            // Towards the middle the same part of the surface is nearest. An edge is 0.1 long.
            let below = |point: Vec3, radius: f32| point.length() > 0.2 && point.normalize().distance(Vec3::X) < radius;
            let growth = grow(&tissue, &Roots::default(), seed, |point| below(point, 0.38));
            let near = growth.tree(VesselKind::Artery).positions().iter().filter(|&&node| below(node, 0.68)).count();
            assert!(near > 5, "{mode:?}, seed {seed}: {near} nodes near what is painted");
        }
    }
    Ok(())
}

/// A ball between the root and the other side of a rectangle and a box.
#[test]
fn vessels_go_round_and_supply_the_other_side() -> Outcome {
    let rectangle = TissueShape::Rectangle { center: Vec3::ZERO, half_x: Vec3::X * 0.5, half_y: Vec3::Y * 0.5 };
    let roots =
        Roots::from(RootPlacements { artery: RootPlacement::Exact(vec![Vec3::X * -0.4]), ..RootPlacements::default() });
    for (shape, radius, steps) in [(rectangle, 0.25, 90), (TissueShape::cuboid(Vec3::new(1.0, 1.0, 0.4)), 0.15, 110)] {
        let region = NoGoRegion::Ball { center: Vec3::ZERO, radius };
        let in_its_shadow = |node: &&Vec3| node.x > radius && node.y.abs() < radius;
        let prepared = TissueSource::from(shape).prepare(&SourceData::default())?;
        let tissue = prepared.painted(&regions([region]))?;
        let settings = ColonizationSettings { steps, ..settings() }.fit(tissue.extent());
        for seed in 0..3 {
            let open = grow_by(settings.clone(), prepared.tissue(), &roots, seed, |_| false);
            let round = grow_by(settings.clone(), &tissue, &roots, seed, |point| region.contains(point));
            for kind in KINDS {
                let [open, round] = [&open, &round].map(|growth| growth.tree(kind));
                let [there, least] = [round, open].map(|tree| tree.positions().iter().filter(in_its_shadow).count());
                assert!(
                    least > 50 && there * 3 > least,
                    "{shape:?}, seed {seed}: {there} {kind:?}s where there would be {least}"
                );
                assert_no_segment_crosses(round, region);
            }
        }
    }
    Ok(())
}

fn assert_no_segment_crosses(tree: &VesselTree, region: NoGoRegion) {
    for (node, &parent) in tree.parents().iter().enumerate() {
        let Some(&from) = tree.positions().get(parent as usize) else { continue };
        let middle = from.midpoint(tree.positions()[node]);
        assert!(!region.contains(middle), "segment {node} leads through {middle}");
    }
}

/// A band all around the organ leaves two parts, each with its own roots.
#[test]
fn parts_that_a_region_cuts_off_have_roots_of_their_own() -> Outcome {
    let band = NoGoRegion::Cuboid { center: Vec3::ZERO, size: Vec3::new(0.4, 4.0, 4.0) };
    for mode in [TissueMode::Surface, TissueMode::Volume] {
        let tissue = prepared(mode)?.painted(&regions([band]))?;
        let growth = grow(&tissue, &Roots::default(), 1, |point| band.contains(point));
        for kind in KINDS {
            let tree = growth.tree(kind);
            for side in [-1.0, 1.0] {
                let there = tree.positions().iter().filter(|node| node.x * side > 0.0).count();
                assert!(there * 4 > tree.len(), "{mode:?}: {there} of {} nodes of the {kind:?}s", tree.len());
            }
        }
    }
    Ok(())
}

#[test]
fn guides_and_roots_keep_out() -> Outcome {
    let guide = Guide { points: vec![Vec3::X, Vec3::new(0.3, 1.0, 0.0), Vec3::NEG_X], deviation: 0.1, steps: 30 };
    for mode in modes() {
        let paint = TissuePaint { guides: vec![guide.clone()], ..regions([REGION]) };
        let tissue = prepared(mode)?.painted(&paint)?;
        // The guide begins where no vessel may be, so the root is elsewhere.
        grow(&tissue, &Roots::default(), 4, |point| REGION.contains(point));
        let place = |artery: RootPlacement| {
            let roots = Roots::from(RootPlacements { artery, ..RootPlacements::default() });
            Colonization::new(tissue.clone(), settings(), &roots, 4).err()
        };
        for artery in [RootPlacement::Exact(vec![Vec3::X * 0.999]), RootPlacement::Nearest(vec![Vec3::X * 2.0])] {
            let error = place(artery);
            assert!(matches!(error, Some(ColonizationError::Roots(RootError::Forbidden { .. }))), "{error:?}");
            assert!(error.is_some_and(|error| error.to_string().contains("no-go")));
        }
        assert_eq!(place(RootPlacement::Spread(7)), None);
    }
    Ok(())
}

#[test]
fn forbidden_as_a_whole_there_is_no_root_and_given_vessels_rest() -> Outcome {
    let everything = NoGoRegion::Cuboid { center: Vec3::ZERO, size: Vec3::splat(9.0) };
    let given = VesselTree::from_arrays(vec![Vec3::X * 0.99], vec![NO_PARENT], vec![0.01])?;
    for mode in modes() {
        let tissue = prepared(mode)?.painted(&regions([everything]))?;
        let error = Colonization::new(tissue.clone(), settings(), &Roots::default(), 1).err();
        assert!(matches!(error, Some(ColonizationError::Roots(RootError::NoRoom { found: 0, .. }))), "{error:?}");
        let mut roots = Roots::from(RootPlacements {
            artery: RootPlacement::None,
            vein: RootPlacement::None,
            ..Default::default()
        });
        roots.given.artery = Some(given.clone());
        let growth = grow(&tissue, &roots, 1, |point| point != Vec3::X * 0.99);
        assert_eq!((growth.tree(VesselKind::Artery).len(), growth.drains_left(VesselKind::Artery)), (1, 0));
    }
    Ok(())
}

#[test]
fn a_region_that_no_vessel_comes_near_changes_nothing() -> Outcome {
    let far = NoGoRegion::Ball { center: Vec3::splat(50.0), radius: 1.0 };
    for mode in modes() {
        let prepared = prepared(mode)?;
        let hash = |tissue: &Arc<dyn Tissue>| {
            let growth = grow(tissue, &Roots::default(), 2, |_| false);
            hash_trees(VesselKind::ALL.map(|kind| growth.tree(kind)))
        };
        assert_eq!(hash(&prepared.painted(&regions([far]))?), hash(prepared.tissue()), "{mode:?}");
    }
    Ok(())
}
