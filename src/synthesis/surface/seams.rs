//! Seams: two tubes that end in each other, the halves of a vessel that closes a loop.
//!
//! In: the last rings of both tubes. Out: a belt of faces between them.

use super::cage::{Cage, uv_of};
use super::caps::{self, End};
use super::rings::Ring;
use super::settings::TipCap;
use bevy_math::{Vec2, Vec3};

/// The end of a tube that has no faces yet.
#[derive(Clone, Debug)]
pub(super) struct OpenEnd {
    pub ring: Ring,
    /// Middle of the ring before it.
    pub before: Vec3,
    /// First vertex of the ring.
    pub base: u32,
    pub end: End,
    pub node: u32,
}

/// What is known of a seam while its tubes are made one by one.
#[derive(Clone, Debug, Default)]
pub(super) enum Seam {
    /// No tube has come to it.
    #[default]
    Ahead,
    /// One tube ends here.
    Open(OpenEnd),
    /// It is joined, or one of both tubes has no end of its own.
    Done,
}

impl OpenEnd {
    /// Closes the tube.
    pub fn cap(&self, cage: &mut Cage, tips: TipCap) {
        caps::add(cage, &self.ring, self.base, self.end, tips, self.node);
    }

    /// The place of one of its vertices from its middle.
    pub fn spoke(&self, cage: &Cage) -> Vec3 {
        cage.vertices.positions[self.base as usize] - self.ring.station.center
    }

    /// The line of the ring at a step anticlockwise around the end, seen from outside, from 0 to as many as its sides.
    fn line(&self, step: u32) -> u32 {
        match self.end {
            End::Tip => step,
            End::Base => self.ring.sides - step,
        }
    }

    /// Moves the ring so that the surface follows the bend, now that its neighbours are known.
    fn swell(&self, cage: &mut Cage, after: Vec3) {
        let aside = self.ring.station.cut_between(self.before, after);
        let vertices = self.base as usize..(self.base + self.ring.sides) as usize;
        cage.vertices.positions[vertices].iter_mut().for_each(|position| *position += aside);
    }

    fn vertex(&self, step: u32) -> u32 {
        self.base + self.line(step % self.ring.sides) % self.ring.sides
    }

    /// Texture coordinates at a step, so far beyond the end.
    fn uv(&self, step: u32, beyond: f32) -> Vec2 {
        let sign = if self.end == End::Tip { 1.0 } else { -1.0 };
        uv_of(&self.ring.station, self.ring.length + sign * beyond, self.line(step), self.ring.sides)
    }
}

/// Joins two ends by a belt of faces. Says whether it could: their sides must be as many, or twice as many.
pub(super) fn join(cage: &mut Cage, first: &OpenEnd, second: &OpenEnd) -> bool {
    let (few, many) = if first.ring.sides <= second.ring.sides { (first, second) } else { (second, first) };
    let (sides, ratio) = (few.ring.sides, many.ring.sides / few.ring.sides);
    if ratio > 2 {
        return false;
    }
    few.swell(cage, many.ring.station.center);
    many.swell(cage, few.ring.station.center);
    let position = |vertex: u32| cage.vertices.positions[vertex as usize];
    // Seen from one end, the other one's steps run backwards.
    let facing =
        |turn: u32, step: u32| many.vertex((turn + many.ring.sides - step % many.ring.sides) % many.ring.sides);
    let distance = |turn: u32| -> f32 {
        let apart = |step: u32| position(few.vertex(step)).distance_squared(position(facing(turn, ratio * step)));
        (0..sides).map(apart).sum()
    };
    let nearest = (0..many.ring.sides).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    let turn = nearest.unwrap_or(0);
    let gap = few.ring.station.center.distance(many.ring.station.center);
    for step in 0..sides {
        let [a, b] = [step, step + 1];
        let [near, far] = [[few.uv(a, 0.0), few.uv(b, 0.0)], [few.uv(a, gap), few.uv(b, gap)]];
        let ends = [few.vertex(a), few.vertex(b), facing(turn, ratio * b), facing(turn, ratio * a)];
        if ratio == 1 {
            cage.face(ends, [near[0], near[1], far[1], far[0]]);
        } else {
            let middle = facing(turn, 2 * a + 1);
            let uvs = [near[0], near[1], far[1], 0.5 * (far[0] + far[1]), far[0]];
            cage.face([ends[0], ends[1], ends[2], middle, ends[3]], uvs);
        }
    }
    true
}
