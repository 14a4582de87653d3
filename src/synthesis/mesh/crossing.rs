//! Crossings of lines with triangles.

use bevy_math::DVec2;

/// The crossing of a triangle with the line through `point` perpendicular to the plane of `flat`: whether the triangle
/// faces up (1) or down (−1), and the height.
///
/// A line through an edge or a vertex counts as moved by an infinitesimal amount, the same for all triangles, so it
/// crosses a closed surface once at each place.
pub(crate) fn crossing(point: DVec2, flat: [DVec2; 3], heights: [f64; 3]) -> Option<(i16, f64)> {
    let [a, b, c] = flat;
    // Twice the areas of the triangles formed by the point and the edges opposite a, b and c.
    let (areas_a, areas_b, areas_c) = (side(b, c, point), side(c, a, point), side(a, b, point));
    let facing = areas_a.1;
    if areas_b.1 != facing || areas_c.1 != facing {
        return None;
    }
    let area = areas_a.0 + areas_b.0 + areas_c.0;
    if area == 0.0 {
        return None;
    }
    let height = (areas_a.0 * heights[0] + areas_b.0 * heights[1] + areas_c.0 * heights[2]) / area;
    Some((facing, height))
}

/// Twice the signed area of the triangle of a directed edge and a point, and the point's side of the edge: 1 for left.
fn side(from: DVec2, to: DVec2, point: DVec2) -> (f64, i16) {
    // Always computed for the same direction of an edge, so that both of its triangles get the same rounding.
    let ordered = (from.x, from.y) < (to.x, to.y);
    let (low, high) = if ordered { (from, to) } else { (to, from) };
    let edge = high - low;
    let area = edge.perp_dot(point - low);
    // On the edge, the point counts as moved by (ε, ε²).
    let left = if area != 0.0 {
        area > 0.0
    } else if edge.y != 0.0 {
        edge.y < 0.0
    } else {
        edge.x > 0.0
    };
    let sign = if left == ordered { 1 } else { -1 };
    (if ordered { area } else { -area }, sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_through_edges_and_vertices_cross_once() {
        // A fan around the origin: each line must cross exactly one of its triangles.
        let around: Vec<DVec2> = [(2.0, 0.0), (2.0, 1.0), (0.0, 2.0), (-1.0, 0.0), (-1.0, -1.0), (0.0, -3.0)]
            .into_iter()
            .map(DVec2::from)
            .collect();
        for point in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-0.5, -0.5), (0.0, -1.5), (0.1, 0.2), (1.0, 0.5)] {
            let crossed = (0..around.len())
                .filter_map(|i| {
                    let fan = [DVec2::ZERO, around[i], around[(i + 1) % around.len()]];
                    crossing(point.into(), fan, [1.0; 3])
                })
                .collect::<Vec<_>>();
            assert_eq!(crossed.len(), 1, "at {point:?}");
            assert_eq!(crossed[0].0, 1);
        }
    }
}
