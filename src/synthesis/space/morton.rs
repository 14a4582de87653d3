//! A space-filling curve: neighbours on it are neighbours in space.

use bevy_math::Vec3;

/// Bits of a coordinate in the key of a [`Curve`].
const KEY_BITS: u32 = 21;

/// A space-filling curve through a box.
///
/// It is Morton's curve: 21 bits of each coordinate, interleaved. Points outside count as on the nearest face.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Curve {
    min: Vec3,
    scale: f32,
}

impl Curve {
    /// A curve through the cube around points, enlarged by a factor about its middle.
    pub(crate) fn around(points: impl Iterator<Item = Vec3>, wider: f32) -> Self {
        let around = |(min, max): (Vec3, Vec3), point: Vec3| (min.min(point), max.max(point));
        let (min, max) = points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), around);
        let largest = ((1u32 << KEY_BITS) - 1) as f32;
        // Points that coincide, and no points, have one cell.
        let size = wider * (max - min).max_element();
        if size > 0.0 { Self { min: min.midpoint(max) - 0.5 * size, scale: largest / size } } else { Self::default() }
    }

    /// Position of a point on the curve.
    pub(crate) fn key(&self, point: Vec3) -> u64 {
        // The cast saturates.
        let cell = ((point - self.min) * self.scale).as_uvec3().to_array().map(spread);
        cell[0] | cell[1] << 1 | cell[2] << 2
    }
}

/// Spreads the lowest 21 bits, with two zeros between neighbours.
fn spread(bits: u32) -> u64 {
    let mut spread = u64::from(bits.min((1 << KEY_BITS) - 1));
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249u64),
    ] {
        spread = (spread | spread << shift) & mask;
    }
    spread
}

#[cfg(test)]
mod tests {
    use crate::synthesis::space::morton::*;

    #[test]
    fn spread_bits_are_three_apart() {
        for bits in [0, 1, 2, 0b1011, 0x15_5555, 0x1f_ffff] {
            let slow: u64 = (0..KEY_BITS).filter(|bit| bits >> bit & 1 == 1).map(|bit| 1u64 << (3 * bit)).sum();
            assert_eq!(spread(bits), slow, "{bits:b}");
        }
    }

    #[test]
    fn curve_passes_octant_by_octant() {
        let corners: Vec<Vec3> =
            (0..64u8).rev().map(|i| Vec3::new(f32::from(i & 3), f32::from(i >> 2 & 3), f32::from(i >> 4))).collect();
        for wider in [1.0, 4.0] {
            let curve = Curve::around(corners.iter().copied(), wider);
            let mut order = corners.clone();
            order.sort_by_key(|&corner| curve.key(corner));
            for eight in order.chunks(8) {
                assert!(eight.iter().all(|corner| (corner / 2.0).as_uvec3() == (eight[0] / 2.0).as_uvec3()));
            }
        }
        let point = Curve::around([Vec3::ONE; 3].into_iter(), 1.0);
        assert_eq!(point.key(Vec3::ONE), Curve::default().key(Vec3::NEG_ONE));
        assert_eq!(Curve::around(std::iter::empty(), 1.0).key(Vec3::ONE), 0);
    }
}
