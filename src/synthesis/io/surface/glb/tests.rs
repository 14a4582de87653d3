//! Files are read with the `gltf` crate, which checks them.

use super::super::testing::{MEASURES, Welded, assert_closed, lopsided, prism, tree};
use super::*;
use crate::synthesis::surface::SurfaceMesh;
use crate::synthesis::tree::VesselKind;
use crate::synthesis::units::Scale;
use bevy_math::{Vec2, Vec3, Vec4};
use gltf::{Gltf, Primitive, Semantic};

fn written(parts: &[SurfacePart], options: &SurfaceOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_surface_glb(&mut bytes, parts, options).unwrap();
    assert_eq!(bytes.len() % 4, 0);
    assert_eq!(bytes[8..12], (bytes.len() as u32).to_le_bytes());
    bytes
}

fn read(bytes: &[u8]) -> Gltf {
    Gltf::from_slice(bytes).unwrap()
}

/// The values of an attribute of this crate's own.
fn own(primitive: &Primitive, blob: &[u8], name: &str) -> Vec<f32> {
    let accessor = primitive.get(&Semantic::Extras(name.to_owned())).unwrap();
    let view = accessor.view().unwrap();
    let (first, last) = (view.offset(), view.offset() + view.length());
    assert_eq!((view.length(), accessor.offset()), (4 * accessor.count(), 0));
    blob[first..last].as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

/// Asserts that a primitive holds a mesh, bit for bit.
fn assert_holds(primitive: &Primitive, blob: &[u8], mesh: &SurfaceMesh) {
    let reader = primitive.reader(|_| Some(blob));
    let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from_array).collect();
    assert_eq!(positions, mesh.positions);
    assert_eq!(reader.read_normals().unwrap().map(Vec3::from_array).collect::<Vec<_>>(), mesh.normals);
    assert_eq!(reader.read_tangents().unwrap().map(Vec4::from_array).collect::<Vec<_>>(), mesh.tangents());
    let uvs = reader.read_tex_coords(0).unwrap().into_f32();
    assert_eq!(uvs.map(Vec2::from_array).collect::<Vec<_>>(), mesh.uvs);
    let colors: Vec<[f32; 4]> = reader.read_colors(0).unwrap().into_rgba_f32().collect();
    assert_eq!(colors, vec![[1.0; 4]; positions.len()]);
    assert_eq!(own(primitive, blob, "RADIUS"), mesh.radii);
    let nodes: Vec<u32> = own(primitive, blob, "NODE").iter().map(|&node| node as u32).collect();
    assert_eq!(nodes, mesh.nodes);
    let measures: Vec<(i32, u32)> = own(primitive, blob, "BRANCH")
        .iter()
        .zip(own(primitive, blob, "STRAHLER"))
        .map(|(&branch, order)| (branch as i32, order as u32))
        .collect();
    assert_eq!(measures, nodes.iter().map(|&node| MEASURES[node as usize]).collect::<Vec<_>>());
    let bounds = primitive.bounding_box();
    let (low, high) = (Vec3::from_array(bounds.min), Vec3::from_array(bounds.max));
    assert_eq!(low, mesh.positions.iter().copied().reduce(Vec3::min).unwrap());
    assert_eq!(high, mesh.positions.iter().copied().reduce(Vec3::max).unwrap());
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert_eq!(indices, mesh.triangles().flatten().collect::<Vec<_>>());
    let mut welded = Welded::default();
    let by_place: Vec<u32> = indices.iter().map(|&index| welded.number(positions[index as usize])).collect();
    let triangles: Vec<Vec<u32>> = by_place.chunks(3).map(<[u32]>::to_vec).collect();
    assert_eq!(assert_closed(&triangles), 2, "a sphere");
}

#[test]
fn surfaces_come_back_bit_for_bit() {
    let (tree, odd, mesh) = (tree(), lopsided(), prism(5, 4));
    let name = "the \"left\" lobe\nwith spaces, \\ and ü";
    let named = SurfacePart { name, color: [0.25, 0.5, 1.0], ..SurfacePart::new(VesselKind::Duct, &tree, &mesh) };
    let parts = [SurfacePart::new(VesselKind::Artery, &tree, &odd), named];
    let file = read(&written(&parts, &SurfaceOptions::default()));
    let blob = file.blob.as_deref().unwrap();
    let nodes: Vec<gltf::Node> = file.default_scene().unwrap().nodes().collect();
    assert_eq!(nodes.len(), 2);
    for (node, part) in nodes.iter().zip(parts) {
        let mesh = node.mesh().unwrap();
        assert_eq!([node.name(), mesh.name()], [Some(part.name); 2]);
        assert_eq!(node.extras().as_ref().unwrap().get(), format!("{{\"kind\":\"{}\"}}", part.kind.name()));
        assert_eq!(mesh.primitives().len(), 1);
        let primitive = mesh.primitives().next().unwrap();
        assert_holds(&primitive, blob, part.mesh);
        let (material, [red, green, blue]) = (primitive.material(), part.color);
        assert_eq!((material.name(), material.double_sided()), (Some(part.name), false));
        let surface = material.pbr_metallic_roughness();
        assert_eq!(surface.base_color_factor(), [red, green, blue, 1.0]);
        assert_eq!((surface.metallic_factor(), surface.roughness_factor()), (0.0, 0.35));
    }
}

#[test]
fn this_crate_reads_its_own_files_as_organs() {
    let (tree, mesh) = (tree(), prism(8, 3));
    let path = std::env::temp_dir().join(format!("bevy_vessels_surface_{}.glb", std::process::id()));
    let part = SurfacePart::new(VesselKind::Vein, &tree, &mesh);
    save_surface_glb(&path, &[part], &SurfaceOptions::default()).unwrap();
    let organ = crate::synthesis::io::load_mesh(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    assert_eq!(organ.positions(), mesh.positions);
    assert_eq!(organ.uvs(), Some(mesh.uvs.as_slice()));
}

#[test]
fn parts_without_faces_are_nodes_and_no_parts_are_a_file() {
    let (tree, empty, mesh) = (tree(), SurfaceMesh::default(), prism(3, 2));
    let file = read(&written(&[], &SurfaceOptions::default()));
    assert_eq!((file.nodes().len(), file.meshes().len(), file.buffers().len()), (0, 0, 0));
    let loose = SurfaceMesh { faces: vec![], ..mesh.clone() };
    let parts = [&empty, &mesh, &loose].map(|mesh| SurfacePart::new(VesselKind::Vein, &tree, mesh));
    let file = read(&written(&parts, &SurfaceOptions::default()));
    let has_mesh: Vec<bool> = file.nodes().map(|node| node.mesh().is_some()).collect();
    assert_eq!(has_mesh, [false, true, false]);
    assert_holds(&file.meshes().next().unwrap().primitives().next().unwrap(), file.blob.as_deref().unwrap(), &mesh);
    assert_eq!(read(&written(&parts[..1], &SurfaceOptions::default())).blob, None);
}

#[test]
fn units_and_comments_are_extras_of_the_asset() {
    let comments = vec!["seed \"7\"".to_owned(), "two\nlines".to_owned()];
    let bytes = written(&[], &SurfaceOptions { scale: Some(Scale::CENTIMETRES), comments, triangles: false });
    let file = read(&bytes);
    let asset = &file.as_json().asset;
    assert_eq!(asset.generator, Some(super::super::notes::generator()));
    let expected = r#"{"comments":["seed \"7\"","two\nlines"],"metres_per_unit":0.01}"#;
    assert_eq!(asset.extras.as_ref().unwrap().get(), expected);
    assert!(read(&written(&[], &SurfaceOptions::default())).as_json().asset.extras.is_none());
}

#[test]
fn files_beyond_four_gibibytes_are_an_error_with_the_number() {
    assert_eq!(file_length(100, 0).unwrap(), 120);
    let most = u64::from(u32::MAX) - 128;
    assert_eq!(file_length(100, most).unwrap(), u32::MAX);
    let message = file_length(100, most + 1).unwrap_err().to_string();
    assert!(message.contains("4294967296 bytes") && message.contains("coarser"), "{message}");
}
