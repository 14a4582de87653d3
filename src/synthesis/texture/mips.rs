//! Smaller levels of maps: means over the texels within charts.

use super::bytes::{normal_bytes, normal_of};
use super::maps::Level;
use super::paint::{BESIDE, COVERED};
use super::settings::MapKind;
use super::srgb::Srgb;
use crate::synthesis::parallel;
use bevy_math::Vec3;

/// Fewest rows worth a thread of their own.
const WORTH_SHARING: usize = 16;

/// Four texels, and their weights.
type Four = ([usize; 4], [f32; 4]);

/// A row of the next level of all maps.
struct Row<'a> {
    coverage: &'a mut [u8],
    maps: [Option<&'a mut [u8]>; MapKind::ALL.len()],
}

/// The next level, half as wide. Maps whose values cannot be averaged have none.
pub(super) fn halved(level: &Level) -> Level {
    let size = level.size / 2;
    let mut next = Level { size, coverage: vec![0; size * size], ..Level::default() };
    for kind in MapKind::ALL.into_iter().filter(|kind| kind.has_levels()) {
        let is_made = level.maps[kind as usize].is_some();
        next.maps[kind as usize] = is_made.then(|| vec![0; size * size * kind.format().bytes()]);
    }
    let mut rows: Vec<Row<'_>> =
        next.coverage.chunks_mut(size).map(|coverage| Row { coverage, maps: Default::default() }).collect();
    for (kind, map) in MapKind::ALL.into_iter().zip(&mut next.maps) {
        let Some(map) = map else { continue };
        for (row, bytes) in rows.iter_mut().zip(map.chunks_mut(size * kind.format().bytes())) {
            row.maps[kind as usize] = Some(bytes);
        }
    }
    let mut groups: Vec<&mut [Row<'_>]> = rows.chunks_mut(WORTH_SHARING).collect();
    parallel::for_each(&mut groups, |group, rows| {
        for (number, row) in rows.iter_mut().enumerate() {
            row.fill(level, group * WORTH_SHARING + number);
        }
    });
    next
}

impl Row<'_> {
    fn fill(&mut self, level: &Level, number: usize) {
        for column in 0..level.size / 2 {
            let first = 2 * number * level.size + 2 * column;
            let four = [first, first + 1, first + level.size, first + level.size + 1];
            let covers = four.map(|texel| level.coverage[texel]);
            if covers == [COVERED; 4] {
                self.coverage[column] = COVERED;
                self.mix(level, column, &(four, [0.25; 4]));
                continue;
            }
            let weights = covers.map(|cover| if cover > BESIDE { f32::from(cover) } else { 0.0 });
            let sum: f32 = weights.iter().sum();
            if sum > 0.0 {
                self.coverage[column] = ((0.25 * sum + 0.5) as u8).max(BESIDE + 1);
                self.mix(level, column, &(four, weights.map(|weight| weight / sum)));
            } else if let Some(known) = (0..4).find(|&texel| covers[texel] != 0) {
                self.coverage[column] = BESIDE;
                let weights = std::array::from_fn(|texel| if texel == known { 1.0 } else { 0.0 });
                self.mix(level, column, &(four, weights));
            }
        }
    }

    /// The means of four texels, in all maps.
    fn mix(&mut self, level: &Level, column: usize, four: &Four) {
        let [albedo, normal, height, roughness, ..] = &mut self.maps;
        let [albedos, normals, heights, roughnesses, ..] = &level.maps;
        if let (Some(albedo), Some(from)) = (albedo, albedos) {
            albedo[4 * column..][..4].copy_from_slice(&mean_color(from, four));
        }
        let mut length = 1.0;
        if let (Some(normal), Some(from)) = (normal, normals) {
            let (bytes, mean) = mean_normal(from, four);
            normal[4 * column..][..4].copy_from_slice(&bytes);
            length = mean;
        }
        if let (Some(height), Some(from)) = (height, heights) {
            let value = |texel: usize| f32::from(u16::from_le_bytes([from[2 * texel], from[2 * texel + 1]]));
            let mean = (mean(four, value) + 0.5) as u16;
            height[2 * column..][..2].copy_from_slice(&mean.to_le_bytes());
        }
        if let (Some(roughness), Some(from)) = (roughness, roughnesses) {
            let value = mean_roughness(from, four, length);
            roughness[4 * column..][..4].copy_from_slice(&[255, value, 0, 255]);
        }
    }
}

fn mean((texels, weights): &Four, value: impl Fn(usize) -> f32) -> f32 {
    (0..4).fold(0.0, |sum, k| sum + weights[k] * value(texels[k]))
}

/// The bytes of a texel, if all four that count have the same.
fn same(from: &[u8], (texels, weights): &Four) -> Option<[u8; 4]> {
    let [a, b, c, d] = texels.map(|texel| -> [u8; 4] { std::array::from_fn(|k| from[4 * texel + k]) });
    if a == b && a == c && a == d {
        return Some(a);
    }
    let mut counted = [a, b, c, d].into_iter().zip(weights).filter(|(_, weight)| **weight > 0.0);
    let (first, _) = counted.next()?;
    counted.all(|(other, _)| other == first).then_some(first)
}

fn mean_color(from: &[u8], four: &Four) -> [u8; 4] {
    same(from, four).unwrap_or_else(|| {
        let srgb = Srgb::tables();
        let [red, green, blue] =
            [0, 1, 2].map(|channel| srgb.encode(mean(four, |texel| srgb.decode(from[4 * texel + channel]))));
        [red, green, blue, 255]
    })
}

/// The mean direction, and the length of the mean.
fn mean_normal(from: &[u8], four: &Four) -> ([u8; 4], f32) {
    if let Some(bytes) = same(from, four) {
        return (bytes, 1.0);
    }
    let (texels, weights) = four;
    let sum: Vec3 = (0..4).map(|k| normal_of(&from[4 * texels[k]..][..3]) * weights[k]).sum();
    (normal_bytes(sum.try_normalize().unwrap_or(Vec3::Z)), sum.length().min(1.0))
}

/// The mean roughness of texels whose normals have a mean of some length.
///
/// What the mean loses of its length is spread of the normals: the reciprocal of the concentration
/// κ = (3r − r³)/(1 − r²) of a von Mises–Fisher lobe, which adds to the squared slope of the microfacets (Han et al.,
/// "Frequency domain normal map filtering", 2007; Neubelt & Pettineo, "Crafting a next-gen material pipeline for The
/// Order: 1886", 2013).
fn mean_roughness(from: &[u8], four: &Four, length: f32) -> u8 {
    let squared = |texel: usize| {
        let roughness = f32::from(from[4 * texel + 1]) / 255.0;
        roughness * roughness * roughness * roughness
    };
    if length == 1.0
        && let Some([_, roughness, ..]) = same(from, four)
    {
        return roughness;
    }
    let spread = (1.0 - length * length) / (3.0 * length - length * length * length).max(1.0e-6);
    ((mean(four, squared) + spread).min(1.0).sqrt().sqrt() * 255.0 + 0.5) as u8
}
