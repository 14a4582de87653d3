//! Both sides of a seam look the same, on all levels that are seen.

use crate::meshes::{baked, cube, linear, plain, sampled, square, srgb};
use bevy_math::{Vec2, Vec3, Vec4};
use bevy_vessels::synthesis::{
    texture::{Bake, Canvas, MapKind, VesselLook},
    tree::{NO_PARENT, VesselTree},
};
use std::collections::BTreeMap;

/// The largest step that a map may have, in 255ths of its range: one, and what rounding to bytes adds on both sides. A
/// normal is rounded in three directions. Heights have 16 bits, so that their rounding doesn't count.
pub fn mark(kind: MapKind) -> f32 {
    match kind {
        MapKind::Height => 1.0,
        MapKind::Normal => 1.0 + 3.0f32.sqrt(),
        _ => 2.0,
    }
}

/// Edges that two triangles share by position, but not by texture coordinates: the vertices of both sides, in one
/// order. A triangle whose texture coordinates have no area shows all of its edges at one place or line of the texture,
/// where no picture can be that of the other side.
pub fn seams(canvas: &Canvas) -> Vec<[[usize; 2]; 2]> {
    let key = |vertex: usize| canvas.mesh().positions()[vertex].to_array().map(|value| (value + 0.0).to_bits());
    let mut edges: BTreeMap<[[u32; 3]; 2], Vec<[usize; 2]>> = BTreeMap::new();
    for corners in canvas.mesh().triangles() {
        let [a, b, c] = corners.map(|corner| canvas.uvs()[corner as usize]);
        if (b - a).perp_dot(c - a).abs() <= 1.0e-6 * (b - a).length_squared().max((c - a).length_squared()) {
            continue;
        }
        for k in 0..3 {
            let mut ends = [corners[k] as usize, corners[(k + 1) % 3] as usize];
            if key(ends[0]) > key(ends[1]) {
                ends.swap(0, 1);
            }
            edges.entry(ends.map(key)).or_default().push(ends);
        }
    }
    let uv = |ends: [usize; 2]| ends.map(|end| canvas.uvs()[end]);
    let pairs = edges.into_values().filter(|sides| sides.len() == 2).map(|sides| [sides[0], sides[1]]);
    pairs.filter(|[one, other]| uv(*one) != uv(*other)).collect()
}

/// The largest step across any seam on a level, in 255ths; for normals, of the normal in space.
pub fn largest_step(canvas: &Canvas, bake: &Bake, kind: MapKind, level: usize) -> f32 {
    let map = bake.map(kind).expect("a map");
    let color = |bytes: &[u8]| Vec3::new(linear(bytes[0]), linear(bytes[1]), linear(bytes[2]));
    let number = |bytes: &[u8]| match kind {
        MapKind::Height => Vec3::splat(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) / 65535.0),
        MapKind::Normal => Vec3::new(bytes[0].into(), bytes[1].into(), bytes[2].into()) / 127.5 - 1.0,
        _ => Vec3::splat(f32::from(bytes[1]) / 255.0),
    };
    let mut largest = 0.0f32;
    for sides in seams(canvas) {
        let size = (map.size >> level) as f32;
        let long = |[from, to]: [usize; 2]| canvas.uvs()[from].distance(canvas.uvs()[to]) * size;
        let count = (4.0 * sides.map(long).into_iter().fold(0.0, f32::max)).ceil().max(1.0) as usize;
        for number_of in 0..=count {
            let share = number_of as f32 / count as f32;
            let [one, other] = sides.map(|[from, to]| {
                let uv = canvas.uvs()[from].lerp(canvas.uvs()[to], share);
                if kind == MapKind::Albedo {
                    return sampled(map, level, uv, bake.report.repeats, color).to_array().map(srgb).into();
                }
                let seen = sampled(map, level, uv, bake.report.repeats, number);
                if kind != MapKind::Normal {
                    return 255.0 * seen;
                }
                // As a renderer turns it, by what it interpolates.
                let normal = canvas.normals()[from].lerp(canvas.normals()[to], share);
                let tangent: Vec4 = canvas.tangents()[from].lerp(canvas.tangents()[to], share);
                let bitangent = tangent.w * normal.cross(tangent.truncate());
                127.5 * (tangent.truncate() * seen.x + bitangent * seen.y + normal * seen.z).normalize()
            });
            largest = largest.max((one - other).abs().max_element());
        }
    }
    largest
}

/// A vessel around a box, across all of its sides and many edges, with branches.
fn around() -> VesselTree {
    let (mut positions, mut parents, mut radii) = (Vec::new(), Vec::new(), Vec::new());
    for node in 0..400u32 {
        let turn = node as f32 / 25.0;
        let way = Vec3::new(turn.cos(), turn.sin(), 1.6 * (0.37 * turn).sin()).normalize();
        positions.push(way * (0.5 / way.abs().max_element()));
        parents.push(node.checked_sub(1).unwrap_or(NO_PARENT));
        radii.push(0.02 + 0.01 * (3.0 * turn).sin());
    }
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

#[test]
fn vessels_cross_the_borders_of_charts_without_a_step() {
    let mesh = cube();
    // Smooth normals: the two sides of an edge have one surface.
    let canvas = Canvas::of_mesh(&mesh).expect("a canvas");
    assert!(seams(&canvas).len() >= 72, "twelve edges of six cells");
    let tree = around();
    let look = VesselLook { strength: 0.5, blur: 0.4, ..plain() };
    let kinds = [MapKind::Albedo, MapKind::Normal, MapKind::Height, MapKind::Roughness];
    let bake = baked(&canvas, &[&tree], &look, 512, &kinds);
    assert!(bake.report.charts == 6 && bake.report.repeats == [false; 2]);
    for kind in [MapKind::Albedo, MapKind::Height, MapKind::Roughness, MapKind::Normal] {
        for level in 0..=4 {
            let step = largest_step(&canvas, &bake, kind, level);
            assert!(step <= mark(kind), "{kind:?}, level {level}: {step} of 255");
        }
    }
}

#[test]
fn a_texture_goes_on_beyond_its_edge_where_charts_do() {
    // The square, rolled up: its left and right edges are one.
    let flat = square(24);
    let rolled = flat.positions().iter().map(|p| {
        let turn = (p.x % 1.0) * std::f32::consts::TAU;
        Vec3::new(turn.cos(), turn.sin(), 4.0 * p.y)
    });
    let uvs = flat.uvs().expect("texture coordinates").to_vec();
    let tube = |uvs: Vec<Vec2>| {
        let mesh = bevy_vessels::synthesis::mesh::TriangleMesh::new(
            rolled.clone().collect(),
            flat.triangles().to_vec(),
            Some(uvs),
        );
        Canvas::of_mesh(&mesh.expect("a mesh")).expect("a canvas")
    };
    let points: Vec<Vec3> = (0..60)
        .map(|k| {
            let turn = k as f32 * 0.4;
            Vec3::new(turn.cos(), turn.sin(), 0.4 + 0.05 * k as f32)
        })
        .collect();
    let tree = crate::meshes::vessel(&points, 0.06);
    let look = VesselLook { strength: 0.5, ..plain() };
    let canvas = tube(uvs.clone());
    let bake = baked(&canvas, &[&tree], &look, 256, &[MapKind::Albedo]);
    assert_eq!(bake.report.repeats, [true, false]);
    for level in 0..=4 {
        let step = largest_step(&canvas, &bake, MapKind::Albedo, level);
        assert!(step <= mark(MapKind::Albedo), "level {level}: {step} of 255");
    }
    // Coordinates outside of 0 to 1 are wrapped: the same picture, moved by a third.
    let moved = tube(uvs.iter().map(|uv| *uv + Vec2::new(0.75, 0.0)).collect());
    let other = baked(&moved, &[&tree], &look, 256, &[MapKind::Albedo]);
    let [texels, others] = [&bake, &other].map(|bake| &bake.maps[0].levels[0]);
    let mut differing = 0;
    for texel in 0..256 * 256 {
        let to = texel / 256 * 256 + (texel + 192) % 256;
        differing += usize::from(texels[4 * texel..][..3] != others[4 * to..][..3]);
    }
    assert!(differing < 200, "{differing} differ");
}
