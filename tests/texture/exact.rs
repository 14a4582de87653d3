//! On a flat square there is an exact answer.

use crate::meshes::{baked, linear, plain, square, vessel};
use bevy_math::{DVec2, Vec2, Vec3};
use bevy_vessels::synthesis::{
    texture::{Canvas, MapKind, VesselLook},
    tree::{NO_PARENT, VesselTree},
};

const SIZE: u32 = 128;

/// The integral of the normal distribution up to x, by summation.
fn below(x: f64) -> f64 {
    const STEPS: i32 = 4000;
    let step = (x + 8.0).max(0.0) / f64::from(STEPS);
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    (0..STEPS).map(|i| density(-8.0 + (f64::from(i) + 0.5) * step) * step).sum()
}

/// Distance from a segment, and share of it.
fn distance(at: DVec2, [from, to]: [DVec2; 2]) -> (f64, f64) {
    let along = to - from;
    let share = ((at - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    ((from + along * share).distance(at), share)
}

fn centre(texel: usize) -> DVec2 {
    let size = SIZE as usize;
    let (x, y) = ((texel % size) as f64 + 0.5, (texel / size) as f64 + 0.5);
    DVec2::new(x, size as f64 - y) / size as f64
}

#[test]
fn a_capsule_covers_what_it_covers_exactly() {
    let (ends, radius) = ([DVec2::new(0.22, 0.31), DVec2::new(0.74, 0.66)], 0.06);
    let tree = vessel(&ends.map(|end| end.as_vec2().extend(0.0)), radius as f32);
    for cells in [1, 7] {
        let canvas = Canvas::of_mesh(&square(cells)).expect("a canvas");
        for blur in [0.0f32, 0.5] {
            let look = VesselLook { blur, ..plain() };
            let bake = baked(&canvas, &[&tree], &look, SIZE, &[MapKind::Albedo]);
            let texels = &bake.maps[0].levels[0];
            // Half a texel along both sides, and the blur of the vessel.
            let own = f64::from(blur) * radius;
            let sigma = (0.25 / f64::from(SIZE * SIZE) + own * own).sqrt();
            let (mut largest, mut sum, mut exact_sum) = (0.0f64, 0.0, 0.0);
            for texel in 0..(SIZE * SIZE) as usize {
                let covered = 1.0 - f64::from(linear(texels[4 * texel]));
                let (distance, share) = distance(centre(texel), ends);
                sum += covered;
                // Along the side; the ends are compared as a whole.
                let exact = below((radius - distance) / sigma) - below((-radius - distance) / sigma);
                if share > 0.15 && share < 0.85 {
                    largest = largest.max((covered - exact).abs());
                }
                exact_sum += f64::from(u8::from(distance < radius));
            }
            assert!(largest < 0.01, "{cells} cells, blur {blur}: {largest}");
            let area = 2.0 * radius * ends[0].distance(ends[1]) + std::f64::consts::PI * radius * radius;
            let pixels = f64::from(SIZE * SIZE);
            assert!((sum / pixels / area - 1.0).abs() < 0.01, "{} for {area}, {}", sum / pixels, exact_sum / pixels);
        }
    }
}

#[test]
fn heights_and_their_slopes_are_those_of_the_profile() {
    let ends = [DVec2::new(0.2, 0.4), DVec2::new(0.8, 0.55)];
    let radius = 0.05f64;
    let tree = vessel(&ends.map(|end| end.as_vec2().extend(0.0)), radius as f32);
    let canvas = Canvas::of_mesh(&square(3)).expect("a canvas");
    let look = VesselLook { blur: 0.3, bump: 0.8, ..plain() };
    let bake = baked(&canvas, &[&tree], &look, SIZE, &[MapKind::Height, MapKind::Normal]);
    let (normals, heights) = (&bake.maps[0].levels[0], &bake.maps[1].levels[0]);
    let [low, high] = bake.report.height_range.map(f64::from);
    assert!(low == 0.0 && (high - 0.8 * radius).abs() < 1e-6);
    let variance = 0.25 / f64::from(SIZE * SIZE) + (0.3 * radius).powi(2) + (0.5 * radius).powi(2);
    let sigma = variance.sqrt();
    let exact = |at: DVec2| {
        let (distance, _) = distance(at, ends);
        0.8 * radius * (below((radius - distance) / sigma) - below((-radius - distance) / sigma))
    };
    let size = SIZE as usize;
    for texel in (0..size * size).step_by(7) {
        let at = centre(texel);
        if !(0.1..0.9).contains(&distance(at, ends).1) {
            continue;
        }
        let value = u16::from_le_bytes([heights[2 * texel], heights[2 * texel + 1]]);
        let height = low + (high - low) * f64::from(value) / 65535.0;
        assert!((height - exact(at)).abs() < 0.02 * high, "{height} for {} at {at}", exact(at));
        // The normal is that of the exact heights beside: x right, y up in the picture.
        let step = 1e-4;
        let slope = |way: DVec2| (exact(at + way * step) - exact(at - way * step)) / (2.0 * step);
        let normal = Vec3::new(-slope(DVec2::X) as f32, -slope(DVec2::Y) as f32, 1.0).normalize();
        let bytes = &normals[4 * texel..][..3];
        let seen = Vec3::new(bytes[0].into(), bytes[1].into(), bytes[2].into()) / 127.5 - 1.0;
        assert!(seen.distance(normal) < 0.03, "{seen} for {normal} at {at}");
    }
}

#[test]
fn ids_are_those_of_all_segments_looked_at_one_by_one() {
    // A zigzag with side branches, of two networks at different depths.
    let network = |z: f32, turn: f32| {
        let (mut positions, mut parents, mut radii) = (Vec::new(), Vec::new(), Vec::new());
        for node in 0..24u32 {
            let along = node as f32 / 24.0;
            let side = if node % 2 == 0 { 0.12 } else { -0.1 };
            let at = Vec2::new(along - 0.5, side + 0.2 * along - 0.1);
            positions.push((Vec2::from_angle(turn).rotate(at) + 0.5).extend(z));
            parents.push(if node == 0 { NO_PARENT } else { node - 1 - u32::from(node % 5 == 0) });
            radii.push(0.012 + 0.0007 * ((node * 7) % 11) as f32);
        }
        VesselTree::from_arrays(positions, parents, radii).expect("a tree")
    };
    let trees = [network(-0.3, 0.2), network(-0.2, 1.3)];
    let canvas = Canvas::of_mesh(&square(5)).expect("a canvas");
    let maps = [MapKind::Id, MapKind::Depth];
    let bake = baked(&canvas, &[&trees[0], &trees[1]], &plain(), SIZE, &maps);
    let (ids, depths) = (&bake.maps[0].levels[0], &bake.maps[1].levels[0]);
    let (mut both, mut differing) = ([0; 2], 0);
    for texel in 0..(SIZE * SIZE) as usize {
        let at = centre(texel);
        let mut best: Option<(f64, u32, f64)> = None;
        for (layer, tree) in trees.iter().enumerate() {
            for (node, parent) in tree.segments() {
                let end = |node: usize| tree.positions()[node].truncate().as_dvec2();
                let (distance, share) = distance(at, [end(parent), end(node)]);
                let radius = f64::from(tree.radii()[node]);
                let start = f64::from(tree.radii()[parent]).min(1.3 * radius);
                let radius = start + (radius - start) * share;
                // What a straight segment may lie off a curved surface doesn't count.
                let chord = VesselLook::CHORD_DEPTH * tree.segment_vector(node).length();
                let depth = f64::from((-tree.positions()[node].z - chord).max(0.0));
                let top = depth - (radius * radius - distance * distance).max(0.0).sqrt();
                if distance <= radius && best.is_none_or(|(other, ..)| top < other) {
                    best = Some((top, node as u32 | (layer as u32 + 1) << 24, depth));
                }
            }
        }
        let id = u32::from_le_bytes(std::array::from_fn(|k| ids[4 * texel + k]));
        let expected = best.map_or(0, |(_, id, _)| id);
        // Of two vessels equally near, and of a texel exactly at an edge, rounding decides.
        differing += usize::from(id != expected);
        let value = u16::from_le_bytes([depths[2 * texel], depths[2 * texel + 1]]);
        match (id, best) {
            (0, _) => assert_eq!(value, u16::MAX),
            (_, Some((_, _, depth))) if id == expected => {
                let seen = f64::from(value) / 65534.0 * f64::from(bake.report.depth_range);
                assert!((seen - depth).abs() < 1e-4, "{seen} for {depth}");
                both[(id >> 24) as usize - 1] += 1;
            }
            _ => {}
        }
    }
    assert!(both.iter().all(|count| *count > 200), "{both:?}");
    assert!(differing <= 8, "{differing} differ");
}
