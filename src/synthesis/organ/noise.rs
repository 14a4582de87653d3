//! Smooth value noise in space: the same number for the same point and seed on every platform.

use bevy_math::{IVec3, Vec3};

/// Noise with a seed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    seed: u32,
}

impl Noise {
    /// Noise that is different for every seed.
    pub fn new(seed: u32) -> Self {
        Self { seed }
    }

    /// One octave in [−1, 1] whose features are about a unit wide.
    pub fn at(self, point: Vec3) -> f32 {
        let floor = point.floor();
        let cell = floor.as_ivec3();
        let inside = point - floor;
        let blend = inside * inside * (Vec3::splat(3.0) - 2.0 * inside);
        let corner = |x, y, z| self.lattice(cell + IVec3::new(x, y, z));
        let lerp = |a: f32, b: f32, share: f32| a + (b - a) * share;
        let along_x = |y, z| lerp(corner(0, y, z), corner(1, y, z), blend.x);
        let along_y = |z| lerp(along_x(0, z), along_x(1, z), blend.y);
        lerp(along_y(0), along_y(1), blend.z)
    }

    /// Three octaves in [−1, 1], each half as wide and half as strong as the one before.
    pub fn rough(self, point: Vec3) -> f32 {
        (self.at(point)
            + 0.5 * self.at(point * 2.0 + Vec3::splat(17.0))
            + 0.25 * self.at(point * 4.0 - Vec3::splat(5.0)))
            / 1.75
    }

    /// The value at a lattice point, in [−1, 1]: a hash (the finaliser of `MurmurHash3`).
    fn lattice(self, cell: IVec3) -> f32 {
        let mut hash = self.seed
            ^ (cell.x as u32).wrapping_mul(0x8da6_b343)
            ^ (cell.y as u32).wrapping_mul(0xd816_3841)
            ^ (cell.z as u32).wrapping_mul(0xcb1a_b31f);
        hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
        hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
        hash ^= hash >> 16;
        (hash >> 8) as f32 / 8_388_607.5 - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_bounded_smooth_and_seeded() {
        let noise = Noise::new(3);
        for step in 0..2000 {
            let point = Vec3::new(0.037, -0.021, 0.013) * step as f32;
            let value = noise.at(point);
            assert!((-1.0..=1.0).contains(&value));
            assert!((noise.at(point + Vec3::splat(1e-4)) - value).abs() < 2e-3);
        }
        assert_ne!(noise.at(Vec3::splat(0.3)), Noise::new(4).at(Vec3::splat(0.3)));
    }
}
