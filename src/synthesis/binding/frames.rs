//! Four vectors at a time, coordinate by coordinate, and the frames of node offsets.
//!
//! A frame takes two roots and two divisions, which are as fast for four as for one. Results don't depend on a vector's
//! position among the four.

use bevy_math::{Mat4, Vec3A, Vec4};

/// Number of nodes processed together.
pub(super) const LANES: usize = 4;

/// Four vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vectors {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

impl Vectors {
    pub fn dot(self, other: Self) -> Vec4 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    pub fn times(self, factors: Vec4) -> Self {
        Self { x: self.x * factors, y: self.y * factors, z: self.z * factors }
    }

    pub fn plus(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl From<[Vec3A; LANES]> for Vectors {
    fn from(vectors: [Vec3A; LANES]) -> Self {
        let [a, b, c, d] = vectors.map(|vector| vector.extend(0.0));
        let Mat4 { x_axis, y_axis, z_axis, .. } = Mat4::from_cols(a, b, c, d).transpose();
        Self { x: x_axis, y: y_axis, z: z_axis }
    }
}

impl From<Vectors> for [Vec3A; LANES] {
    fn from(Vectors { x, y, z }: Vectors) -> Self {
        let Mat4 { x_axis, y_axis, z_axis, w_axis } = Mat4::from_cols(x, y, z, Vec4::ZERO).transpose();
        [x_axis, y_axis, z_axis, w_axis].map(Vec3A::from_vec4)
    }
}

/// Four frames of unit vectors, or of zero vectors if they have no direction.
pub(super) struct Frames {
    /// Along the part of an edge perpendicular to the normal.
    pub along: Vectors,
    /// Perpendicular to both others.
    pub across: Vectors,
    /// Along the normal.
    pub up: Vectors,
}

impl Frames {
    /// The frames of edges and normals of any length whose products stay within f32.
    pub fn new(edges: Vectors, normals: Vectors) -> Self {
        let square = normals.dot(normals);
        let along = edges.times(square).minus(normals.times(normals.dot(edges)));
        // Both at the end, so that they don't wait for each other.
        let (long, short) = (inverse_root(along.dot(along)), inverse_root(square));
        Self { along: along.times(long), across: normals.cross(along).times(long * short), up: normals.times(short) }
    }
}

/// 1/√square; 0 if that isn't finite.
fn inverse_root(squares: Vec4) -> Vec4 {
    Vec4::from_array(squares.to_array().map(|square| {
        let inverse = 1.0 / square.sqrt();
        if inverse < f32::INFINITY { inverse } else { 0.0 }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_wherever_they_stand() {
        let normals = [Vec3A::Z * 0.3, Vec3A::new(1.0, 2.0, -0.5), Vec3A::ZERO, Vec3A::X];
        let edges = [Vec3A::new(2.0, 0.0, 5.0), Vec3A::Y, Vec3A::Y, Vec3A::X * 0.5];
        for turn in 0..LANES {
            let at = |vectors: &[Vec3A; LANES]| std::array::from_fn(|lane| vectors[(lane + turn) % LANES]);
            let Frames { along, across, up } = Frames::new(at(&edges).into(), at(&normals).into());
            let axes = [along, across, up].map(<[Vec3A; LANES]>::from);
            for lane in 0..LANES {
                let [along, across, up] = axes.map(|axis| axis[lane]);
                let number = (lane + turn) % LANES;
                assert!((up - normals[number].normalize_or_zero()).length() < 1e-6);
                match number {
                    0 => assert!((along - Vec3A::X).length() < 1e-6 && (across - Vec3A::Y).length() < 1e-6),
                    1 => assert!((along.cross(across) - up).length() < 1e-6 && along.dot(edges[1]) > 0.1),
                    // Without a normal there is no frame; with an edge along the normal, only that.
                    _ => assert_eq!([along, across], [Vec3A::ZERO; 2]),
                }
            }
        }
    }
}
