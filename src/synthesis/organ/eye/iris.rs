//! The iris: a disc with the pupil in it, of radial fibres, a ragged collarette and furrows.
//!
//! It is open: the inner border is the dark ruff round the pupil, the outer one lies in the eyeball's wall. The chart is
//! polar, and whole, since the pupil leaves no pole.

use super::{settings::IrisColor, shape::Shape};
use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{linear, mix, noise::Noise, rings::Rings, smooth_step},
};
use bevy_math::{Vec2, Vec3, ops};
use std::f32::consts::TAU;

/// How far the outer border reaches into the eyeball's wall, as a share of the limbus' radius.
const ROOT: f32 = 1.03;
/// Height of fibres and of the collarette, as a share of the limbus' radius.
const RELIEF: f32 = 0.012;
/// Features around the iris, per radian: coarse and fine fibres, and the teeth of the collarette.
const FIBRES: [f32; 2] = [11.0, 27.0];
const TEETH: f32 = 5.0;
/// Radius of the chart.
const CHART: f32 = 0.49;

/// Four colours of an iris: of its outer zone, of the zone about the pupil, of the fibres, and of the gaps between them.
struct Palette {
    outer: [f32; 4],
    inner: [f32; 4],
    fibre: [f32; 4],
    gap: [f32; 4],
}

impl IrisColor {
    fn palette(self) -> Palette {
        let [outer, inner, fibre, gap] = match self {
            Self::Brown => [[92, 56, 30], [78, 44, 22], [138, 92, 52], [38, 20, 10]],
            Self::Hazel => [[112, 104, 58], [122, 76, 34], [164, 142, 86], [52, 44, 24]],
            Self::Green => [[98, 116, 78], [132, 112, 62], [158, 168, 122], [44, 56, 40]],
            Self::Blue => [[96, 128, 158], [128, 140, 142], [176, 198, 214], [34, 56, 82]],
            Self::Grey => [[122, 132, 138], [140, 138, 128], [184, 190, 192], [58, 66, 72]],
        }
        .map(linear);
        Palette { outer, inner, fibre, gap }
    }
}

/// The disc, of about so many triangles.
pub(super) fn iris(shape: &Shape, color: IrisColor, triangles: usize, noise: Noise) -> ShadedMesh {
    // Cells several times as long as wide, along the fibres.
    let columns = 6 * (((triangles as f32 * 5.0).sqrt() / 6.0).round() as usize).max(4);
    let steps = (triangles / (2 * columns)).max(4);
    let weave = Weave { shape, palette: color.palette(), noise };
    let mut rings = Rings::default();
    for step in 0..=steps {
        let share = step as f32 / steps as f32;
        rings.add((0..columns).map(|column| weave.vertex(share, TAU * column as f32 / columns as f32)));
    }
    rings.finish()
}

struct Weave<'a> {
    shape: &'a Shape,
    palette: Palette,
    noise: Noise,
}

impl Weave<'_> {
    /// The vertex at a share of the way from the pupil to the root.
    fn vertex(&self, share: f32, around: f32) -> (Vec3, Vec2, [f32; 4]) {
        let shape = self.shape;
        let root = ROOT * shape.limbus_radius;
        let radius = shape.pupil_radius + (root - shape.pupil_radius) * share;
        let [sine, cosine] = [ops::sin(around), ops::cos(around)];
        let fibres = self.fibres(share, around);
        // The border of the pupil turns back.
        let ruff = 1.0 - smooth_step(0.0, 0.05, share);
        let height = self.raised(share, around) + 0.6 * fibres - 4.0 * ruff;
        let z = shape.pupil_z + (shape.root_z - shape.pupil_z) * share + RELIEF * shape.limbus_radius * height;
        let uv = Vec2::splat(0.5) + CHART * radius / root * Vec2::new(cosine, -sine);
        (Vec3::new(radius * cosine, radius * sine, z), uv, self.colour(share, around, fibres))
    }

    /// Radial fibres: −1 in the gaps, 1 on a fibre.
    fn fibres(&self, share: f32, around: f32) -> f32 {
        let [coarse, fine] = FIBRES.map(|fibres| {
            let turn = Vec2::new(ops::cos(around), ops::sin(around)) * fibres;
            self.noise.at(turn.extend(1.7 * share + fibres))
        });
        (0.9 * coarse + 0.8 * fine).clamp(-1.0, 1.0)
    }

    /// Where the collarette lies: at about a third of the way, in teeth.
    fn collarette(&self, around: f32) -> f32 {
        let turn = Vec2::new(ops::cos(around), ops::sin(around)) * TEETH;
        0.3 + 0.06 * self.noise.rough(turn.extend(3.0))
    }

    /// Height without fibres, relative to [`RELIEF`]: the collarette's ridge, and furrows outside of it.
    fn raised(&self, share: f32, around: f32) -> f32 {
        let away = (share - self.collarette(around)) / 0.06;
        let outside = smooth_step(0.45, 0.6, share) * (1.0 - smooth_step(0.9, 1.0, share));
        2.0 * ops::exp(-away * away)
            - 0.5 * outside * (0.5 + 0.5 * ops::sin(52.0 * share + 2.0 * self.collarette(around)))
    }

    fn colour(&self, share: f32, around: f32, fibres: f32) -> [f32; 4] {
        let Palette { outer, inner, fibre, gap } = self.palette;
        let away = share - self.collarette(around);
        let ground = mix(inner, outer, smooth_step(-0.06, 0.12, away));
        let woven = if fibres > 0.0 { mix(ground, fibre, 0.85 * fibres) } else { mix(ground, gap, -0.8 * fibres) };
        let ridge = ops::exp(-(away / 0.03) * (away / 0.03));
        let lit = mix(woven, fibre, 0.45 * ridge);
        // The dark rim under the limbus, and the ruff.
        let rim = mix(lit, mix(gap, linear([14, 14, 18]), 0.5), 0.9 * smooth_step(0.8, 0.95, share));
        mix(linear([16, 8, 6]), rim, smooth_step(0.012, 0.05, share))
    }
}
