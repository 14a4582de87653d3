//! Vessels that follow an organ: rigid motions, stretching, bending, seams, tetrahedra, and errors.

#[path = "common/solid_box.rs"]
mod solid_box;

use bevy_math::{Affine3A, Mat3, Quat, Vec3};
use bevy_vessels::synthesis::{
    binding::{Binding, BindingError},
    mesh::{TetMesh, TetMeshError, TriangleMesh},
    organ::{ColonSettings, LiverSettings},
    random::{Stream, VesselRng},
    tree::{NO_PARENT, NodeId, Place, VesselTree},
};
use rand::RngExt;
use solid_box::solid_box;

fn any_point(rng: &mut VesselRng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// A chain through points.
fn chain(points: Vec<Vec3>) -> VesselTree {
    let parents = (0..points.len() as u32).map(|node| node.checked_sub(1).unwrap_or(NO_PARENT)).collect();
    let radii = vec![0.01; points.len()];
    VesselTree::from_arrays(points, parents, radii).expect("a tree")
}

fn organs() -> [TriangleMesh; 2] {
    let colon = ColonSettings::default().generate().expect("a colon").mesh.triangle_mesh().expect("a mesh");
    let liver = LiverSettings::default().generate().expect("a liver").mesh.triangle_mesh().expect("a mesh");
    [colon, liver]
}

fn size(mesh: &TriangleMesh) -> f32 {
    let bounds = mesh.bounds();
    Vec3::from(bounds.max - bounds.min).max_element()
}

/// Points on a mesh, or off it by up to a share of its size.
fn points_near(mesh: &TriangleMesh, off: f32, count: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = Stream::Statistics.rng(seed);
    let reach = off * size(mesh);
    let point = |_| {
        let [a, b, c] = mesh.corners(rng.random_range(0..mesh.triangles().len()));
        let (v, w) = (rng.random_range(0.0..1.0f32), rng.random_range(0.0..1.0f32));
        let (v, w) = if v + w > 1.0 { (1.0 - v, 1.0 - w) } else { (v, w) };
        a + (b - a) * v + (c - a) * w + reach * any_point(&mut rng)
    };
    (0..count).map(point).collect()
}

fn moved(mesh: &TriangleMesh, motion: impl Fn(Vec3) -> Vec3) -> Vec<Vec3> {
    mesh.positions().iter().map(|&position| motion(position)).collect()
}

/// Largest distance between two lists of points.
fn difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn nodes_of_an_organ_at_rest_stay_and_follow_rigid_motions() {
    let motion = Affine3A::from_rotation_translation(
        Quat::from_axis_angle(Vec3::new(1.0, -2.0, 0.5).normalize(), 2.1),
        Vec3::new(0.3, 0.1, -0.2),
    );
    for (seed, mesh) in (0..).zip(organs()) {
        for off in [0.0, 1.0e-3, 0.05] {
            let rest = chain(points_near(&mesh, off, 3000, seed));
            let mut binding = Binding::to_surface(&rest, &mesh);
            let mut tree = rest.clone();
            binding.follow(mesh.positions(), &mut tree).unwrap();
            let at_rest = difference(tree.positions(), rest.positions());
            assert!(at_rest <= 2.0e-6 * size(&mesh), "organ {seed}, {off} off: {at_rest}");
            binding.follow(&moved(&mesh, |p| motion.transform_point3(p)), &mut tree).unwrap();
            let expected: Vec<Vec3> = rest.positions().iter().map(|&p| motion.transform_point3(p)).collect();
            let rigid = difference(tree.positions(), &expected);
            assert!(rigid <= 1.0e-5 * size(&mesh), "organ {seed}, {off} off: {rigid}");
            assert_eq!(tree.radii(), rest.radii());
        }
    }
}

#[test]
fn stretching_keeps_vessels_on_the_surface() {
    let scales = [Vec3::splat(1.7), Vec3::new(0.4, 1.0, 2.5)];
    for (seed, mesh) in (5..).zip(organs()) {
        let rest = chain(points_near(&mesh, 0.0, 2000, seed));
        let mut binding = Binding::to_surface(&rest, &mesh);
        for scale in scales {
            let mut tree = rest.clone();
            binding.follow(&moved(&mesh, |p| p * scale), &mut tree).unwrap();
            let expected: Vec<Vec3> = rest.positions().iter().map(|&p| p * scale).collect();
            let off = difference(tree.positions(), &expected);
            assert!(off <= 1.0e-5 * size(&mesh) * scale.max_element(), "organ {seed}, {scale}: {off}");
        }
    }
}

/// Bends one axis around another: a plane x = c becomes one at an angle.
fn bend(p: Vec3, radius: f32) -> Vec3 {
    let (sin, cos) = (p.x / radius).sin_cos();
    Vec3::new((radius + p.y) * sin, (radius + p.y) * cos - radius, p.z)
}

#[test]
fn bending_keeps_vessels_at_their_distance_from_the_surface() {
    for (seed, mesh) in (10..).zip(organs()) {
        let radius = 0.8 * size(&mesh);
        let bent = moved(&mesh, |p| bend(p, radius));
        let after = TriangleMesh::new(bent.clone(), mesh.triangles().to_vec(), None).unwrap();
        let normals = mesh.vertex_normals();
        let bent_normals = after.vertex_normals();
        let distance = 1.0e-3 * size(&mesh);
        let picked: Vec<usize> = (0..mesh.positions().len()).step_by(7).filter(|&v| normals[v] != Vec3::ZERO).collect();
        // Leaves out points above a vertex whose nearest place on the mesh is not that vertex.
        let index = bevy_vessels::synthesis::mesh::TriangleIndex::new(&mesh);
        let above = |v: usize| mesh.positions()[v] + distance * normals[v];
        let clear = |&v: &usize| {
            index.closest(above(v)).is_some_and(|found| found.position.distance(mesh.positions()[v]) < 1e-3 * distance)
        };
        let picked: Vec<usize> = picked.into_iter().filter(clear).collect();
        assert!(picked.len() > 100, "organ {seed}: only {} points", picked.len());
        let rest = chain(picked.iter().map(|&v| above(v)).collect());
        let mut binding = Binding::to_surface(&rest, &mesh);
        let mut tree = rest.clone();
        binding.follow(&bent, &mut tree).unwrap();
        for (node, &vertex) in picked.iter().enumerate() {
            let expected = bent[vertex] + distance * bent_normals[vertex];
            let off = tree.positions()[node].distance(expected);
            assert!(off <= 0.01 * distance + 1e-6 * size(&mesh), "organ {seed}, node {node}: {off} of {distance}");
            assert!(binding.normal(node).dot(bent_normals[vertex]) > 0.999);
        }
    }
}

#[test]
fn the_triangle_is_the_nearest_by_brute_force() {
    // Each triangle is separate and moves differently, so that a node's new position shows its triangle.
    let mut rng = Stream::Roots.rng(4);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for triangle in 0..80u32 {
        let center = any_point(&mut rng);
        positions.extend((0..3).map(|_| center + 0.2 * any_point(&mut rng)));
        triangles.push([0, 1, 2].map(|corner| 3 * triangle + corner));
    }
    // Degenerate triangles right beside the nodes must be ignored.
    positions.extend([Vec3::ZERO; 3]);
    triangles.push([240, 241, 242]);
    let mesh = TriangleMesh::new(positions, triangles, None).unwrap();
    let rest = chain((0..300).map(|_| any_point(&mut rng)).collect());
    let mut binding = Binding::to_surface(&rest, &mesh);
    let shift = |vertex: usize| Vec3::new(10.0 * (vertex / 3) as f32, 0.0, 0.0);
    let shifted: Vec<Vec3> = mesh.positions().iter().enumerate().map(|(vertex, &p)| p + shift(vertex)).collect();
    let mut tree = rest.clone();
    binding.follow(&shifted, &mut tree).unwrap();
    for (node, (&before, &after)) in rest.positions().iter().zip(tree.positions()).enumerate() {
        let bound = ((after.x - before.x) / 10.0).round() as usize;
        let nearest = (0..80).map(|triangle| sampled_distance(before, mesh.corners(triangle)));
        let least = nearest.fold(f32::INFINITY, f32::min);
        let own = sampled_distance(before, mesh.corners(bound));
        assert!(own <= least + 0.01, "node {node} is bound to triangle {bound} at {own}, not {least}");
    }
}

/// Distance from a triangle, over a grid of its points.
fn sampled_distance(point: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let mut least = f32::INFINITY;
    for i in 0..=60u8 {
        for j in 0..=60 - i {
            let (v, w) = (f32::from(i) / 60.0, f32::from(j) / 60.0);
            least = least.min(point.distance(a + (b - a) * v + (c - a) * w));
        }
    }
    least
}

#[test]
fn seams_do_not_show() {
    // A roof of two slopes; its ridge has every vertex twice, like a seam of a UV chart.
    let ridge = [Vec3::new(0.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
    let at = |x: f32| [Vec3::new(x, 0.0, 0.0), Vec3::new(x, 1.0, 0.0)];
    let positions = [at(-1.0), ridge, ridge, at(1.0)].concat();
    let triangles = vec![[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]];
    let mesh = TriangleMesh::new(positions, triangles, None).unwrap();
    let beside = 1.0e-3;
    let rest = chain([-beside, beside].map(|x| Vec3::new(x, 0.5, 0.2)).to_vec());
    let mut binding = Binding::to_surface(&rest, &mesh);
    let mut tree = rest.clone();
    binding.follow(&moved(&mesh, |p| p - Vec3::Z * p.x.abs()), &mut tree).unwrap();
    let [left, right] = [tree.positions()[0], tree.positions()[1]];
    assert!(left.distance(right) < 3.0 * beside, "{left} and {right} part");
    assert!((left.z - 0.2).abs() < 2.0 * beside, "{left} left its distance");
}

#[test]
fn tetrahedra_carry_nodes_through_an_affine_map() {
    let mesh = solid_box(5, 2.0);
    let mut rng = Stream::Statistics.rng(8);
    // Some are outside, by up to half the width of the cube.
    let rest = chain((0..2000).map(|i| any_point(&mut rng) * if i % 5 == 0 { 1.5 } else { 1.0 }).collect());
    let mut binding = Binding::to_tetrahedra(&rest, &mesh);
    let map = Affine3A::from_mat3_translation(
        Mat3::from_cols(Vec3::new(1.2, 0.3, -0.1), Vec3::new(-0.4, 0.7, 0.2), Vec3::new(0.1, 0.5, 1.6)),
        Vec3::new(0.2, -1.0, 0.4),
    );
    let vertices: Vec<Vec3> = mesh.positions().iter().map(|&p| map.transform_point3(p)).collect();
    let mut tree = rest.clone();
    binding.follow(&vertices, &mut tree).unwrap();
    let expected: Vec<Vec3> = rest.positions().iter().map(|&p| map.transform_point3(p)).collect();
    assert!(difference(tree.positions(), &expected) <= 1.0e-5, "{}", difference(tree.positions(), &expected));
    assert_eq!(binding.normal(3), Vec3::ZERO);
}

#[test]
fn a_node_in_tetrahedra_follows_only_the_one_that_holds_it() {
    let mesh = solid_box(4, 2.0);
    let rest = chain(vec![Vec3::new(-0.9, -0.8, -0.7), Vec3::new(0.8, 0.7, 0.9), Vec3::new(1.4, 0.8, 0.8)]);
    let mut binding = Binding::to_tetrahedra(&rest, &mesh);
    let lift = |p: &Vec3| if p.x >= 0.5 { *p + Vec3::Z } else { *p };
    let mut tree = rest.clone();
    binding.follow(&mesh.positions().iter().map(lift).collect::<Vec<_>>(), &mut tree).unwrap();
    let expected = [rest.positions()[0], rest.positions()[1] + Vec3::Z, rest.positions()[2] + Vec3::Z];
    assert!(difference(tree.positions(), &expected) < 1e-5, "{:?}", tree.positions());
}

#[test]
fn nodes_that_grew_later_are_bound_at_rest() {
    let [_, mesh] = organs();
    let points = points_near(&mesh, 0.02, 500, 3);
    let whole = chain(points.clone());
    let radius = size(&mesh);
    let vertices = moved(&mesh, |p| bend(p, radius));
    let mut at_once = vec![Vec3::ZERO; 500];
    Binding::to_surface(&whole, &mesh).follow_into(&vertices, &mut at_once).unwrap();
    let mut binding = Binding::to_surface(&chain(points[..100].to_vec()), &mesh);
    let mut positions = vec![Vec3::ZERO; 100];
    binding.follow_into(&vertices, &mut positions).unwrap();
    binding.extend(&whole);
    assert_eq!((binding.len(), binding.is_empty()), (500, false));
    positions.resize(500, Vec3::ZERO);
    binding.follow_into(&vertices, &mut positions).unwrap();
    assert_eq!(positions, at_once);
    binding.extend(&chain(points[..50].to_vec()));
    assert_eq!(binding.len(), 50);
}

#[test]
fn the_place_of_a_cut_stays_on_its_vessel() {
    let [colon, _] = organs();
    let rest = chain(points_near(&colon, 0.0, 200, 9));
    let mut binding = Binding::to_surface(&rest, &colon);
    let cut = Place::new(NodeId(120), 0.3);
    let mut tree = rest.clone();
    let radius = size(&colon);
    binding.follow(&moved(&colon, |p| bend(p, radius)), &mut tree).unwrap();
    let (start, end) = (tree.positions()[119], tree.positions()[120]);
    assert_ne!(tree.position_at(cut), rest.position_at(cut));
    assert!(tree.position_at(cut).distance(start + 0.3 * (end - start)) < 1e-6);
    binding.follow(colon.positions(), &mut tree).unwrap();
    assert!(tree.position_at(cut).distance(rest.position_at(cut)) < 2e-6 * size(&colon));
}

#[test]
fn what_cannot_be_followed_is_refused_whole() {
    let [_, mesh] = organs();
    let rest = chain(points_near(&mesh, 0.01, 40, 2));
    let mut binding = Binding::to_surface(&rest, &mesh);
    let count = mesh.positions().len();
    let mut tree = rest.clone();
    let few = binding.follow(&mesh.positions()[1..], &mut tree);
    assert_eq!(few, Err(BindingError::VertexCount { bound: count, given: count - 1 }));
    let mut vertices = moved(&mesh, |p| p + Vec3::X);
    vertices[count - 1].y = f32::NAN;
    let bad = binding.follow(&vertices, &mut tree);
    assert!(matches!(bad, Err(BindingError::Vertex { vertex, .. }) if vertex == count - 1), "{bad:?}");
    let short = binding.follow_into(mesh.positions(), &mut [Vec3::ZERO; 3]);
    assert_eq!(short, Err(BindingError::NodeCount { bound: 40, given: 3 }));
    assert_eq!(tree, rest);
}

#[test]
fn a_collapsed_organ_leaves_finite_nodes() {
    let [_, mesh] = organs();
    let rest = chain(points_near(&mesh, 0.02, 300, 6));
    let mut binding = Binding::to_surface(&rest, &mesh);
    for motion in [|_| Vec3::ONE, |p: Vec3| Vec3::X * p.x, |p: Vec3| -p] {
        let mut tree = rest.clone();
        binding.follow(&moved(&mesh, motion), &mut tree).unwrap();
        assert!(tree.positions().iter().all(|p| p.is_finite()));
    }
}

#[test]
fn useless_tetrahedra_are_refused_by_name() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let mut bad = corners.clone();
    bad[2].z = f32::INFINITY;
    assert!(matches!(TetMesh::new(bad, vec![[0, 1, 2, 3]]), Err(TetMeshError::BadPosition { vertex: 2, .. })));
    let out = TetMesh::new(corners.clone(), vec![[0, 1, 2, 3], [0, 1, 2, 4]]);
    assert_eq!(out, Err(TetMeshError::IndexOutOfRange { tetrahedron: 1, index: 4, vertices: 4 }));
    assert_eq!(TetMesh::new(corners.clone(), vec![[0, 1, 2, 2]]), Err(TetMeshError::NoVolume { tetrahedra: 1 }));
    assert_eq!(TetMesh::new(vec![], vec![]), Err(TetMeshError::NoVolume { tetrahedra: 0 }));
    assert!(TetMesh::new(corners, vec![[0, 2, 1, 3]]).is_ok());
}
