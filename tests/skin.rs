//! Closed surfaces that follow the nodes of their tree: at rest, rigid motions, stretching, bending, twisting, errors.

use bevy_math::{Quat, Vec3, Vec3Swizzles};
use bevy_vessels::synthesis::{
    binding::{BindingError, Skin, SkinVertex},
    colonization::{Colonization, ColonizationSettings},
    roots::Roots,
    surface::{Surface, SurfaceMesh, SurfaceSettings},
    tissue::{Disc, Tissue},
    tree::{NO_PARENT, VesselKind, VesselTree},
};
use std::sync::Arc;

fn grown(steps: u32) -> VesselTree {
    let tissue = Arc::new(Disc::flat(1.0).expect("a disc"));
    let settings = ColonizationSettings { steps, ..ColonizationSettings::default() }.fit(tissue.extent());
    let mut growth = Colonization::new(tissue, settings, &Roots::default(), 3).expect("a growth");
    growth.run();
    growth.vessels(VesselKind::Artery)
}

/// A straight vessel along x, with a lateral along y at its middle.
fn tee() -> VesselTree {
    let mut positions: Vec<Vec3> = (0..=20).map(|node| Vec3::X * node as f32).collect();
    positions.extend((1..=5).map(|node| Vec3::new(10.0, node as f32, 0.0)));
    let parents =
        (0..=20).map(|node: u32| node.checked_sub(1).unwrap_or(NO_PARENT)).chain([10, 21, 22, 23, 24]).collect();
    let radii = [vec![0.4; 21], vec![0.3; 5]].concat();
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

fn surface(tree: &VesselTree) -> SurfaceMesh {
    Surface::new(tree, &SurfaceSettings::default()).expect("a surface").mesh
}

fn followed(tree: &VesselTree, mesh: &SurfaceMesh, to: impl Fn(Vec3) -> Vec3) -> Vec<SkinVertex> {
    let positions: Vec<Vec3> = tree.positions().iter().map(|&at| to(at)).collect();
    Skin::new(mesh, tree).expect("of this tree").follow(&positions).expect("as many").to_vec()
}

#[test]
fn at_rest_nothing_moves_and_rigid_motions_are_exact() {
    for tree in [grown(60), tee()] {
        let mesh = surface(&tree);
        let tangents = mesh.tangents();
        let size = tree.positions().iter().fold(0.0f32, |most, at| most.max(at.length()));
        for angle in [0.0, 0.3, 1.5, 3.0, -2.5] {
            let turn = Quat::from_axis_angle(Vec3::new(0.3, -1.0, 0.6).normalize(), angle);
            let by = size * Vec3::new(0.2, 0.0, -0.5) * angle;
            let moved = followed(&tree, &mesh, |at| turn * at + by);
            for (vertex, now) in moved.iter().enumerate() {
                assert!(now.position.distance(turn * mesh.positions[vertex] + by) < 1e-4 * size, "vertex {vertex}");
                assert!(now.normal.distance(turn * mesh.normals[vertex]) < 1e-3);
                assert!(now.tangent.distance(turn * tangents[vertex].truncate()) < 1e-3);
            }
        }
    }
}

#[test]
fn stretched_vessels_keep_their_radii() {
    let tree = tee();
    let mesh = surface(&tree);
    let moved = followed(&tree, &mesh, |at| at * Vec3::new(1.7, 1.0, 1.0));
    for (now, before) in moved.iter().zip(&mesh.positions).filter(|(_, at)| at.x > 1.0 && at.x < 7.0) {
        assert!((now.position.x - 1.7 * before.x).abs() < 0.02, "{} for {before}", now.position);
        assert!((now.position.yz().length() - before.yz().length()).abs() < 1e-3);
    }
}

#[test]
fn a_bent_vessel_stays_round_and_smooth() {
    let tree = tee();
    let mesh = surface(&tree);
    // Around a circle, by two right angles from end to end; the middle stays.
    let radius = 20.0 / std::f32::consts::PI;
    let bend = |at: Vec3| {
        let (sin, cos) = ((at.x - 10.0) / radius).sin_cos();
        let away = radius + at.z;
        Vec3::new(10.0 + away * sin, at.y, away * cos - radius)
    };
    let moved = followed(&tree, &mesh, bend);
    for (now, before) in moved.iter().zip(&mesh.positions).filter(|(_, at)| at.x > 1.0 && at.x < 19.0 && at.y < 0.3) {
        assert!(now.position.distance(bend(*before)) < 0.05, "{} for {}", now.position, bend(*before));
        assert!((now.normal.length() - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_lateral_carries_the_wall_around_its_base_along() {
    let tree = tee();
    let mesh = surface(&tree);
    // A twist about the straight vessel, by a right angle where the lateral leaves.
    let twist = |at: Vec3| Quat::from_rotation_x(0.157 * at.x) * at;
    let moved = followed(&tree, &mesh, twist);
    let near = |at: &Vec3| (at.x - 10.0).abs() < 0.5 && at.y < 1.0;
    for (now, before) in moved.iter().zip(&mesh.positions).filter(|(_, at)| near(at)) {
        assert!(now.position.distance(twist(*before)) < 0.15, "{} for {}", now.position, twist(*before));
    }
}

#[test]
fn neighbours_stay_neighbours_when_a_network_is_bent() {
    let tree = grown(80);
    let mesh = surface(&tree);
    let bend = |at: Vec3| at + Vec3::new(0.1 * (3.0 * at.y).sin(), 0.0, 0.4 * at.x * at.x);
    let moved = followed(&tree, &mesh, bend);
    let widest = tree.radii().iter().fold(0.0f32, |most, &radius| most.max(radius));
    for corners in mesh.triangles() {
        for edge in 0..3 {
            let [a, b] = [edge, (edge + 1) % 3].map(|corner| corners[corner] as usize);
            let (before, now) =
                (mesh.positions[a].distance(mesh.positions[b]), moved[a].position.distance(moved[b].position));
            assert!(now < 1.8 * before + 0.2 * widest, "from {before} to {now}");
        }
    }
    for &copy in &mesh.copies {
        assert!(moved[copy as usize].position.is_finite());
    }
    let copies = (mesh.unique()..mesh.positions.len()).zip(&mesh.copies);
    for (copy, &original) in copies {
        assert_eq!(moved[copy].position, moved[original as usize].position, "a seam stays closed");
    }
}

#[test]
fn any_positions_give_finite_vertices() {
    let tree = tee();
    let mesh = surface(&tree);
    for to in [|_: Vec3| Vec3::ZERO, |at: Vec3| Vec3::X * at.x, |at: Vec3| -at, |at: Vec3| at * 1e-20] {
        for now in followed(&tree, &mesh, to) {
            assert!(now.position.is_finite() && now.normal.is_finite() && now.tangent.is_finite());
        }
    }
}

#[test]
fn another_tree_is_an_error() {
    let (tree, few) = (tee(), VesselTree::from_arrays(vec![Vec3::ZERO], vec![NO_PARENT], vec![1.0]).expect("a root"));
    let mesh = surface(&tree);
    assert!(matches!(Skin::new(&mesh, &few), Err(BindingError::VertexNode { nodes: 1, .. })));
    let mut skin = Skin::new(&mesh, &tree).expect("its own");
    assert_eq!(skin.follow(&[Vec3::ZERO]), Err(BindingError::NodeCount { bound: 26, given: 1 }));
    assert!(skin.len() == mesh.positions.len() && !skin.is_empty());
}

/// What is drawn from afar has fewer faces, and the size of the finest surface.
#[test]
fn surfaces_for_distant_views_are_smaller_and_as_wide() {
    for tree in [grown(80), tee()] {
        let settings = SurfaceSettings::default();
        let fine = Surface::new(&tree, &settings).expect("a surface").mesh;
        let coarse = Surface::coarse(&tree, &settings).expect("a surface").mesh;
        let sketch = Surface::sketch(&tree).mesh;
        let counts = [&fine, &coarse, &sketch].map(SurfaceMesh::triangle_count);
        println!("{} nodes: {counts:?} triangles", tree.len());
        assert!(3 * counts[1] < counts[0] && 3 * counts[2] < counts[1], "{counts:?}");
        assert!(coarse.closure().is_closed());
        for mesh in [&coarse, &sketch] {
            assert_eq!(mesh.normals.len(), mesh.positions.len());
            let volume = volume(mesh) / volume(&fine);
            assert!((0.75..1.25).contains(&volume), "{volume} of the volume");
            let facing = |[a, b, c]: [u32; 3]| {
                let [pa, pb, pc] = [a, b, c].map(|vertex| mesh.positions[vertex as usize]);
                (pb - pa)
                    .cross(pc - pa)
                    .dot(mesh.normals[a as usize] + mesh.normals[b as usize] + mesh.normals[c as usize])
            };
            let outwards = mesh.triangles().filter(|&corners| facing(corners) >= 0.0).count();
            assert!(outwards * 20 > mesh.triangle_count() * 19, "{outwards} of {}", mesh.triangle_count());
            let moved = followed(&tree, mesh, |at| at + Vec3::X);
            assert!(
                moved.iter().zip(&mesh.positions).all(|(now, before)| now.position.distance(*before + Vec3::X) < 1e-4)
            );
        }
    }
    let bad = SurfaceSettings { most_sides: 7, ..SurfaceSettings::default() };
    assert!(Surface::coarse(&tee(), &bad).is_err());
    assert_eq!(Surface::sketch(&VesselTree::new()).mesh, SurfaceMesh::default());
}

fn volume(mesh: &SurfaceMesh) -> f32 {
    let six = mesh.triangles().map(|corners| {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize].as_dvec3());
        a.dot(b.cross(c))
    });
    (six.sum::<f64>() / 6.0) as f32
}
