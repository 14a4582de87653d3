//! The border of a mask: the faces between set cells and others, with an index over them.

use crate::synthesis::space::bvh::{Bounds, BoxTree};
use bevy_math::{Vec3, Vec3A};

/// The faces around a set of cells; in an image, the edges around its pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct MaskBorder {
    /// Rectangles, in the order of the index.
    faces: Vec<Bounds>,
    index: BoxTree,
}

impl MaskBorder {
    /// The border of cells of a grid of so many along each axis, listed in the order of their numbers: x first.
    ///
    /// `corner` gives a point of a cell, from 0 to 1 along each axis. Only the first `axes` axes have faces.
    pub(super) fn new(
        size: [usize; 3],
        axes: usize,
        set: &[u32],
        is_set: impl Fn(usize) -> bool,
        corner: impl Fn(usize, Vec3) -> Vec3,
    ) -> Self {
        let strides = [1, size[0], size[0] * size[1]];
        let mut faces = Vec::new();
        for axis in 0..axes {
            for side in [0usize, 1] {
                let is_open = |cell: usize| {
                    let at = cell / strides[axis] % size[axis];
                    let is_last = if side == 0 { at == 0 } else { at + 1 == size[axis] };
                    let beside = || if side == 0 { cell - strides[axis] } else { cell + strides[axis] };
                    is_last || !is_set(beside())
                };
                // Faces beside each other along x are one.
                let goes_on = |&a: &u32, &b: &u32| axis > 0 && b == a + 1 && !(b as usize).is_multiple_of(size[0]);
                let open: Vec<u32> = set.iter().copied().filter(|&cell| is_open(cell as usize)).collect();
                for run in open.chunk_by(goes_on) {
                    let mut ends = [Vec3::ZERO, Vec3::ONE];
                    ends[0][axis] = side as f32;
                    ends[1][axis] = side as f32;
                    let (first, last) = (run[0] as usize, run[run.len() - 1] as usize);
                    faces.push(Bounds { min: corner(first, ends[0]).into(), max: corner(last, ends[1]).into() });
                }
            }
        }
        let index = BoxTree::new(faces.iter().copied());
        let faces = index.order().iter().map(|&face| faces[face as usize]).collect();
        Self { faces, index }
    }

    /// Distance of a point from the border.
    pub(super) fn distance(&self, point: Vec3) -> f32 {
        let point = Vec3A::from(point);
        let mut least = f32::INFINITY;
        self.index.nearest(point.into(), f32::INFINITY, |slot, best| {
            let face = &self.faces[slot];
            let square = point.clamp(face.min, face.max).distance_squared(point);
            least = least.min(square);
            best.min(square)
        });
        least.sqrt()
    }
}
