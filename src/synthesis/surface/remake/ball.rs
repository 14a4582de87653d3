//! A ball in space.

use bevy_math::Vec3;

/// A ball, in which faces are replaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub center: Vec3,
    pub radius: f32,
}

impl Ball {
    /// A small ball that holds some points.
    pub fn around(points: impl Iterator<Item = Vec3> + Clone) -> Self {
        let (low, high) = points
            .clone()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)));
        let center = low.midpoint(high);
        let radius = points.map(|point| point.distance_squared(center)).fold(0.0, f32::max).sqrt();
        Self { center, radius }
    }

    /// Distance of a point from its surface, negative inside.
    pub fn height(&self, point: Vec3) -> f32 {
        point.distance(self.center) - self.radius
    }

    /// Whether a triangle reaches into it.
    pub fn meets(&self, [a, b, c]: [Vec3; 3]) -> bool {
        nearest(self.center, a, b, c).distance_squared(self.center) < self.radius * self.radius
    }

    /// The ball with another radius.
    pub fn scaled(&self, factor: f32) -> Self {
        Self { radius: self.radius * factor, ..*self }
    }
}

/// The point of a triangle that is nearest to a point; without an area, of one of its edges.
fn nearest(point: Vec3, a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let normal = (b - a).cross(c - a);
    let is_above = |from: Vec3, to: Vec3| (to - from).cross(point - from).dot(normal) >= 0.0;
    if normal != Vec3::ZERO && is_above(a, b) && is_above(b, c) && is_above(c, a) {
        return point - normal * ((point - a).dot(normal) / normal.length_squared());
    }
    let on_edge = |from: Vec3, to: Vec3| {
        let along = to - from;
        let share = (point - from).dot(along) / along.length_squared();
        if share.is_finite() { from + along * share.clamp(0.0, 1.0) } else { from }
    };
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    edges.into_iter().min_by(|p, q| p.distance_squared(point).total_cmp(&q.distance_squared(point))).unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;

    #[test]
    fn the_nearest_point_of_a_triangle_is_that_of_a_fine_grid() {
        let mut rng = Stream::Statistics.rng(1);
        let mut point = || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0f32..1.0)));
        for case in 0..200 {
            let [p, a, b, c] = std::array::from_fn(|_| point());
            let found = nearest(p, a, b, c).distance(p);
            let steps = 0..=60u32;
            let grid = steps.clone().flat_map(|i| (0..=60 - i).map(move |j| [i, j].map(|step| step as f32 / 60.0)));
            let least = grid.map(|[s, t]| (a + (b - a) * s + (c - a) * t).distance(p)).fold(f32::INFINITY, f32::min);
            assert!(found <= least + 1e-5 && least - found < 0.06, "case {case}: {found} against {least}");
        }
    }
}
