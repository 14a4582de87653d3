//! Meshes to paint on, networks, and what a sampler sees of maps.

use bevy_math::{Vec2, Vec3};
use bevy_vessels::synthesis::{
    mesh::TriangleMesh,
    texture::{Bake, BakeSettings, BakedMap, Canvas, Layer, MapKind, Maps, VesselLook},
    tree::{NO_PARENT, VesselTree},
};

/// A grid over the unit square in the plane z = 0, with u along x and v against y.
pub fn square(cells: u32) -> TriangleMesh {
    let at = |i: u32| i as f32 / cells as f32;
    let mut positions = Vec::new();
    for row in 0..=cells {
        positions.extend((0..=cells).map(|column| Vec3::new(at(column), at(row), 0.0)));
    }
    let uvs = positions.iter().map(|p| Vec2::new(p.x, 1.0 - p.y)).collect();
    let corner = |column: u32, row: u32| row * (cells + 1) + column;
    let mut triangles = Vec::new();
    for row in 0..cells {
        for column in 0..cells {
            let [a, b] = [corner(column, row), corner(column + 1, row)];
            let [c, d] = [corner(column, row + 1), corner(column + 1, row + 1)];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    TriangleMesh::new(positions, triangles, Some(uvs)).expect("a mesh")
}

/// A box of edge 1 around the origin whose sides are charts, three of them mirrored, turned and smaller than the others.
pub fn cube() -> TriangleMesh {
    const CELLS: u32 = 6;
    let (mut positions, mut uvs, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for side in 0..6u32 {
        let axis = (side / 2) as usize;
        let out = [Vec3::X, Vec3::Y, Vec3::Z][axis] * if side % 2 == 0 { 1.0 } else { -1.0 };
        let right = [Vec3::Y, Vec3::Z, Vec3::X][axis];
        let up = out.cross(right);
        let first = positions.len() as u32;
        for row in 0..=CELLS {
            for column in 0..=CELLS {
                let share = Vec2::new(column as f32, row as f32) / CELLS as f32;
                // The same to the last bit on both sides of an edge.
                let place = |cell: u32| (cell as f32 - 0.5 * CELLS as f32) / CELLS as f32;
                positions.push(0.5 * out + place(column) * right + place(row) * up);
                let (place, size) = (Vec2::new((side % 3) as f32 / 3.0, 0.5 * (side / 3) as f32), 0.29);
                let turned = match side {
                    1 => Vec2::new(1.0 - share.x, share.y),
                    3 => 0.83 * Vec2::new(share.y, share.x),
                    4 => Vec2::from_angle(0.3).rotate(share - 0.5) * 0.7 + 0.5,
                    _ => share,
                };
                uvs.push(place + 0.02 + turned * size);
            }
        }
        for row in 0..CELLS {
            for column in 0..CELLS {
                let a = first + row * (CELLS + 1) + column;
                let [b, c, d] = [a + 1, a + CELLS + 1, a + CELLS + 2];
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
    }
    TriangleMesh::new(positions, triangles, Some(uvs)).expect("a mesh")
}

/// One vessel through some points.
pub fn vessel(points: &[Vec3], radius: f32) -> VesselTree {
    let parents = (0..points.len() as u32).map(|node| node.checked_sub(1).unwrap_or(NO_PARENT)).collect();
    VesselTree::from_arrays(points.to_vec(), parents, vec![radius; points.len()]).expect("a tree")
}

/// Black vessels that neither fade nor sink, without any blur but that of the texels.
pub fn plain() -> VesselLook {
    VesselLook {
        thin_color: [0.0; 3],
        wide_color: [0.0; 3],
        deep_color: [0.0; 3],
        strength: 1.0,
        depth: 0.0,
        blur: 0.0,
        scatter: 0.0,
        max_depth: 1.0,
        bump: 1.0,
        fade: 0.0,
        ..VesselLook::default()
    }
}

/// Bakes some maps over white.
pub fn baked(canvas: &Canvas, trees: &[&VesselTree], look: &VesselLook, size: u32, maps: &[MapKind]) -> Bake {
    let settings = BakeSettings {
        size,
        maps: maps.iter().copied().collect::<Maps>(),
        base_color: [1.0; 3],
        ..BakeSettings::default()
    };
    let layers: Vec<Layer<'_>> = trees.iter().map(|tree| Layer { tree, look: look.clone() }).collect();
    Bake::new(canvas, &layers, None, &settings).expect("a bake")
}

/// Linear light of an sRGB byte.
pub fn linear(byte: u8) -> f32 {
    let value = f32::from(byte) / 255.0;
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// The byte of linear light, not rounded.
pub fn srgb(value: f32) -> f32 {
    255.0 * if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// What a sampler sees at a point of a level: between its four nearest texels.
pub fn sampled(map: &BakedMap, level: usize, uv: Vec2, repeats: [bool; 2], get: impl Fn(&[u8]) -> Vec3) -> Vec3 {
    let (size, bytes) = (i64::from(map.size >> level), map.kind.format().bytes());
    let at = uv * size as f32 - 0.5;
    let (first, share) = (at.floor(), at - at.floor());
    let place = |value: i64, axis: usize| {
        (if repeats[axis] { value.rem_euclid(size) } else { value.clamp(0, size - 1) }) as usize
    };
    let texel = |right: i64, down: i64| {
        let place = place(first.y as i64 + down, 1) * size as usize + place(first.x as i64 + right, 0);
        get(&map.levels[level][place * bytes..][..bytes])
    };
    let row = |down: i64| texel(0, down).lerp(texel(1, down), share.x);
    row(0).lerp(row(1), share.y)
}
