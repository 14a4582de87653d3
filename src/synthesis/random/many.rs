//! Many random points at once: long runs of words from the generator cost a fraction of single words.

use crate::synthesis::random::VesselRng;
use bevy_math::Vec3;
use rand::Rng;

/// Words taken from the generator at once. The rest of the last run is dropped.
const RUN: usize = 192;

/// Appends `count` points, each made from `N` random words. Where `point` says that they make none, other words are drawn.
///
/// Every point is written, and the next one goes to the same place if it is none. A branch would be guessed wrong for one
/// in five points of a disc, and for every second one of a ball, which takes longer than all the rest.
pub(crate) fn draw<const N: usize>(
    rng: &mut VesselRng,
    count: u32,
    points: &mut Vec<Vec3>,
    point: impl Fn([u32; N]) -> (bool, Vec3),
) {
    let mut words = [0u32; RUN];
    let mut run = [Vec3::ZERO; RUN];
    let mut left = count as usize;
    points.reserve(left);
    while left > 0 {
        rng.fill_bytes(bytemuck::cast_slice_mut(&mut words));
        let mut drawn = 0;
        for &own in words.as_chunks::<N>().0 {
            // The generator's bytes are those of little-endian words.
            let (is_one, point) = point(own.map(u32::from_le));
            run[drawn] = point;
            drawn += usize::from(is_one);
        }
        let taken = drawn.min(left);
        points.extend_from_slice(&run[..taken]);
        left -= taken;
    }
}

/// Calls `each` for `count` groups of `N` random words.
pub(crate) fn each<const N: usize>(rng: &mut VesselRng, count: u32, mut each: impl FnMut([u32; N])) {
    let mut words = [0u32; RUN];
    let mut left = count as usize;
    while left > 0 {
        rng.fill_bytes(bytemuck::cast_slice_mut(&mut words));
        let lots = words.as_chunks::<N>().0;
        lots.iter().take(left).for_each(|lot| each(lot.map(u32::from_le)));
        left -= left.min(lots.len());
    }
}

/// How many of `count` uniform numbers lie below `share`: a binomial variate, to within 2⁻³² of its probability.
pub(crate) fn count_below(rng: &mut VesselRng, count: u32, share: f64) -> u32 {
    let limit = (share * f64::from(u32::MAX)) as u32;
    let mut below = 0;
    each(rng, count, |[word]| below += u32::from(word < limit));
    below
}

/// A number from −1 to 1.
#[inline]
pub(crate) fn signed(word: u32) -> f32 {
    word as i32 as f32 * (1.0 / (1u32 << 31) as f32)
}

/// A number from 0 to below 1.
#[inline]
pub(crate) fn unit(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

/// A number from 0 to below `count`, by the high half of a product: the numbers of words that give each result differ
/// by at most one.
#[inline]
pub(crate) fn below(word: u32, count: u32) -> u32 {
    ((u64::from(word) * u64::from(count)) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use crate::synthesis::random::Stream;
    use crate::synthesis::random::many::*;

    #[test]
    fn numbers_are_even_and_within_their_limits() {
        let mut points = Vec::new();
        draw(&mut Stream::Attraction.rng(3), 30_000, &mut points, |[a, b, c]| {
            let point = Vec3::new(signed(a), unit(b), below(c, 10) as f32);
            assert!((-1.0..=1.0).contains(&point.x) && (0.0..1.0).contains(&point.y) && point.z < 10.0);
            (true, point)
        });
        assert_eq!(points.len(), 30_000);
        let mut counts = [[0; 10]; 3];
        for point in points {
            counts[0][((point.x + 1.0) * 5.0).min(9.0) as usize] += 1;
            counts[1][(point.y * 10.0) as usize] += 1;
            counts[2][point.z as usize] += 1;
        }
        // Five standard deviations of a count around 3000.
        assert!(counts.as_flattened().iter().all(|&count: &i32| (count - 3000).abs() < 260), "{counts:?}");
    }

    #[test]
    fn points_that_are_turned_down_are_replaced() {
        let mut points = Vec::new();
        let upper = |[word]: [u32; 1]| (word % 4 == 0, Vec3::splat(unit(word)));
        for count in [1000, 0, 1, 63] {
            let mut rng = Stream::Attraction.rng(4);
            points.clear();
            draw(&mut rng.clone(), count, &mut points, upper);
            let words = std::iter::repeat_with(|| rng.next_u32()).filter(|word| word % 4 == 0);
            let expected: Vec<Vec3> = words.take(count as usize).map(|word| Vec3::splat(unit(word))).collect();
            assert_eq!(points, expected);
        }
    }
}
