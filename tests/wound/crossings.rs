//! Random blades of every kind under random transforms, against simple arithmetic in the space of the blade.

use crate::common::{all, forest, random_point, rng};
use bevy_math::{Affine3A, DAffine3, DMat3, DVec3, Mat3, Quat, Vec3};
use bevy_vessels::synthesis::random::VesselRng;
use bevy_vessels::synthesis::tree::VesselTree;
use bevy_vessels::synthesis::{
    segment_index::Region,
    wound::{Blade, BladeError, Severed, severed},
};
use rand::RngExt;

/// A blade for the reference computation, in world space.
enum Twin {
    Triangles(Vec<[Vec3; 3]>),
    Disc(Vec3, Vec3, f32),
    Capsule(Vec3, Vec3, f32),
}

fn random_blade(rng: &mut VesselRng, kind: usize, place: impl Fn(Vec3) -> Vec3) -> (Blade, Twin) {
    let mut point = || place(random_point(rng));
    let [a, b, c, d] = [point(), point(), point(), point()];
    let radius = 0.3 * a.distance(b);
    match kind {
        0 => {
            let (u, v) = (b - a, c - a);
            let [e, f, g, h] = [a - u - v, a + u - v, a + u + v, a - u + v];
            (Blade::rectangle(a, u, v).expect("a blade"), Twin::Triangles(vec![[e, f, g], [e, g, h]]))
        }
        1 => (Blade::disc(a, b - a, 2.0 * radius).expect("a blade"), Twin::Disc(a, b - a, 2.0 * radius)),
        2 => (Blade::sweep([a, b], [c, d]).expect("a blade"), Twin::Triangles(vec![[a, b, d], [a, d, c]])),
        3 => {
            let triangles: Vec<_> = (0..7).map(|_| [point(), point(), point()]).collect();
            (Blade::triangles(triangles.clone()).expect("a blade"), Twin::Triangles(triangles))
        }
        4 => (Blade::ball(a, radius).expect("a blade"), Twin::Capsule(a, a, radius)),
        _ => (Blade::capsule(a, c, radius).expect("a blade"), Twin::Capsule(a, c, radius)),
    }
}

/// A transform with rotation, shift, uneven scale and, by `kind`, a mirror and a shear.
fn random_transform(rng: &mut VesselRng, kind: usize) -> Affine3A {
    if kind == 0 {
        return Affine3A::IDENTITY;
    }
    let turn = Quat::from_scaled_axis(3.0 * random_point(rng));
    let mut scale = Vec3::from_array(std::array::from_fn(|_| rng.random_range(0.2..4.0)));
    if kind >= 2 {
        scale.x = -scale.x;
    }
    let mut matrix = Mat3::from_quat(turn) * Mat3::from_diagonal(scale);
    if kind == 3 {
        // A turned child under an unevenly scaled parent.
        matrix = Mat3::from_diagonal(Vec3::new(1.0, 3.0, 0.5)) * matrix;
    }
    Affine3A::from_mat3_translation(matrix, 10.0 * random_point(rng))
}

/// The reference result for one segment, and whether it is too close to decide in f64 and f32.
struct Found {
    /// Ends of removed stretches.
    stretches: Vec<[f64; 2]>,
    is_close: bool,
}

/// Distance to an edge, or to mere contact, within which the reference leaves the result open; relative to the blade.
const CLOSE: f64 = 1e-4;

fn twin_of_triangle(start: DVec3, end: DVec3, corners: [Vec3; 3]) -> Found {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    // Cramer's rule for start + t·along = a + v·(b − a) + w·(c − a).
    let system = DMat3::from_cols(start - end, b - a, c - a);
    let solved = system.inverse() * (start - a);
    let (share, v, w) = (solved.x, solved.y, solved.z);
    let margin = share.min(1.0 - share).min(v).min(w).min(1.0 - v - w);
    let is_close = !(margin.abs() > CLOSE);
    Found { stretches: if margin > 0.0 { vec![[share, share]] } else { vec![] }, is_close }
}

fn twin_of_disc(start: DVec3, end: DVec3, center: Vec3, normal: Vec3, radius: f32) -> Found {
    let (center, normal, radius) = (center.as_dvec3(), normal.as_dvec3(), f64::from(radius));
    let share = (center - start).dot(normal) / (end - start).dot(normal);
    let reach = start.lerp(end, share).distance(center) / radius;
    let margin = share.min(1.0 - share).min(1.0 - reach);
    let is_close = !(margin.abs() > CLOSE);
    Found { stretches: if margin > 0.0 { vec![[share, share]] } else { vec![] }, is_close }
}

/// By search only: the distance to the axis is convex along the segment.
fn twin_of_capsule(start: DVec3, end: DVec3, from: Vec3, to: Vec3, radius: f32) -> Found {
    let (from, to, radius) = (from.as_dvec3(), to.as_dvec3(), f64::from(radius));
    let outside = |share: f64| {
        let point = start.lerp(end, share);
        let axis = to - from;
        let along = if axis == DVec3::ZERO { 0.0 } else { ((point - from).dot(axis) / axis.dot(axis)).clamp(0.0, 1.0) };
        point.distance(from + axis * along) / radius - 1.0
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if outside(a) < outside(b) { high = b } else { low = a }
    }
    let nearest = 0.5 * (low + high);
    let bisect = |mut inside: f64, mut out: f64| {
        for _ in 0..60 {
            let middle = 0.5 * (inside + out);
            if outside(middle) <= 0.0 { inside = middle } else { out = middle }
        }
        inside
    };
    let is_close = [outside(0.0), outside(1.0), outside(nearest)].iter().any(|margin| margin.abs() < CLOSE);
    if outside(nearest) > 0.0 {
        return Found { stretches: vec![], is_close };
    }
    let from = if outside(0.0) <= 0.0 { 0.0 } else { bisect(nearest, 0.0) };
    let to = if outside(1.0) <= 0.0 { 1.0 } else { bisect(nearest, 1.0) };
    Found { stretches: vec![[from, to]], is_close }
}

fn twin(blade: &Twin, start: DVec3, end: DVec3) -> Found {
    match blade {
        Twin::Disc(center, normal, radius) => twin_of_disc(start, end, *center, *normal, *radius),
        Twin::Capsule(from, to, radius) => twin_of_capsule(start, end, *from, *to, *radius),
        Twin::Triangles(triangles) => {
            let mut all = Found { stretches: Vec::new(), is_close: false };
            for &corners in triangles {
                let one = twin_of_triangle(start, end, corners);
                all.stretches.extend(one.stretches);
                all.is_close |= one.is_close;
            }
            all.stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
            all
        }
    }
}

fn as_f64(transform: &Affine3A) -> DAffine3 {
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let matrix3 = DMat3::from_cols(x.as_dvec3(), y.as_dvec3(), z.as_dvec3());
    DAffine3 { matrix3, translation: transform.translation.as_dvec3() }
}

/// Compares one blade on one tree; returns crossings and undecided segments.
fn compare(blade: &Blade, twin_blade: &Twin, tree: &VesselTree, to_world: &Affine3A, case: &str) -> (usize, usize) {
    let local = blade.to_local(to_world).expect("a transform that can be undone");
    let mut found = Vec::new();
    severed(&local, tree, all(tree), &mut found);
    let to_world = as_f64(to_world);
    let world = |node: usize| to_world.transform_point3(tree.positions()[node].as_dvec3());
    let (mut crossings, mut close) = (0, 0);
    for (node, parent) in tree.segments() {
        let expected = twin(twin_blade, world(parent), world(node));
        if expected.is_close {
            close += 1;
            continue;
        }
        let hits: Vec<&Severed> = found.iter().filter(|hit| hit.node.index() == node).collect();
        assert_eq!(hits.len(), expected.stretches.len(), "{case}, node {node}: {hits:?} {:?}", expected.stretches);
        for (hit, [from, to]) in hits.into_iter().zip(expected.stretches) {
            let error = (f64::from(hit.from) - from).abs().max((f64::from(hit.to) - to).abs());
            // Corners are rounded to f32 in the organ's space, and a segment may lie nearly in the blade.
            assert!(error < 2e-3, "{case}, node {node}: {hit:?}, not {from} to {to}");
            assert_eq!((hit.enters, hit.leaves), (from > 0.0, to < 1.0), "{case}, node {node}");
            crossings += usize::from(hit.enters) + usize::from(hit.leaves && blade.is_volume());
        }
    }
    (crossings, close)
}

#[test]
fn random_blades_of_every_kind_sever_what_the_twin_finds() {
    let mut rng = rng(21);
    for (kind, name) in ["rectangle", "disc", "sweep", "soup", "ball", "capsule"].into_iter().enumerate() {
        let (mut crossings, mut close, mut segments) = (0, 0, 0);
        for round in 0..400 {
            let tree = forest(round, 60);
            let to_world = random_transform(&mut rng, round as usize % 4);
            let (blade, twin) = random_blade(&mut rng, kind, |point| to_world.transform_point3(point));
            let case = format!("{name}, round {round}");
            let (more, undecided) = compare(&blade, &twin, &tree, &to_world, &case);
            crossings += more;
            close += undecided;
            segments += tree.segments().count();
        }
        assert!(crossings > 300, "{name}: only {crossings} crossings");
        assert!(close < segments / 100, "{name}: {close} of {segments} left open");
    }
}

#[test]
fn the_box_that_an_index_is_asked_for_holds_every_crossing() {
    let mut rng = rng(22);
    for round in 0..1_200 {
        let tree = forest(round, 60);
        let to_world = random_transform(&mut rng, round as usize % 4);
        let (blade, _) = random_blade(&mut rng, round as usize % 6, |point| to_world.transform_point3(point));
        let local = blade.to_local(&to_world).unwrap();
        let (mut by_all, mut by_box) = (Vec::new(), Vec::new());
        severed(&local, &tree, all(&tree), &mut by_all);
        let boxed = |region: &Region, visit: &mut dyn FnMut(_)| {
            let (min, max) = (region.min(), region.max());
            all(&tree)(region, &mut |node| {
                let end = tree.positions()[node.index()];
                let start = tree.parent(node).map_or(end, |parent| tree.positions()[parent.index()]);
                if start.min(end).cmple(max).all() && start.max(end).cmpge(min).all() {
                    visit(node);
                }
            });
        };
        severed(&local, &tree, boxed, &mut by_box);
        assert_eq!(by_all, by_box, "round {round}");
    }
}

#[test]
fn blades_that_cannot_cut_say_why() {
    let (a, b) = (Vec3::ZERO, Vec3::X);
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    for error in [
        Blade::ball(nan, 1.0).unwrap_err(),
        Blade::ball(a, f32::INFINITY).unwrap_err(),
        Blade::rectangle(a, nan, b).unwrap_err(),
        Blade::rectangle(Vec3::splat(f32::MAX), Vec3::splat(f32::MAX), b).unwrap_err(),
        Blade::sweep([a, b], [a, nan]).unwrap_err(),
        Blade::disc(a, nan, 1.0).unwrap_err(),
    ] {
        assert!(matches!(error, BladeError::NotFinite { .. }), "{error}");
    }
    assert_eq!(Blade::triangles(vec![]), Err(BladeError::NoTriangles));
    assert_eq!(Blade::sweep([a, b], [a, b]), Err(BladeError::NoArea { triangles: 2 }));
    assert_eq!(Blade::sweep([a, b], [2.0 * b, 3.0 * b]), Err(BladeError::NoArea { triangles: 2 }));
    assert_eq!(Blade::disc(a, Vec3::ZERO, 1.0), Err(BladeError::NoNormal));
    assert!(matches!(Blade::capsule(a, b, 0.0), Err(BladeError::NotPositive { value: 0.0, .. })));
    assert!(Blade::sweep([a, b], [a, Vec3::Y]).is_ok(), "an edge that turns about its end");
    let ball = Blade::ball(a, 1.0).unwrap();
    let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    assert_eq!(ball.to_local(&flat), Err(BladeError::Singular { determinant: 0.0 }));
    assert!(ball.to_local(&Affine3A::from_translation(nan)).is_err());
}
