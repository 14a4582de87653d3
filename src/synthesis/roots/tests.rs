use super::*;
use crate::synthesis::mesh::TriangleMesh;
use crate::synthesis::random::Stream;
use crate::synthesis::tissue::{Ball, Cuboid, Disc, MeshSurface, Rectangle, Tissue, TissueError, TissuePoint};
use crate::synthesis::tree::{ByKind, VesselTree};
use bevy_math::{Vec2, Vec3};

/// The spacing of arteries and veins of space colonization on a disc of diameter 1.
const SPACING: ByKind<Option<RootSpacing>> = ByKind {
    artery: Some(RootSpacing { step: 0.03, reach: 0.065 }),
    vein: Some(RootSpacing { step: 0.03, reach: 0.065 * 2.5 }),
    portal_vein: None,
    duct: None,
};

/// Arteries with this placement, and veins beside them.
fn placed_arteries(artery: RootPlacement) -> Roots {
    RootPlacements { artery, ..RootPlacements::default() }.into()
}

fn at(x: f32, y: f32) -> Vec3 {
    Vec3::new(x, y, 0.0)
}

#[test]
fn the_default_is_an_artery_and_a_vein_beside_it() -> Result<(), TissueError> {
    for tissue in [Box::new(Disc::flat(0.5)?) as Box<dyn Tissue>, Box::new(Ball::new(Vec3::ONE, 0.5)?)] {
        for seed in 0..50 {
            let Ok(roots) = Roots::default().resolve(&*tissue, &SPACING, seed) else {
                panic!("no roots with seed {seed}")
            };
            let ([artery], [vein]) = (&roots.artery[..], &roots.vein[..]) else { panic!("one of each, not {roots:?}") };
            assert!(roots.portal_vein.is_empty() && roots.duct.is_empty());
            let (distance, step) = (artery.position.distance(vein.position), 0.03);
            assert!((distance - step).abs() < 0.2 * step);
            assert!(tissue.contains(artery.position) && tissue.contains(vein.position));
            assert_eq!(artery.normal, tissue.closest_point(artery.position).normal);
            let again = Roots::default().resolve(&*tissue, &SPACING, seed);
            assert_eq!(again, Ok(roots));
        }
    }
    let tissue = Disc::flat(0.5)?;
    let with_seed = |seed| Roots::default().resolve(&tissue, &SPACING, seed);
    assert_ne!(with_seed(1), with_seed(2));
    Ok(())
}

/// What is convex has no hollow: then the seed chooses.
#[test]
fn a_hilum_is_in_a_hollow() -> Result<(), TissueError> {
    let at_hilum = placed_arteries(RootPlacement::Hilum);
    let ball = Ball::new(Vec3::ONE, 0.5)?;
    let root = |seed| at_hilum.resolve(&ball, &SPACING, seed).map(|roots| roots.artery[0].position);
    assert!(root(1).is_ok_and(|root| ball.contains(root)) && root(1) != root(2));
    // A square of edge 3 without its middle at the right: the floor of the slot is at x = 1.
    let corners = [(0., 0.), (3., 0.), (3., 1.), (1., 1.), (1., 2.), (3., 2.), (3., 3.), (0., 3.)];
    let positions = corners.map(|(x, y)| at(x, y)).to_vec();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 7], [4, 5, 6], [4, 6, 7]];
    let slot = MeshSurface::new(TriangleMesh::new(positions, triangles, None)?)?;
    for seed in 0..20 {
        let roots = at_hilum.resolve(&slot, &SPACING, seed).map_err(|error| error.to_string());
        let root = roots.map(|roots| roots.artery[0].position);
        assert!(
            root.as_ref().is_ok_and(|root| (0.9..3.0).contains(&root.x) && (0.9..2.1).contains(&root.y)),
            "{root:?}"
        );
    }
    Ok(())
}

#[test]
fn spread_roots_are_far_apart() -> Result<(), TissueError> {
    let tissue = Disc::flat(0.5)?;
    let roots = placed_arteries(RootPlacement::Spread(12));
    let Ok(ByKind { artery: arteries, vein: veins, .. }) = roots.resolve(&tissue, &SPACING, 3) else {
        panic!("no roots")
    };
    assert_eq!((arteries.len(), veins.len()), (12, 12));
    for (index, root) in arteries.iter().enumerate() {
        let least = arteries[..index].iter().map(|other| other.position.distance(root.position));
        assert!(least.fold(f32::INFINITY, f32::min) > 0.2);
    }
    let many = placed_arteries(RootPlacement::Spread(u32::MAX));
    assert!(matches!(many.resolve(&tissue, &SPACING, 3), Err(RootError::TooMany { .. })));
    let none = placed_arteries(RootPlacement::Spread(0));
    assert_eq!(none.resolve(&tissue, &SPACING, 3), Ok(ByKind::default()));
    Ok(())
}

#[test]
fn given_points_are_taken_or_brought_to_the_tissue() -> Result<(), TissueError> {
    let tissue = Disc::flat(0.5)?;
    let far = vec![at(-2.0, 0.0)];
    let roots: Roots = RootPlacements {
        artery: RootPlacement::Nearest(far.clone()),
        vein: RootPlacement::Exact(vec![Vec3::new(-0.4, 0.0, 0.01)]),
        ..RootPlacements::default()
    }
    .into();
    let Ok(placed) = roots.resolve(&tissue, &SPACING, 0) else { panic!("no roots") };
    assert!(placed.artery[0].position.distance(at(-0.5, 0.0)) < 1e-6);
    assert_eq!(placed.vein[0], TissuePoint::new(Vec3::new(-0.4, 0.0, 0.01), Vec3::Z));

    let with = |artery| placed_arteries(artery).resolve(&tissue, &SPACING, 0);
    let error = with(RootPlacement::Exact(far));
    assert!(matches!(error, Err(RootError::TooFar { distance, .. }) if (distance - 1.5).abs() < 1e-6));
    let error = with(RootPlacement::Nearest(vec![Vec3::NAN]));
    assert!(matches!(error, Err(RootError::NotFinite { .. })));
    let error = with(RootPlacement::Nearest(vec![at(1e38, 0.0)]));
    assert!(matches!(error, Err(RootError::NotFinite { .. })));
    let error = with(RootPlacement::Exact(vec![at(0.1, 0.0), at(0.0, 0.2), at(0.1, 0.0)]));
    assert!(matches!(error, Err(RootError::Coincide { .. })));
    assert_eq!(with(RootPlacement::Beside), Err(RootError::BesideEachOther));
    assert_eq!(with(RootPlacement::None), Ok(ByKind::default()));
    Ok(())
}

#[test]
fn given_trees_must_be_within_reach() -> Result<(), TissueError> {
    let tissue = Disc::flat(0.5)?;
    let with = |position: Vec3| {
        let mut tree = VesselTree::new();
        tree.push_root(position, 0.01);
        let given = ByKind { artery: Some(tree), vein: Some(VesselTree::new()), ..ByKind::default() };
        Roots { given, ..placed_arteries(RootPlacement::None) }.resolve(&tissue, &SPACING, 0)
    };
    let Ok(placed) = with(at(0.3, 0.0)) else { panic!("no roots") };
    assert_eq!((placed.artery.len(), placed.vein.len()), (0, 1));
    assert!(matches!(with(at(30.0, 0.0)), Err(RootError::GivenTooFar { .. })));
    assert!(matches!(with(at(f32::NAN, 0.0)), Err(RootError::GivenNotFinite { node: 0, .. })));
    Ok(())
}

/// Number of samples whose straight distance from all roots exceeds a length.
fn missed(tissue: &dyn Tissue, roots: &[TissuePoint], way: f32) -> usize {
    let mut rng = Stream::Statistics.rng(1);
    let samples = (0..2000).filter_map(|_| tissue.sample(&mut rng));
    samples.filter(|sample| roots.iter().all(|root| root.position.distance(*sample) > way)).count()
}

#[test]
fn compact_tissues_have_one_root_and_long_ones_several_within_reach() -> Result<(), Box<dyn std::error::Error>> {
    let spread = placed_arteries(RootPlacement::Spread(1));
    for tissue in [Box::new(Disc::flat(0.5)?) as Box<dyn Tissue>, Box::new(Ball::new(Vec3::ONE, 0.5)?)] {
        for seed in 0..50 {
            let roots = Roots::default().resolve(&*tissue, &SPACING, seed)?;
            assert_eq!(roots, spread.resolve(&*tissue, &SPACING, seed)?, "seed {seed} of a compact tissue");
        }
    }
    let strip = Rectangle::flat(Vec2::new(8.0, 0.25))?;
    let bar = Cuboid::new(Vec3::ZERO, Vec3::new(8.0, 0.5, 0.5))?;
    for (tissue, size) in [(Box::new(strip) as Box<dyn Tissue>, 1.596), (Box::new(bar), 1.563)] {
        let way = Roots::DEFAULT_REACH * size;
        assert!((tissue.extent().equivalent_diameter() - size).abs() < 1e-3);
        for seed in 0..20 {
            let ByKind { artery: arteries, vein: veins, .. } = Roots::default().resolve(&*tissue, &SPACING, seed)?;
            // At least one for two ways of 1.8. At most as many as fit with 0.6 of a way between them, which zigzags
            // between samples and is a fifth longer.
            let most = 1 + (8.0 * 1.2 / (0.6 * way)) as usize;
            assert!((3..=most).contains(&arteries.len()), "seed {seed}: {} roots of {most}", arteries.len());
            assert_eq!(arteries.len(), veins.len());
            assert_eq!(missed(&*tissue, &arteries, way), 0, "seed {seed}");
        }
    }
    Ok(())
}

/// Two unit squares, one above the other, that face each other or away.
fn plates(gap: f32, facing: bool) -> MeshSurface {
    const SIDE: u32 = 20;
    let corner = |layer: u32, i: u32, j: u32| layer * (SIDE + 1) * (SIDE + 1) + j * (SIDE + 1) + i;
    let mut corners = Vec::new();
    let mut triangles = Vec::new();
    for layer in 0..2 {
        for j in 0..=SIDE {
            corners.extend(
                (0..=SIDE).map(|i| Vec3::new(i as f32, j as f32, 0.0) / SIDE as f32 + gap * layer as f32 * Vec3::Z),
            );
        }
        for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
            let [a, b, c, d] =
                [corner(layer, i, j), corner(layer, i + 1, j), corner(layer, i + 1, j + 1), corner(layer, i, j + 1)];
            let up = (layer == 0) == facing;
            triangles.extend(if up { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
    }
    MeshSurface::new(TriangleMesh::new(corners, triangles, None).expect("a mesh")).expect("a surface")
}

#[test]
fn walls_that_face_each_other_have_roots_of_their_own() -> Result<(), RootError> {
    for seed in 0..5 {
        let arteries = Roots::default().resolve(&plates(0.02, true), &SPACING, seed)?.artery;
        let layers: Vec<bool> = arteries.iter().map(|root| root.position.z > 0.01).collect();
        assert!(layers.contains(&true) && layers.contains(&false), "seed {seed}: {arteries:?}");
    }
    Ok(())
}

#[test]
fn a_reach_that_samples_cannot_measure_is_refused() -> Result<(), TissueError> {
    let tissue = Disc::flat(0.5)?;
    for reach in [0.0, -1.0, 0.05, f32::NAN, f32::INFINITY] {
        let roots = placed_arteries(RootPlacement::Within(reach));
        assert!(matches!(roots.resolve(&tissue, &SPACING, 0), Err(RootError::Reach { .. })), "{reach}");
    }
    let near = placed_arteries(RootPlacement::Within(Roots::LEAST_REACH));
    let Ok(ByKind { artery: roots, .. }) = near.resolve(&tissue, &SPACING, 0) else { panic!("no roots") };
    assert!(missed(&tissue, &roots, 0.1) < 20 && roots.len() < 500, "{} roots", roots.len());
    Ok(())
}
