//! Round cones as OBJ.

use crate::small;
use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::{
    io::{ObjOptions, write_obj},
    tree::{NO_PARENT, VesselKind, VesselTree},
};
use std::io;

/// Triangles of an OBJ file by group, read by another program.
fn parse_obj(bytes: &[u8]) -> Vec<tobj::Model> {
    let options = tobj::LoadOptions { single_index: true, ..Default::default() };
    let mut reader = io::BufReader::new(bytes);
    tobj::load_obj_buf(&mut reader, &options, |_| Err(tobj::LoadError::OpenFileFailed)).expect("an OBJ file").0
}

pub fn obj(trees: &[(VesselKind, &VesselTree)], options: &ObjOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_obj(&mut bytes, trees, options).expect("memory takes all");
    bytes
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.chunks_exact(3).map(Vec3::from_slice).collect()
}

#[test]
fn obj_segments_are_closed_outward_round_cones() {
    let tree = small();
    for (sides, cap_rings) in [(3, 1), (8, 2), (13, 5), (64, 32)] {
        let options = ObjOptions { sides, cap_rings, ..ObjOptions::default() };
        let models = parse_obj(&obj(&[(VesselKind::Artery, &tree), (VesselKind::Vein, &tree)], &options));
        assert_eq!(models.iter().map(|model| model.name.as_str()).collect::<Vec<_>>(), ["arterial", "venous"]);
        for model in &models {
            let positions = points(&model.mesh.positions);
            let normals = points(&model.mesh.normals);
            let triangles: Vec<[u32; 3]> = model.mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            let per_segment = 2 + 2 * cap_rings * sides;
            let segments = tree.segments().count() as u32;
            assert_eq!(positions.len() as u32, per_segment * segments);
            assert_eq!(triangles.len() as u32, (2 * per_segment - 4) * segments, "V − E + F = 2 for each");
            // Closed and oriented: every directed edge once, and its opposite, too.
            let mut edges: Vec<(u32, u32)> = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
            edges.sort_unstable();
            assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
            assert!(edges.iter().all(|&(a, b)| edges.binary_search(&(b, a)).is_ok()));
            for [a, b, c] in triangles.iter().map(|t| t.map(|i| i as usize)) {
                let normal = (positions[b] - positions[a]).cross(positions[c] - positions[a]);
                assert!(normal.length() > 0.0, "no triangle without area");
                assert!(normal.dot(normals[a] + normals[b] + normals[c]) > 0.0, "triangles face outwards");
            }
            assert!(normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-3));
        }
    }
}

/// Volume of the hull of two spheres, by integrating its cross-section: at each plane across the axis, the widest of
/// the spheres between both ends.
fn round_cone_volume(a: (Vec3, f32), b: (Vec3, f32)) -> f64 {
    let length = f64::from(a.0.distance(b.0));
    let (ra, rb) = (f64::from(a.1), f64::from(b.1));
    let (low, high) = ((-ra).min(length - rb), ra.max(length + rb));
    let slice = (high - low) / 2000.0;
    let area = |x: f64| {
        let squared_radius = |t: f64| (ra + (rb - ra) * t).powi(2) - (x - length * t).powi(2);
        std::f64::consts::PI * (0..=200).map(|i| squared_radius(f64::from(i) / 200.0)).fold(0.0, f64::max)
    };
    (0..2000).map(|i| area(low + (f64::from(i) + 0.5) * slice) * slice).sum()
}

#[test]
fn obj_has_the_volume_of_its_round_cones() {
    for (length, r0, r1) in [(1.0, 0.2, 0.2), (1.0, 0.25, 0.2), (0.02, 0.2, 0.19), (0.1, 0.13, 0.5)] {
        let ends = [(Vec3::ONE, r0), (Vec3::ONE + vec3(0.6, 0.0, -0.8) * length, r1)];
        let tree =
            VesselTree::from_arrays(ends.map(|e| e.0).to_vec(), vec![NO_PARENT, 0], vec![r0, r1]).expect("a tree");
        let models = parse_obj(&obj(
            &[(VesselKind::Artery, &tree)],
            &ObjOptions { sides: 64, cap_rings: 32, ..ObjOptions::default() },
        ));
        let positions = points(&models[0].mesh.positions);
        let corner = |i: u32| positions[i as usize].as_dvec3();
        let volume: f64 = models[0]
            .mesh
            .indices
            .chunks_exact(3)
            .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0)
            .sum();
        let expected = round_cone_volume(ends[0], ends[1]);
        assert!((volume / expected - 1.0).abs() < 0.01, "{length} {r0} {r1}: {volume} is not {expected}");
    }
}

#[test]
fn obj_stands_coinciding_nodes_lone_roots_and_odd_options() {
    let positions = vec![Vec3::ONE, Vec3::ONE, Vec3::ONE + Vec3::X * 1e-3, Vec3::ZERO];
    let tree = VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, NO_PARENT], vec![0.1, 0.1, 0.05, 1.0])
        .expect("a tree");
    for (sides, cap_rings) in [(0, 0), (u32::MAX, u32::MAX)] {
        let options = ObjOptions { sides, cap_rings, ..ObjOptions::default() };
        let models = parse_obj(&obj(&[(VesselKind::Vein, &tree)], &options));
        let positions = points(&models[0].mesh.positions);
        assert!(positions.iter().all(|p| p.is_finite() && p.distance(Vec3::ONE) < 0.2));
        for t in models[0].mesh.indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
            assert!((b - a).cross(c - a).length() > 0.0);
        }
    }
    assert_eq!(obj(&[], &ObjOptions::default()).iter().filter(|&&byte| byte == b'\n').count(), 1);
}
