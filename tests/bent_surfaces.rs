//! Vessels lie on bent surfaces: they get round sharp edges, and neither sink below the wall nor float above it.
//!
//! The organs are stored beside the checkout, as `CONTRIBUTING.md` says; without them, a test of them is skipped.

#[path = "common/torus.rs"]
mod torus;

use bevy_math::{Quat, Vec3};
use bevy_vessels::synthesis::{
    colonization::Colonization,
    mesh::TriangleMesh,
    preset::{Preset, PresetName},
    random::Stream,
    tissue::{MeshSurface, Tissue, TissueMode, TissueSource},
    tree::VesselKind,
};
use std::sync::Arc;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn grown(tissue: &Arc<dyn Tissue>, preset: &Preset, seed: u64) -> Result<Colonization, Box<dyn std::error::Error>> {
    let generator = preset.generator_for(tissue.extent());
    let settings = generator.colonization().ok_or("presets colonize")?.clone();
    let mut growth = Colonization::new(Arc::clone(tissue), settings, &preset.roots(), seed)?;
    growth.run();
    Ok(growth)
}

/// Share of the tissue within the final birth distance of an artery.
fn coverage(growth: &Colonization) -> f32 {
    let reach = growth.settings().arterial.node_birth_distance * growth.length_scale(VesselKind::Artery);
    let nodes = growth.tree(VesselKind::Artery).positions();
    let mut rng = Stream::Statistics.rng(1);
    let samples: Vec<Vec3> = (0..1000).filter_map(|_| growth.tissue().sample(&mut rng)).collect();
    let covered = samples.iter().filter(|sample| nodes.iter().any(|node| node.distance(**sample) <= reach)).count();
    covered as f32 / samples.len() as f32
}

/// Shares of segments whose middle is off the surface by more than their radius, in the tree and as they are drawn.
struct Off {
    /// The middle of a segment of the tree is further from the surface.
    tree: f32,
    /// The middle of a drawn segment is below the surface.
    below: f32,
    /// It is above the height of its ends.
    above: f32,
}

fn off(growth: &Colonization) -> Off {
    let (mut count, mut tree_off, mut below, mut above) = (0, 0, 0, 0);
    for kind in Colonization::KINDS {
        let (tree, vessels) = (growth.tree(kind), growth.vessels(kind));
        for (node, parent) in tree.segments() {
            let (radius, other) = (tree.radii()[node], tree.radii()[parent]);
            let middle = tree.positions()[node].midpoint(tree.positions()[parent]);
            let drawn = vessels.positions()[node].midpoint(vessels.positions()[parent]);
            let ground = growth.tissue().closest_point(drawn);
            let height = (drawn - ground.position).dot(ground.normal);
            count += 1;
            tree_off += u32::from(growth.tissue().closest_point(middle).position.distance(middle) > radius);
            below += u32::from(height < 0.0);
            above += u32::from(height > 0.5 * (radius + other) + radius);
        }
    }
    let share = |part: u32| part as f32 / count as f32;
    Off { tree: share(tree_off), below: share(below), above: share(above) }
}

/// A mesh of corners and faces about the origin, any convex one. Faces are turned outwards.
fn convex(corners: &[Vec3], faces: &[[u32; 3]]) -> Result<Arc<dyn Tissue>, Box<dyn std::error::Error>> {
    let outwards = |&[a, b, c]: &[u32; 3]| {
        let [p, q, r] = [a, b, c].map(|corner| corners[corner as usize]);
        if (q - p).cross(r - p).dot(p + q + r) > 0.0 { [a, b, c] } else { [a, c, b] }
    };
    let mesh = TriangleMesh::new(corners.to_vec(), faces.iter().map(outwards).collect(), None)?;
    Ok(Arc::new(MeshSurface::new(mesh)?))
}

fn cube() -> Result<Arc<dyn Tissue>, Box<dyn std::error::Error>> {
    let corners: Vec<Vec3> =
        (0..8u8).map(|k| Vec3::from([0, 1, 2].map(|axis| f32::from(k >> axis & 1) - 0.5))).collect();
    let quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    convex(&corners, &faces)
}

fn tetrahedron() -> Result<Arc<dyn Tissue>, Box<dyn std::error::Error>> {
    let corners = [Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
    convex(&corners, &[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
}

fn drum() -> Result<Arc<dyn Tissue>, Box<dyn std::error::Error>> {
    const SIDES: u32 = 48;
    let rim = |k: u32| Quat::from_rotation_y(std::f32::consts::TAU * k as f32 / SIDES as f32) * (Vec3::X * 0.5);
    let ends = [Vec3::Y * -0.5, Vec3::Y * 0.5];
    let corners: Vec<Vec3> = ends.into_iter().chain((0..SIDES).flat_map(|k| ends.map(|end| end + rim(k)))).collect();
    let faces: Vec<[u32; 3]> = (0..SIDES)
        .flat_map(|k| {
            let [a, b] = [k, (k + 1) % SIDES].map(|k| 2 + 2 * k);
            [[0, a, b], [1, a + 1, b + 1], [a, b, a + 1], [a + 1, b, b + 1]]
        })
        .collect();
    convex(&corners, &faces)
}

/// A torus, and the organs stored beside the checkout.
fn mesh_surfaces() -> Vec<(String, Arc<dyn Tissue>)> {
    let mut meshes = vec![("torus".to_owned(), torus::torus())];
    #[cfg(feature = "mesh_files")]
    for folder in ["organs", "organs/awkward"] {
        let folder = format!("{}/../shared/data/{folder}", env!("CARGO_MANIFEST_DIR"));
        let Ok(entries) = std::fs::read_dir(&folder) else {
            eprintln!("skipped: there are no organs in {folder}");
            continue;
        };
        let mut paths: Vec<_> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "glb"));
        paths.sort();
        meshes.extend(paths.iter().map(|path| {
            let mesh = bevy_vessels::synthesis::io::load_mesh(path).unwrap_or_else(|error| panic!("{error}"));
            (path.file_stem().expect("a file name").to_string_lossy().into_owned(), mesh)
        }));
    }
    let surface = |mesh| MeshSurface::new(mesh).unwrap_or_else(|error| panic!("{error}"));
    meshes.into_iter().map(|(name, mesh)| (name, Arc::new(surface(mesh)) as Arc<dyn Tissue>)).collect()
}

#[test]
fn vessels_get_round_sharp_edges_from_any_seed() -> Outcome {
    let preset = PresetName::Paper.load();
    for (name, tissue) in [("cube", cube()?), ("tetrahedron", tetrahedron()?), ("drum", drum()?)] {
        for seed in 0..40 {
            let growth = grown(&tissue, &preset, seed)?;
            let coverage = coverage(&growth);
            assert!(coverage >= 0.8, "seed {seed} supplies {coverage} of the {name}");
            let off = off(&growth);
            assert!(off.tree == 0.0, "seed {seed}: {} of the segments cut off an edge of the {name}", off.tree);
        }
    }
    Ok(())
}

#[test]
fn a_way_is_straight_along_the_surface_and_as_long_as_asked() -> Outcome {
    for (name, tissue) in [("cube", cube()?), ("tetrahedron", tetrahedron()?), ("drum", drum()?)] {
        let mut rng = Stream::Statistics.rng(3);
        for number in 0..500 {
            let from = tissue.closest_point(tissue.sample(&mut rng).ok_or("a sample")?);
            let facet = from.facet.ok_or("a facet")?.normal;
            let direction = Quat::from_axis_angle(facet, number as f32) * facet.any_orthonormal_vector();
            let (mut before, mut length, mut turns) = (from.position, 0.0, 0);
            tissue.walk(&from, direction, 0.7, 1e-3, &mut |place| {
                assert!(tissue.contains(place.position), "{name}, way {number}: {place:?} is beside the surface");
                let middle = before.midpoint(place.position);
                let off = tissue.closest_point(middle).position.distance(middle);
                assert!(off <= 1.01e-3, "{name}, way {number}: a segment is {off} off the surface");
                length += before.distance(place.position);
                (before, turns) = (place.position, turns + 1);
            });
            // Bends cut corners by no more than the tolerance.
            assert!((length - 0.7f32).abs() < 0.01, "{name}, way {number} is {length} long, with {turns} segments");
        }
    }
    Ok(())
}

#[test]
fn flat_ways_do_not_bend() -> Outcome {
    let tissue = cube()?;
    let from = tissue.closest_point(Vec3::new(-0.3, -0.2, 0.5));
    let mut places = Vec::new();
    // Across the diagonal of a face, which is an edge of the mesh.
    tissue.walk(&from, Vec3::X, 0.6, 1e-6, &mut |place| places.push(place.position));
    assert_eq!(places.len(), 1);
    assert!(places[0].distance(Vec3::new(0.3, -0.2, 0.5)) < 1e-6, "{places:?}");
    Ok(())
}

#[test]
fn no_vessel_sinks_or_floats() -> Outcome {
    for (name, tissue) in mesh_surfaces() {
        for preset in PresetName::ALL {
            let (preset_name, preset) = (preset.name(), preset.load());
            let on_surface = matches!(&preset.tissue, TissueSource::Mesh(mesh) if mesh.mode == TissueMode::Surface);
            // The reference cases have their roots at places of their own.
            if !on_surface || preset_name.starts_with("reference") {
                continue;
            }
            let Off { tree, below, above } = off(&grown(&tissue, &preset, 1)?);
            println!("{name}, {preset_name}: {tree} off, {below} below, {above} above");
            // In doubled walls that run through each other, the wall nearest to a drawn vessel is often not its own.
            let heights = if name == "colon_vhf_original" { 0.0 } else { below.max(above) };
            assert!(tree < 0.005 && heights < 0.005, "{name}, {preset_name}: {tree} off, {below} below, {above} above");
        }
    }
    Ok(())
}
