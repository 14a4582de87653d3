//! The colon's wall: distances of its outer and inner side from the centre line, and their colours.
//!
//! Both sides are graphs over arc length and angle, the inner below the outer, so the wall cannot intersect itself if
//! the centre line leaves room for it.

use super::{
    ColonSettings,
    haustra::{self, Haustrum, ROWS, Row},
    path,
};
use crate::synthesis::{
    organ::{
        centre_line::{CentreLine, Frame},
        linear, mix,
        noise::Noise,
        smooth_step,
    },
    random::VesselRng,
};
use bevy_math::{Vec3, ops};
use std::f32::consts::{PI, TAU};

/// Room for the wall, as a multiple of the mean radius: the outermost bulge.
pub(super) const CLEARANCE: f32 = 1.26;

/// Radii relative to the mean radius, for haustra of the default depth.
const TAENIA: f32 = 0.93;
const GROOVE: f32 = 0.75;
const BULGE: f32 = 0.40;
const TAENIA_RIDGE: f32 = 0.022;
/// Height of a semilunar fold in the lumen, relative to the mean radius.
const FOLD: f32 = 0.26;
/// Half width of a semilunar fold's crest, in metres.
const FOLD_WIDTH: f32 = 0.0046;

/// A side of the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Outer,
    Inner,
}

/// Everything that gives the wall its shape.
pub(super) struct Wall {
    pub line: CentreLine,
    /// Arc length at which the caecum begins, and the cap's length from there to its full calibre.
    pub apex: f32,
    cap: f32,
    /// Arc length of the cut end.
    pub end: f32,
    pub rows: [Row; ROWS],
    thickness: f32,
    taenia_half_width: f32,
    depth: f32,
    unit: f32,
    appendix: bool,
    shape_noise: Noise,
    colour_noise: Noise,
}

/// Values shared by all columns of a ring.
pub(super) struct Section {
    pub frame: Frame,
    mean: f32,
    depth: f32,
    thickness: f32,
    haustra: [Haustrum; ROWS],
}

impl Wall {
    pub fn new(settings: &ColonSettings, rng: &mut VesselRng) -> Self {
        let line = path::course(settings, CLEARANCE, rng);
        let apex = line.frames().iter().position(|frame| frame.weight >= 0.0).unwrap_or(0) as f32
            * (line.length() / line.frames().len().saturating_sub(1).max(1) as f32);
        let unit = settings.width / ColonSettings::DEFAULT_WIDTH;
        let cap = 0.95 * line.at(apex + 0.05 * unit).radius;
        let end = line.length();

        let rows = haustra::rows(&line, apex + 0.3 * cap, end - 0.02 * unit, settings.haustrum_length, rng);
        use rand::Rng;
        Self {
            line,
            apex,
            cap,
            end,
            rows,
            thickness: settings.wall_thickness,
            taenia_half_width: 0.5 * settings.taenia_width,
            depth: settings.haustra_depth,
            unit,
            appendix: settings.appendix,
            shape_noise: Noise::new(rng.next_u32()),
            colour_noise: Noise::new(rng.next_u32()),
        }
    }

    /// Arc length at which a side begins, at its blind end.
    pub fn start(&self, side: Side) -> f32 {
        match side {
            Side::Outer if self.appendix => 0.0,
            Side::Outer => self.apex,
            Side::Inner => self.apex + self.thickness,
        }
    }

    /// Mean radius of a side, in metres: 0 at its blind end.
    pub fn mean_radius(&self, side: Side, arc: f32) -> f32 {
        let body = self.line.at(arc.max(self.apex + 0.05 * self.unit)).radius;
        let (thickness, start) = match side {
            Side::Outer => (0.0, self.apex),
            Side::Inner => (self.thickness, self.apex + self.thickness),
        };
        let pouch = (body - thickness) * cap(arc - start, self.cap - thickness);
        if side == Side::Inner || !self.appendix {
            return pouch;
        }
        let radius = path::APPENDIX_RADIUS * self.unit;
        let appendix = radius * cap(arc, radius);
        smooth_max(pouch, appendix, appendix.min(0.0035 * self.unit))
    }

    /// The wall at an arc length.
    pub fn section(&self, side: Side, arc: f32) -> Section {
        let frame = self.line.at(arc);
        let grown = smooth_step(0.1 * self.cap, 0.9 * self.cap, arc - self.apex);
        Section {
            mean: self.mean_radius(side, arc),
            depth: self.depth * frame.weight.max(0.0) * grown,
            thickness: self.thickness,
            haustra: [0, 1, 2].map(|row| self.rows[row].at(arc)),
            frame,
        }
    }

    /// Distance of a side from the centre line at an angle, in metres.
    pub fn radius(&self, side: Side, section: &Section, angle: f32) -> f32 {
        let place = self.place(section, angle);
        let depth = section.depth;
        let relative = match side {
            Side::Outer => {
                let ridge = TAENIA_RIDGE * (1.0 - place.belly) * depth.min(1.0);
                let belly = place.belly * (GROOVE - TAENIA + BULGE * place.haustrum.bulge * place.roundness);
                1.0 + depth * (TAENIA - 1.0 + belly) + ridge
            }
            Side::Inner => {
                let across = place.haustrum.to_fold / (FOLD_WIDTH * self.unit);
                let crescent = FOLD * ops::exp(-across * across) * place.crescent;
                let belly = GROOVE - TAENIA + BULGE * place.haustrum.bulge * place.roundness;
                1.0 + depth * (TAENIA - 1.0 + place.belly * belly - crescent)
            }
        };
        let uneven = 1.0 + 0.018 * self.shape_noise.at(self.noise_point(section, angle, 0.022));
        section.mean * relative * uneven
    }

    /// Colour of a side at an angle, linear RGB.
    pub fn colour(&self, side: Side, section: &Section, angle: f32) -> [f32; 4] {
        let place = self.place(section, angle);
        let mottle = self.colour_noise.rough(self.noise_point(section, angle, 0.016));
        match side {
            Side::Outer => {
                let serosa = mix(linear([190, 106, 96]), linear([208, 134, 118]), place.haustrum.bulge);
                let creased = mix(serosa, linear([160, 74, 68]), 0.65 * self.crease(&place) * section.depth);
                let taenia = linear([226, 182, 160]);
                let banded = mix(creased, taenia, 0.8 * (1.0 - place.belly) * smooth_step(0.0, 0.3, section.depth));
                mix(banded, linear([178, 84, 80]), 0.28 * (mottle + 0.4))
            }
            Side::Inner => {
                let mucosa = mix(linear([196, 92, 80]), linear([214, 122, 104]), place.haustrum.bulge);
                let folded = mix(mucosa, linear([228, 150, 130]), 0.55 * self.crease(&place) * section.depth);
                mix(folded, linear([176, 66, 60]), 0.3 * (mottle + 0.3))
            }
        }
    }

    fn crease(&self, place: &Place) -> f32 {
        let across = place.haustrum.to_fold / (1.4 * FOLD_WIDTH * self.unit);
        ops::exp(-across * across) * place.belly
    }

    fn place(&self, section: &Section, angle: f32) -> Place {
        let turn = angle.rem_euclid(TAU) / (TAU / ROWS as f32);
        let row = (turn as usize).min(ROWS - 1);
        let across = turn - row as f32;
        let to_taenia = across.min(1.0 - across) * (TAU / ROWS as f32) * section.mean.max(section.thickness);
        let sine = ops::sin(PI * across);
        Place {
            belly: smooth_step(0.75 * self.taenia_half_width, 1.9 * self.taenia_half_width, to_taenia),
            roundness: 0.55 + 0.45 * sine,
            crescent: smooth_step(0.0, 0.75, sine),
            haustrum: section.haustra[row],
        }
    }

    fn noise_point(&self, section: &Section, angle: f32, size: f32) -> Vec3 {
        (section.frame.centre + section.frame.direction(angle) * section.mean) / (size * self.unit)
    }
}

/// A place on a ring.
struct Place {
    /// 0 on a taenia, 1 between two.
    belly: f32,
    /// How round the haustrum is across: 1 in its middle.
    roundness: f32,
    /// Height of the fold across: from 0 at a taenia to 1, so that it has the shape of a half moon.
    crescent: f32,
    haustrum: Haustrum,
}

/// Radius of a half ellipsoid's section, relative to its full radius, at a distance from its pole.
fn cap(distance: f32, length: f32) -> f32 {
    let from_equator = 1.0 - (distance / length).clamp(0.0, 1.0);
    (1.0 - from_equator * from_equator).max(0.0).sqrt()
}

/// Smooth maximum of two numbers, blended if they are within `blend` of each other.
fn smooth_max(a: f32, b: f32, blend: f32) -> f32 {
    let near = (blend - (a - b).abs()).max(0.0) / blend.max(f32::MIN_POSITIVE);
    a.max(b) + 0.25 * near * near * blend
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;

    #[test]
    fn the_wall_has_a_thickness_everywhere_and_stays_within_its_clearance() {
        for seed in 0..6 {
            let settings = ColonSettings { seed, ..Default::default() };
            let wall = Wall::new(&settings, &mut Stream::Organ.rng(seed));
            let start = wall.start(Side::Inner);
            for place in 1..400 {
                let arc = start + (wall.end - start) * place as f32 / 400.0;
                let [outer, inner] = [Side::Outer, Side::Inner].map(|side| wall.section(side, arc));
                for angle in (0..60).map(|step| TAU * step as f32 / 60.0) {
                    let outside = wall.radius(Side::Outer, &outer, angle);
                    let inside = wall.radius(Side::Inner, &inner, angle);
                    assert!(outside - inside > 0.4 * settings.wall_thickness, "seed {seed}, arc {arc}, angle {angle}");
                    assert!(outside < CLEARANCE * outer.mean, "seed {seed}: {} at arc {arc}", outside / outer.mean);
                    assert!(inside >= 0.0);
                }
            }
        }
    }
}
