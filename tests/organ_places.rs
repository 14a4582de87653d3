//! Places on procedural organs are where anatomy has them, vessels grow from there, and the eye's recipe follows them.

#![cfg(feature = "serialize")]

use bevy_math::{Vec2, Vec3};
use bevy_vessels::synthesis::{
    mesh::{ShadedMesh, TriangleIndex},
    organ::{EyeSettings, KidneySettings, Laterality, LiverSettings, RootSites},
    preset::PresetName,
    random::Stream,
    recipe::{RecipeLayer, conjunctiva},
    roots::{RootPlacement, RootPlacements},
    tissue::{MeshSurface, SourceData, Tissue},
    tree::{VesselKind, VesselTree, statistics},
};
use std::sync::Arc;

const SIDES: [Laterality; 2] = [Laterality::Left, Laterality::Right];

/// The largest distance of a place from a mesh.
fn off(mesh: &ShadedMesh, sites: &RootSites) -> f32 {
    let mesh = mesh.triangle_mesh().expect("a mesh");
    let index = TriangleIndex::new(&mesh);
    let all = [&sites.arterial, &sites.venous, &sites.portal, &sites.ductal];
    let gaps = all.into_iter().flatten().map(|&at| index.closest(at).expect("a place").position.distance(at));
    gaps.fold(0.0, f32::max)
}

#[test]
fn vessels_enter_an_eye_where_anatomy_has_them() {
    for seed in 0..8 {
        for side in SIDES {
            let eye = EyeSettings { seed, side, ..Default::default() }.generate().expect("within limits");
            let medial = if side == Laterality::Left { -1.0 } else { 1.0 };
            for sites in [&eye.roots, &eye.ciliary_roots, &eye.retinal_roots] {
                assert!(off(&eye.globe, sites) < 0.000_12, "seed {seed}: {} m off", off(&eye.globe, sites));
                assert_eq!(sites.arterial.len(), sites.venous.len());
            }
            assert!((8..=12).contains(&eye.roots.arterial.len()));
            assert_eq!(eye.ciliary_roots.arterial.len(), 7);
            // From nasal over the top: two arteries at each muscle, one at the lateral.
            let nasal = eye.ciliary_roots.arterial.iter().filter(|at| at.x * medial > at.y.abs()).count();
            let temporal = eye.ciliary_roots.arterial.iter().filter(|at| at.x * medial < -at.y.abs()).count();
            assert_eq!((nasal, temporal), (2, 1), "seed {seed}, {side:?}");
            // 3 to 4 mm to the nose from the back.
            let disc = eye.retinal_roots.arterial[0].midpoint(eye.retinal_roots.venous[0]);
            assert!(disc.z < 0.0 && (0.0025..=0.0045).contains(&(disc.x * medial)), "seed {seed}, {side:?}: {disc}");
            assert!(eye.lateral.eye.x * medial < 0.0);
        }
    }
}

/// Texels of the visible white are near square, and those at the limbus at most twice as long as the others.
#[test]
fn the_conjunctiva_has_square_texels() {
    for seed in 0..4 {
        let eye = EyeSettings { seed, ..Default::default() }.generate().expect("within limits");
        let mesh = eye.globe.part(eye.conjunctiva.clone());
        let (mut longest, mut shortest) = (0.0f32, f32::INFINITY);
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|corner| mesh.uvs[corner as usize]);
            let [p, q, r] = corners.map(|corner| mesh.positions[corner as usize]);
            let (s, t) = (b - a, c - a);
            let area = s.perp_dot(t);
            let [u, v] = [((q - p) * t.y - (r - p) * s.y) / area, ((r - p) * s.x - (q - p) * t.x) / area];
            // Singular values of the step in space by that in the texture.
            let (sum, difference) = (u.length_squared() + v.length_squared(), u.length_squared() - v.length_squared());
            let root = Vec2::new(difference, 2.0 * u.dot(v)).length();
            let [long, short] = [0.5 * (sum + root), 0.5 * (sum - root)].map(f32::sqrt);
            assert!(long < 1.35 * short, "seed {seed}: a texel {} times as long as wide", long / short);
            (longest, shortest) = (longest.max(long), shortest.min(short));
        }
        assert!(longest < 2.5 * shortest, "seed {seed}: texels from {shortest} to {longest}");
    }
}

#[test]
fn a_kidneys_vessels_enter_at_its_hilum_and_fill_it() {
    for (seed, side) in [(1, Laterality::Left), (2, Laterality::Right)] {
        let kidney =
            KidneySettings { seed, side, triangles: 10_000, ..Default::default() }.generate().expect("within limits");
        let medial = if side == Laterality::Left { -1.0 } else { 1.0 };
        assert!(off(&kidney.mesh, &kidney.roots) < 0.001, "{} m", off(&kidney.mesh, &kidney.roots));
        let (artery, vein) = (kidney.roots.arterial[0], kidney.roots.venous[0]);
        assert!((0.001..=0.008).contains(&artery.distance(vein)), "{} m", artery.distance(vein));
        assert!(kidney.hilum.x * medial > 0.02 && kidney.hilum.x * medial > artery.x * medial, "{:?}", kidney.hilum);
        assert!(kidney.ureter.y < artery.y && kidney.ureter.z < vein.z && kidney.ureter.x * medial > 0.02);

        let preset = PresetName::Kidney.load();
        let mesh = Arc::new(kidney.mesh.triangle_mesh().expect("a mesh"));
        let data = SourceData { mesh: Some(mesh), ..SourceData::default() };
        let prepared = preset.tissue.prepare(&data).expect("a tissue");
        let tissue = prepared.tissue();
        let generator = preset.generator_for(tissue.extent());
        // Found by its shape, the hilum is the same place.
        let found = preset.roots().resolve(&**tissue, &generator.root_spacing(tissue.extent()), 1).expect("roots");
        let away = found.artery[0].position.distance(artery);
        assert!(away < 0.015, "seed {seed}: the hilum is found {away} m from the artery");

        let roots = RootPlacements::from(&kidney.roots).into();
        let mut growth = generator.start(Arc::clone(tissue), &roots, seed).expect("a growth");
        growth.run();
        for (kind, least) in [(VesselKind::Artery, 0.85), (VesselKind::Vein, 0.75)] {
            let grown = growth.trees()[kind].expect("a tree");
            let share = worst_octant(&**tissue, grown.tree, 2.0 * grown.reach);
            assert!(share > least, "seed {seed}: {} vessels supply {share} of an octant", kind.name());
        }
    }
}

/// The smallest share of an octant of a tissue's bounds within a reach of a node.
fn worst_octant(tissue: &dyn Tissue, tree: &VesselTree, reach: f32) -> f32 {
    let mut rng = Stream::Statistics.rng(1);
    let middle = Vec3::from(tissue.bounds().min + tissue.bounds().max) * 0.5;
    let samples: Vec<Vec3> = (0..10_000).filter_map(|_| tissue.sample(&mut rng)).collect();
    let octant = |side: u32| samples.iter().copied().filter(move |at| at.cmpgt(middle).bitmask() == side);
    let shares = (0..8).filter_map(|side| statistics::coverage(tree, &octant(side).collect::<Vec<_>>(), reach));
    shares.fold(1.0, f32::min)
}

#[test]
fn vessels_enter_a_liver_below_and_leave_it_at_the_back() {
    for seed in 0..12 {
        let liver = LiverSettings { seed, ..Default::default() }.generate().expect("within limits");
        let sites = &liver.roots;
        assert!(off(&liver.mesh, sites) < 0.002, "seed {seed}: {} m off", off(&liver.mesh, sites));
        assert_eq!([&sites.arterial, &sites.portal, &sites.ductal].map(Vec::len), [1; 3]);
        let (artery, portal, duct) = (sites.arterial[0], sites.portal[0], sites.ductal[0]);
        // Together at the porta; the vein behind, the duct on the patient's right.
        assert!(portal.z < artery.z && portal.z < duct.z && duct.x < artery.x, "seed {seed}: {sites:?}");
        assert!(artery.distance(portal) < 0.02 && artery.distance(duct) < 0.02, "seed {seed}: {sites:?}");
        assert_eq!(sites.venous.len(), 3);
        for vein in &sites.venous {
            assert!(vein.y > artery.y + 0.03 && vein.z < portal.z, "seed {seed}: {sites:?}");
        }
        let placed = RootPlacements::from(sites);
        assert_eq!(placed.portal_vein, RootPlacement::Nearest(sites.portal.clone()));
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let eyes = [
        ("axial_length", EyeSettings { axial_length: f32::NAN, ..Default::default() }),
        ("corneal_diameter", EyeSettings { corneal_diameter: 0.02, ..Default::default() }),
        ("corneal_radius", EyeSettings { corneal_radius: 0.005, ..Default::default() }),
        ("limbus_width", EyeSettings { limbus_width: -0.001, ..Default::default() }),
        ("chamber_depth", EyeSettings { chamber_depth: 0.01, ..Default::default() }),
        ("pupil_diameter", EyeSettings { pupil_diameter: 0.0, ..Default::default() }),
        ("variation", EyeSettings { variation: 2.0, ..Default::default() }),
        ("triangles", EyeSettings { triangles: 100, ..Default::default() }),
    ];
    for (name, settings) in eyes {
        let error = settings.generate().expect_err(name);
        assert_eq!((error.organ, error.name), ("eye", name));
    }
    let kidneys = [
        ("length", KidneySettings { length: f32::INFINITY, ..Default::default() }),
        ("lobulation", KidneySettings { lobulation: 1.1, ..Default::default() }),
        ("variation", KidneySettings { variation: -1.0, ..Default::default() }),
        ("triangles", KidneySettings { triangles: 1, ..Default::default() }),
    ];
    for (name, settings) in kidneys {
        let error = settings.generate().expect_err(name);
        assert_eq!((error.organ, error.name), ("kidney", name));
    }
}

#[test]
fn the_layers_of_a_conjunctiva_keep_to_their_bands_and_leave_the_limbus_free() {
    let eye = EyeSettings { seed: 3, triangles: 20_000, ..Default::default() }.generate().expect("within limits");
    let surface = eye.globe.part(eye.conjunctiva.clone()).triangle_mesh().expect("a mesh");
    let surface = Arc::new(MeshSurface::new(surface).expect("a surface"));
    let layers = conjunctiva(&eye, 5);
    assert_eq!(layers, conjunctiva(&eye, 5));
    assert_ne!(layers, conjunctiva(&eye, 6));
    let of = |name: &'static str| layers.iter().filter(move |layer| layer.name.starts_with(name));
    assert_eq!(of("episcleral").count(), 7);
    assert!(of("large").count() >= 4 && of("fine").count() >= 16);
    let widest = |layer: &RecipeLayer| {
        let tissue = layer.tissue(&surface).expect("a tissue");
        let (roots, generator) = (layer.preset.roots(), &layer.preset.generator);
        let mut growth = generator.start(Arc::clone(&tissue), &roots, layer.seed).expect("a growth");
        growth.run();
        let tree = growth.trees()[VesselKind::Artery].expect("a tree").tree;
        assert!(tree.len() > 15, "{}: {} nodes", layer.name, tree.len());
        // Nearly all of it lies where it may; vessels pass by, but never to the cornea.
        let inside = tree.positions().iter().filter(|at| tissue.density(**at) > 0.0).count();
        assert!(inside * 10 > tree.len() * 8, "{}: {inside} of {} nodes in the band", layer.name, tree.len());
        let (middle, radius) = eye.limbus;
        assert!(tree.positions().iter().all(|at| at.z < middle.z && at.truncate().length() > radius), "{}", layer.name);
        tree.radii().iter().copied().fold(0.0, f32::max)
    };
    let widths = |name| of(name).take(4).map(widest).sum::<f32>() / 4.0;
    let [episcleral, large, fine] = [widths("episcleral"), widths("large"), widths("fine")];
    // Radii of vessels of 20 to 150 µm.
    assert!(episcleral > large && large > fine, "{episcleral}, {large}, {fine}");
    assert!(fine > 10e-6 && episcleral < 75e-6, "{episcleral}, {large}, {fine}");
}
