//! A ball in space.

use crate::synthesis::mesh::triangle_index::closest_on_triangle;
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
    pub fn meets(&self, corners: [Vec3; 3]) -> bool {
        let (_, nearest) = closest_on_triangle(self.center, corners);
        nearest.distance(self.center.as_dvec3()) < f64::from(self.radius)
    }

    /// The ball with another radius.
    pub fn scaled(&self, factor: f32) -> Self {
        Self { radius: self.radius * factor, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;

    #[test]
    fn a_ball_meets_a_triangle_as_far_as_the_nearest_point_of_a_fine_grid() {
        let mut rng = Stream::Statistics.rng(1);
        let mut point = || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0f32..1.0)));
        for case in 0..200 {
            let [center, a, b, c] = std::array::from_fn(|_| point());
            let steps = 0..=60u32;
            let grid = steps.clone().flat_map(|i| (0..=60 - i).map(move |j| [i, j].map(|step| step as f32 / 60.0)));
            let distances = grid.map(|[s, t]| (a + (b - a) * s + (c - a) * t).distance(center));
            let least = distances.fold(f32::INFINITY, f32::min);
            let meets = |radius: f32| Ball { center, radius }.meets([a, b, c]);
            assert!(meets(least + 1e-5) && !meets(least - 0.06), "case {case}: {least}");
        }
    }
}
