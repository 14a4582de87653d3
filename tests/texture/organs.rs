//! Real organs, procedural ones, and meshes that are unwrapped.

use crate::meshes::baked;
use crate::seams::{largest_step, mark, seams};
use crate::shared;
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    io::load_mesh,
    mesh::TriangleMesh,
    organ::ColonSettings,
    texture::{Canvas, MapKind, VesselLook},
    tree::{NO_PARENT, VesselKind, VesselTree},
};

/// A vessel over the surface of a mesh: from corner to corner of its triangles.
fn over(mesh: &TriangleMesh, radius: f32) -> VesselTree {
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); mesh.positions().len()];
    for &[a, b, c] in mesh.triangles() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            neighbours[from as usize].push(to);
        }
    }
    // Breadth first; every third node branches no further.
    let mut place = vec![NO_PARENT; neighbours.len()];
    let (mut nodes, mut parents) = (vec![mesh.triangles()[0][0]], vec![NO_PARENT]);
    place[nodes[0] as usize] = 0;
    let mut at = 0;
    while at < nodes.len() && nodes.len() < 3000 {
        for &next in neighbours[nodes[at] as usize].iter().take(2) {
            if place[next as usize] == NO_PARENT {
                place[next as usize] = nodes.len() as u32;
                parents.push(at as u32);
                nodes.push(next);
            }
        }
        at += 1;
    }
    let positions: Vec<Vec3> = nodes.iter().map(|&node| mesh.positions()[node as usize]).collect();
    VesselTree::from_arrays(positions, parents, vec![radius; nodes.len()]).expect("a tree")
}

fn extent(mesh: &TriangleMesh) -> f32 {
    let bounds = mesh.bounds();
    (bounds.max - bounds.min).length()
}

/// Maps whose values run on across seams.
const SEAMLESS: [MapKind; 4] = [MapKind::Albedo, MapKind::Normal, MapKind::Height, MapKind::Roughness];

#[test]
fn real_organs_with_charts_have_no_seams() {
    for (name, charts) in [("eyeball_mh_uv", 1..=2000), ("kidney_left_vhf_uv", 1..=2000)] {
        let Some(path) = shared::folder(&format!("data/organs/{name}.glb")) else { continue };
        let mesh = load_mesh(&path).expect("a mesh");
        let canvas = Canvas::of_mesh(&mesh).expect("a canvas");
        let tree = over(&mesh, 0.004 * extent(&mesh));
        let look = VesselLook::of(VesselKind::Artery);
        let bake = baked(&canvas, &[&tree], &look, 512, &SEAMLESS);
        assert!(charts.contains(&bake.report.charts) && !seams(&canvas).is_empty(), "{name}");
        for kind in SEAMLESS {
            for level in 0..=4 {
                let step = largest_step(&canvas, &bake, kind, level);
                assert!(step <= mark(kind), "{name}, {kind:?}, level {level}: {step} of 255");
            }
        }
    }
}

#[test]
fn the_colon_is_painted_over_its_seams_and_poles() {
    let colon = ColonSettings { triangles: 8000, ..ColonSettings::default() }.generate().expect("a colon");
    let canvas = Canvas::of_shaded(&colon.mesh).expect("a canvas");
    let mesh = colon.mesh.triangle_mesh().expect("a mesh");
    let tree = over(&mesh, 0.002);
    let bake = baked(&canvas, &[&tree], &VesselLook::default(), 256, &SEAMLESS);
    assert_eq!((bake.report.charts, bake.report.repeats), (4, [false; 2]));
    assert!(bake.report.texels > 256 * 230, "{} texels", bake.report.texels);
    for kind in SEAMLESS {
        for level in 0..=4 {
            let step = largest_step(&canvas, &bake, kind, level);
            assert!(step <= mark(kind), "{kind:?}, level {level}: {step} of 255");
        }
    }
}

#[test]
fn a_mesh_without_texture_coordinates_is_unwrapped() {
    let colon = ColonSettings { triangles: 8000, ..ColonSettings::default() }.generate().expect("a colon");
    let mesh = TriangleMesh::new(colon.mesh.positions.clone(), colon.mesh.triangles.clone(), None).expect("a mesh");
    let canvas = Canvas::unwrapped(&mesh, Some(&colon.mesh.normals), 512).expect("a canvas");
    let sources = canvas.sources().expect("sources");
    assert_eq!(canvas.mesh().triangles().len(), mesh.triangles().len());
    for (corners, olds) in canvas.mesh().triangles().iter().zip(mesh.triangles()) {
        assert_eq!(corners.map(|corner| sources[corner as usize]), *olds);
    }
    let tree = over(&mesh, 0.002);
    let bake = baked(&canvas, &[&tree], &VesselLook::default(), 512, &[MapKind::Albedo]);
    assert!(bake.report.texels > 512 * 512 / 3, "{} texels", bake.report.texels);
    let names: Vec<String> = bake.report.warnings.iter().map(ToString::to_string).collect();
    assert!(!names.iter().any(|name| name.contains("several parts")), "{names:?}");
}
