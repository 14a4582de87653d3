//! Areas against the shoelace formula, and edges against those of the polygon.

use super::*;
use crate::synthesis::random::Stream;
use bevy_math::ops;
use rand::RngExt;
use std::collections::BTreeMap;

/// Cuts a polygon, and checks that its triangles have its area, face as it does, and have its edges once.
fn check(corners: &[DVec3]) {
    let doubled = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a);
    let normal: DVec3 = corners.windows(2).map(|pair| doubled(corners[0], pair[0], pair[1])).sum();
    let mut polygons = Polygons::default();
    let triangles = polygons.cut(corners.iter().copied()).unwrap_or_else(|error| panic!("{error}: {corners:?}"));
    assert_eq!(triangles.len(), corners.len() - 2, "{corners:?}");
    let mut area = 0.0;
    let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for &[a, b, c] in triangles {
        let own = doubled(corners[a as usize], corners[b as usize], corners[c as usize]);
        assert!(own.dot(normal) >= -1e-9 * normal.length_squared(), "{corners:?}: {triangles:?}");
        area += own.length();
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
        }
    }
    assert!((area / normal.length() - 1.0).abs() < 1e-9, "{area} of {}: {corners:?}", normal.length());
    // Inner edges are used once each way; what is left is the polygon's outline.
    let count = corners.len() as u32;
    let outline: Vec<(u32, u32)> = edges.iter().filter(|(_, sum)| **sum != 0).map(|(edge, _)| *edge).collect();
    let mut expected: Vec<(u32, u32)> = (1..count).map(|corner| (corner - 1, corner)).chain([(0, count - 1)]).collect();
    expected.sort_unstable();
    assert_eq!(outline, expected, "{corners:?}: {triangles:?}");
}

/// Checks a flat polygon from every first corner, both ways, in several planes.
fn check_all(flat: &[(f64, f64)]) {
    let planes = [(DVec3::X, DVec3::Y), (DVec3::Z, DVec3::X), (DVec3::new(0.6, 0.0, 0.8), DVec3::NEG_Y)];
    for (x, y) in planes {
        let mut corners: Vec<DVec3> = flat.iter().map(|&(u, v)| x * u + y * v + DVec3::splat(1000.0)).collect();
        for _ in 0..2 {
            for _ in 0..corners.len() {
                corners.rotate_left(1);
                check(&corners);
            }
            corners.reverse();
        }
    }
}

#[test]
fn convex_and_concave_polygons_keep_their_area_and_outline() {
    check_all(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]);
    // A dart; the letters U, L and E; a comb, whose teeth have corners on their lines; a square with corners on its
    // edges.
    check_all(&[(0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0)]);
    let u = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (2.0, 3.0), (2.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)];
    check_all(&u);
    check_all(&[(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]);
    let with_middles: Vec<(f64, f64)> = (0..u.len())
        .flat_map(|corner| {
            let (a, b) = (u[corner], u[(corner + 1) % u.len()]);
            [a, (a.0 * 0.5 + b.0 * 0.5, a.1 * 0.5 + b.1 * 0.5), (a.0 * 0.25 + b.0 * 0.75, a.1 * 0.25 + b.1 * 0.75)]
        })
        .collect();
    check_all(&with_middles);
    check_all(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (0.0, 2.0), (0.0, 1.0)]);
}

#[test]
fn random_stars_keep_their_area_and_outline() {
    let mut rng = Stream::Attraction.rng(4);
    for corners in 5..120 {
        let star: Vec<DVec3> = (0..corners)
            .map(|corner| {
                let (sin, cos) = ops::sin_cos(std::f32::consts::TAU * corner as f32 / corners as f32);
                let radius = rng.random_range(0.2..1.0);
                DVec3::new(radius * f64::from(cos), 0.3 * radius * f64::from(cos), radius * f64::from(sin))
            })
            .collect();
        check(&star);
    }
}

#[test]
fn bent_quadrilaterals_are_cut_where_they_fold() {
    let mut polygons = Polygons::default();
    let roof = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 1.0), DVec3::Y];
    assert_eq!(polygons.cut(roof.into_iter()), Ok(&[[0, 1, 2], [0, 2, 3]][..]));
    let bow = [DVec3::ZERO, DVec3::ONE.with_z(0.0), DVec3::X, DVec3::Y];
    assert_eq!(polygons.cut(bow.into_iter()), Err(CROSSES));
    let line = [0.0, 1.0, 2.0, 3.0].map(|x| DVec3::X * x);
    assert!(polygons.cut(line.into_iter()).is_ok_and(|triangles| triangles.len() == 2));
    let longer = [0.0, 1.0, 2.0, 3.0, 1.5, 0.5].map(|x| DVec3::X * x);
    assert!(polygons.cut(longer.into_iter()).is_ok_and(|triangles| triangles.len() == 4));
    let star = [0, 2, 4, 1, 3].map(|corner| {
        let (sin, cos) = ops::sin_cos(std::f32::consts::TAU * corner as f32 / 5.0);
        DVec3::new(cos.into(), sin.into(), 0.0)
    });
    assert_eq!(polygons.cut(star.into_iter()), Err(CROSSES), "a pentagram");
}
