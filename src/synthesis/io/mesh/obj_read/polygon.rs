//! Polygons cut into triangles.
//!
//! A convex polygon becomes a fan around its first corner. A concave one of four corners is cut along its other
//! diagonal, one of more corners by ears, in the plane that it faces: Meisters, "Polygons have ears", American
//! Mathematical Monthly 82 (1975). The area of the triangles is that of the polygon, or the polygon is refused.

use bevy_math::{DVec2, DVec3};
use earcut::Earcut;

/// Most corners of a concave polygon: the time to cut one grows with their square.
const MOST_CONCAVE_CORNERS: usize = 4096;

/// Twice an area, relative to the square of the polygon's size, up to which it counts as none.
const NO_AREA: f64 = 1.0e-10;

/// Largest difference between the areas of a polygon and of its triangles, relative to the first.
const AREA_ERROR: f64 = 1.0e-6;

const CROSSES: &str = "a face crosses itself; export the organ as triangles";

/// Cuts one polygon after the other in the same memory.
#[derive(Default)]
pub(super) struct Polygons {
    corners: Vec<DVec3>,
    flat: Vec<DVec2>,
    ears: Vec<u32>,
    pending: Vec<[u32; 3]>,
    next_used: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    earcut: Option<Earcut<f64>>,
}

impl Polygons {
    /// Triangles between the corners of a polygon, by their numbers, facing as the polygon does.
    pub(super) fn cut(&mut self, corners: impl Iterator<Item = DVec3>) -> Result<&[[u32; 3]], &'static str> {
        self.corners.clear();
        self.corners.extend(corners);
        self.triangles.clear();
        match self.corners[..] {
            [] | [_] | [_, _] => {}
            [_, _, _] => self.triangles.push([0, 1, 2]),
            [a, b, c, d] => self.triangles.extend(halves([a, b, c, d])?),
            _ => self.cut_many()?,
        }
        Ok(&self.triangles)
    }

    fn cut_many(&mut self) -> Result<(), &'static str> {
        let count = self.corners.len() as u32;
        let first = self.corners[0];
        self.corners.iter_mut().for_each(|corner| *corner -= first);
        let size = self.corners.iter().map(|corner| corner.length_squared()).fold(0.0, f64::max);
        let is_nothing = |doubled: f64| doubled <= NO_AREA * size;
        let normal: DVec3 = self.corners.windows(2).map(|pair| pair[0].cross(pair[1])).sum();
        let fan = || (1..count - 1).map(|corner| [0, corner, corner + 1]);
        if is_nothing(normal.length()) {
            // Corners on a line have no surface. Others cross themselves.
            let is_line = self.corners.windows(2).all(|pair| is_nothing(pair[0].cross(pair[1]).length()));
            self.triangles.extend(fan());
            return if is_line { Ok(()) } else { Err(CROSSES) };
        }
        // Along the axis that it faces most, so that coordinates stay exact; counter-clockwise.
        let axis = normal.abs().max_position();
        let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
        let (x, y) = if normal[axis] > 0.0 { (x, y) } else { (y, x) };
        self.flat.clear();
        self.flat.extend(self.corners.iter().map(|corner| DVec2::new(corner[x], corner[y])));
        let is_convex = self.flat[1..].windows(2).all(|pair| pair[0].perp_dot(pair[1]) >= -NO_AREA * size);
        if is_convex {
            self.triangles.extend(fan());
            return Ok(());
        }
        self.cut_ears(normal.abs().max_element())
    }

    /// Cuts the flat polygon, of this doubled area.
    fn cut_ears(&mut self, area: f64) -> Result<(), &'static str> {
        if self.flat.len() > MOST_CONCAVE_CORNERS {
            return Err("a concave face has more than 4096 corners; export the organ as triangles");
        }
        let earcut = self.earcut.get_or_insert_with(Earcut::new);
        earcut.earcut(self.flat.iter().map(|corner| corner.to_array()), &[], &mut self.ears);
        self.find_used();
        let doubled = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| self.flat[corner as usize]);
            (b - a).perp_dot(c - a)
        };
        self.pending.clear();
        let upwards = |&ear: &[u32; 3]| if doubled(ear) < 0.0 { [ear[0], ear[2], ear[1]] } else { ear };
        self.pending.extend(self.ears.as_chunks().0.iter().map(upwards));
        while let Some([a, b, c]) = self.pending.pop() {
            if self.triangles.len() + self.pending.len() >= self.flat.len() {
                return Err(CROSSES);
            }
            let left_out = |[a, b, c]: [u32; 3]| self.left_out(a, b).map(|middle| [a, middle, b, c]);
            match [[a, b, c], [b, c, a], [c, a, b]].into_iter().find_map(left_out) {
                Some([a, middle, b, c]) => self.pending.extend([[a, middle, c], [middle, b, c]]),
                None => self.triangles.push([a, b, c]),
            }
        }
        let covered: f64 = self.triangles.iter().map(|&triangle| doubled(triangle).abs()).sum();
        if (covered - area).abs() <= AREA_ERROR * area { Ok(()) } else { Err(CROSSES) }
    }

    /// Finds the next corner after each that is the corner of an ear.
    fn find_used(&mut self) {
        let count = self.flat.len();
        let next = &mut self.next_used;
        next.clear();
        next.resize(count, u32::MAX);
        for &corner in &self.ears {
            next[(corner as usize + count - 1) % count] = corner;
        }
        // Twice around: the next of the last corners is one of the first.
        for at in (0..2 * count).rev() {
            if next[at % count] == u32::MAX {
                next[at % count] = next[(at + 1) % count];
            }
        }
    }

    /// The first of the corners that ears leave out between two corners, if there are only such.
    ///
    /// They lie on a line between others. Neighbours of the polygon have them, so its edges have to go through them.
    fn left_out(&self, from: u32, to: u32) -> Option<u32> {
        let after = (from + 1) % self.next_used.len() as u32;
        (after != to && self.next_used[from as usize] == to).then_some(after)
    }
}

/// The two triangles of a quadrilateral. In a concave one, a cut along the wrong diagonal gives halves that face
/// opposite ways.
fn halves([a, b, c, d]: [DVec3; 4]) -> Result<[[u32; 3]; 2], &'static str> {
    let agreement = |[a, b, c, d]: [DVec3; 4]| {
        let normals = [(b - a).cross(c - a), (c - a).cross(d - a)];
        let [first, second] = normals.map(|normal| normal.normalize_or_zero());
        first.dot(second)
    };
    // Halves that a fold makes face each other, not quite the same as those that lie on each other.
    const OPPOSITE: f64 = -0.999;
    let (first, second) = (agreement([a, b, c, d]), agreement([b, c, d, a]));
    match (first, second) {
        _ if first < OPPOSITE && second < OPPOSITE => Err(CROSSES),
        _ if first < 0.0 && second > first => Ok([[1, 2, 3], [1, 3, 0]]),
        _ => Ok([[0, 1, 2], [0, 2, 3]]),
    }
}

#[cfg(test)]
mod tests;
