//! The growth direction of a node: extend, sprout, or bifurcate (Rauch & Harders 2021, Eq. 4 and "symmetric
//! bifurcations").

use super::forest::Forest;
use super::lengths::Lengths;
use super::settings::AngleSpread;
use bevy_math::{Quat, Vec3, ops};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// A node's decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Decision {
    /// One new segment in this unit direction.
    Extend(Vec3),
    /// Two new segments in these unit directions.
    Bifurcate([Vec3; 2]),
    /// Nothing: the drains' pulls cancel out.
    Rest,
}

/// Decides for a node with the given acting drains.
pub(crate) fn decide(
    forest: &Forest,
    lengths: &Lengths,
    node: u32,
    drains: impl ExactSizeIterator<Item = Vec3> + Clone,
) -> Decision {
    let index = node as usize;
    let position = forest.tree.positions()[index];
    let pull: Vec3 = drains.clone().map(|drain| (drain - position).normalize_or_zero()).sum();
    let mean = pull.try_normalize();
    if forest.is_root(node) {
        return mean.map_or(Decision::Rest, Decision::Extend);
    }
    let along = forest.directions[index];
    if forest.children(node) > 0 {
        return mean.map_or(Decision::Rest, |mean| {
            let beside = turn_toward(along, mean, forest.sprout(node));
            Decision::Extend(mix(beside, mean, lengths.direction_weight))
        });
    }
    let growth = mean.map_or(along, |mean| mix(along, mean, lengths.direction_weight));
    if drains.len() >= 2
        && spread(position, along, drains.clone(), lengths.angle_spread) >= lengths.bifurcation_threshold
    {
        return Decision::Bifurcate(bifurcate(position, growth, drains, lengths.half_bifurcation));
    }
    Decision::Extend(growth)
}

/// Eq. 4: the weighted mean of the perception direction and the direction to the drains. If they cancel out, the latter
/// alone.
fn mix(perception: Vec3, mean: Vec3, weight: f32) -> Vec3 {
    (perception * weight + mean * (1.0 - weight)).try_normalize().unwrap_or(mean)
}

/// Turns a unit vector towards `target` by an angle of which cosine and sine are given, in the plane of both; in any plane
/// if they are parallel.
fn turn_toward(direction: Vec3, target: Vec3, (cos, sin): (f32, f32)) -> Vec3 {
    let across = target.reject_from_normalized(direction).try_normalize();
    (direction * cos + across.unwrap_or_else(|| direction.any_orthonormal_vector()) * sin).normalize_or(direction)
}

fn rotate(vector: Vec3, axis: Vec3, angle: f32) -> Vec3 {
    let (sin, cos) = ops::sin_cos(0.5 * angle);
    Quat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos) * vector
}

/// Spread, in radians, of the angles between a direction and the directions to the drains.
fn spread(position: Vec3, along: Vec3, drains: impl Iterator<Item = Vec3>, measure: AngleSpread) -> f32 {
    // Mean and squared deviations in one pass, since every angle takes an arc cosine (Welford 1962).
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for drain in drains {
        let angle = ops::acos(along.dot((drain - position).normalize_or(along)).clamp(-1.0, 1.0));
        let before = angle - mean;
        count += 1.0;
        mean += before / count;
        squares += before * (angle - mean);
    }
    match measure {
        AngleSpread::StandardDeviation => (squares / count).sqrt(),
        AngleSpread::RootSumOfSquares => squares.sqrt(),
    }
}

/// Two directions at the Murray angle about the growth direction, in the plane through the node and the drains' principal
/// line.
fn bifurcate(
    position: Vec3,
    growth: Vec3,
    drains: impl ExactSizeIterator<Item = Vec3> + Clone,
    half_angle: f32,
) -> [Vec3; 2] {
    let center = drains.clone().sum::<Vec3>() / drains.len() as f32;
    let line = principal_line(center, drains);
    // If node, centre and line are collinear, any plane contains them.
    let normal = (center - position).cross(line).try_normalize().unwrap_or_else(|| growth.any_orthonormal_vector());
    let in_plane = growth.reject_from_normalized(normal).try_normalize().unwrap_or(growth);
    let axis =
        normal.reject_from_normalized(in_plane).try_normalize().unwrap_or_else(|| in_plane.any_orthonormal_vector());
    [-half_angle, half_angle].map(|angle| rotate(in_plane, axis, angle))
}

/// Direction of the line through `center` with the least squared distances to the points: the eigenvector of their
/// covariance with the largest eigenvalue. Its sign is fixed, so that the daughters' order is, too.
fn principal_line(center: Vec3, points: impl Iterator<Item = Vec3> + Clone) -> Vec3 {
    // Relative to their extent, so that the covariance neither over- nor underflows.
    let extent = points.clone().map(|point| (point - center).abs().max_element()).fold(0.0, f32::max);
    if extent <= 0.0 {
        return Vec3::X;
    }
    let covariance = points.fold(Matrix3::<f64>::zeros(), |sum, point| {
        let offset = ((point - center) / extent).as_dvec3();
        let offset = Vector3::new(offset.x, offset.y, offset.z);
        sum + offset * offset.transpose()
    });
    let eigen = SymmetricEigen::new(covariance);
    let line = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let line = Vec3::new(line[0] as f32, line[1] as f32, line[2] as f32).normalize_or(Vec3::X);
    let sign = line.to_array().into_iter().find(|c| c.abs() > 1e-3).unwrap_or(1.0).signum();
    line * sign
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_principal_line_is_found_and_its_sign_fixed() {
        let direction = Vec3::new(-1.0, 2.0, 0.5).normalize();
        let points: Vec<Vec3> = (-3..=3).map(|i| direction * i as f32 + Vec3::Z * 0.01 * (i % 2) as f32).collect();
        let reversed: Vec<Vec3> = points.iter().rev().map(|p| p * 1e-12).collect();
        let line = principal_line(Vec3::ZERO, points.iter().copied());
        assert!(line.dot(direction).abs() > 0.999);
        assert!(principal_line(Vec3::ZERO, reversed.iter().copied()).dot(line) > 0.999);
        assert_eq!(principal_line(Vec3::ONE, [Vec3::ONE; 4].into_iter()), Vec3::X);
    }

    #[test]
    fn daughters_open_by_twice_the_half_angle_in_the_drains_plane() {
        let half = 37.5_f32.to_radians();
        let drains = [Vec3::new(1.0, 0.4, 0.0), Vec3::new(1.0, -0.5, 0.0), Vec3::new(0.9, 0.6, 0.0)];
        let [a, b] = bifurcate(Vec3::ZERO, Vec3::new(0.8, 0.1, 0.3).normalize(), drains.into_iter(), half);
        assert!((a.angle_between(b) - 2.0 * half).abs() < 1e-4);
        assert!(a.z.abs() < 1e-5 && b.z.abs() < 1e-5);
        // Drains collinear with the node: any plane, but the same angle.
        let row = [Vec3::X, Vec3::X * 2.0];
        let [a, b] = bifurcate(Vec3::ZERO, Vec3::X, row.into_iter(), half);
        assert!((a.angle_between(b) - 2.0 * half).abs() < 1e-4 && a.is_finite());
    }

    #[test]
    fn opposite_pulls_and_the_ends_of_the_weight_stay_finite() {
        assert_eq!(mix(Vec3::X, Vec3::NEG_X, 0.5), Vec3::NEG_X);
        assert_eq!(mix(Vec3::X, Vec3::Y, 0.0), Vec3::Y);
        assert_eq!(mix(Vec3::X, Vec3::Y, 1.0), Vec3::X);
        assert!(turn_toward(Vec3::X, Vec3::NEG_X, (0.6, 0.8)).is_normalized());
        let by_a_little = (0.3_f32.cos(), 0.3_f32.sin());
        assert!((turn_toward(Vec3::X, Vec3::Y, by_a_little).angle_between(Vec3::X) - 0.3).abs() < 1e-5);
    }

    #[test]
    fn spread_is_measured_as_asked() {
        let drains = [Vec3::new(1.0, 1.0, 0.0), Vec3::X];
        let deviation = spread(Vec3::ZERO, Vec3::X, drains.into_iter(), AngleSpread::StandardDeviation);
        let root = spread(Vec3::ZERO, Vec3::X, drains.into_iter(), AngleSpread::RootSumOfSquares);
        assert!((deviation.to_degrees() - 22.5).abs() < 1e-3);
        assert!((root.to_degrees() - 22.5 * 2.0_f32.sqrt()).abs() < 1e-3);
    }
}
