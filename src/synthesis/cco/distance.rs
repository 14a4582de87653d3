//! Distances between points and segments, in f64.

use bevy_math::DVec3;

/// Squared distance of a point from the segment between two points.
pub(super) fn squared_to_segment(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (way, offset) = (b - a, point - a);
    let square = way.length_squared();
    let share = if square > 0.0 { (offset.dot(way) / square).clamp(0.0, 1.0) } else { 0.0 };
    (offset - way * share).length_squared()
}

/// Squared distance between the segments from `a` to `b` and from `c` to `d`.
///
/// Source: Ericson, "Real-Time Collision Detection", section 5.1.9.
pub(super) fn squared_between([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> f64 {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv, uw, vw) = (u.length_squared(), u.dot(v), v.length_squared(), u.dot(w), v.dot(w));
    let determinant = uu * vv - uv * uv;
    // Parallel segments may take any point of the first.
    let mut s = if determinant > 1e-14 * uu * vv { ((uv * vw - uw * vv) / determinant).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = if vv > 0.0 { (uv * s + vw) / vv } else { 0.0 };
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = if uu > 0.0 { ((uv * t - uw) / uu).clamp(0.0, 1.0) } else { 0.0 };
    }
    (w + u * s - v * t).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;

    #[test]
    fn distances_agree_with_sampled_ones() {
        let mut rng = Stream::Statistics.rng(3);
        for case in 0..300 {
            let mut point = || DVec3::new(rng.random(), rng.random(), rng.random());
            let [a, b, c, mut d] = [point(), point(), point(), point()];
            if case % 5 == 0 {
                d = c + (b - a) * 0.7;
            }
            let along = |from: DVec3, to: DVec3, i: i32| from.lerp(to, f64::from(i) / 200.0);
            let sampled = (0..=200).map(|i| squared_to_segment(along(a, b, i), c, d)).fold(f64::MAX, f64::min);
            let exact = squared_between([a, b], [c, d]);
            assert!(exact <= sampled + 1e-12, "{exact} {sampled}");
            assert!(sampled.sqrt() - exact.sqrt() < 0.005);
            let sampled = (0..=200).map(|i| along(c, d, i).distance_squared(a)).fold(f64::MAX, f64::min);
            let exact = squared_to_segment(a, c, d);
            assert!(exact <= sampled + 1e-12 && sampled.sqrt() - exact.sqrt() < 0.005);
        }
    }
}
