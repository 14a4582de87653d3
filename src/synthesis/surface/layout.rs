//! Where the faces of a cage come from: which trunk, and which length along it.
//!
//! A trunk's faces follow each other: its belts from base to tip, then its base's end, then its tip's. So the first
//! corner of each says whose a corner is.

/// A lateral's mouth: the rings of a row on another trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mouth {
    /// The trunk that it leaves.
    pub trunk: u32,
    /// First and last ring of the row, counted on that trunk.
    pub rings: [u32; 2],
}

/// A stretch of a trunk, in lengths along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    pub trunk: u32,
    pub from: f32,
    pub to: f32,
}

/// What a trunk has in a cage.
#[derive(Clone, Copy, Debug)]
struct Part {
    first_ring: u32,
    first_corner: u32,
    /// First corner of the faces at its tip, and the corner after the last.
    tip_corner: u32,
    end_corner: u32,
    mouth: Option<Mouth>,
}

/// Origins of all faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    parts: Vec<Part>,
    /// Length along its trunk of each ring, and first corner of the belt that begins there; of a trunk's last ring, that
    /// of the faces at its base.
    lengths: Vec<f32>,
    corners: Vec<u32>,
    /// Stretches in which faces may meet others.
    pub doubts: Vec<Stretch>,
}

impl Layout {
    /// Begins a trunk; a lateral that has no faces gets nothing more.
    pub fn begin(&mut self, mouth: Option<Mouth>, corner: usize) {
        let corner = corner as u32;
        let first_ring = self.lengths.len() as u32;
        self.parts.push(Part { first_ring, first_corner: corner, tip_corner: corner, end_corner: corner, mouth });
    }

    /// Adds a ring, given the first corner of what follows: the belt that begins there, or the faces at the base after
    /// the last ring.
    pub fn push_ring(&mut self, length: f32, corner: usize) {
        self.lengths.push(length);
        self.corners.push(corner as u32);
    }

    /// Ends a trunk, given the first corner of the faces at its tip, and the one after all.
    pub fn end(&mut self, [tip, end]: [usize; 2]) {
        if let Some(part) = self.parts.last_mut() {
            (part.tip_corner, part.end_corner) = (tip as u32, end as u32);
        }
    }

    /// Notes a stretch of a trunk in which faces may meet others.
    pub fn doubt(&mut self, trunk: usize, from: f32, to: f32) {
        self.doubts.push(Stretch { trunk: trunk as u32, from, to });
    }

    /// Lengths of a trunk's rings along it.
    pub fn lengths(&self, trunk: u32) -> &[f32] {
        &self.lengths[self.rings(trunk)]
    }

    /// The mouth in which a trunk begins.
    pub fn mouth(&self, trunk: u32) -> Option<Mouth> {
        self.parts[trunk as usize].mouth
    }

    /// Number of trunks.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// The corners of the belts between two rings of a trunk, with those of its ends if the rings are its first or last.
    pub fn corners_between(&self, trunk: u32, [low, high]: [u32; 2]) -> impl Iterator<Item = std::ops::Range<u32>> {
        let part = self.parts[trunk as usize];
        let corners = &self.corners[self.rings(trunk)];
        let last = corners.len() - 1;
        let belts = corners[low as usize]..corners[high as usize];
        let base = (low == 0).then_some(corners[last]..part.tip_corner);
        let tip = (high as usize == last).then_some(part.tip_corner..part.end_corner);
        std::iter::once(belts).chain(base).chain(tip)
    }

    /// The trunk of a corner, and the rings between which it lies; the same ring twice for an end.
    pub fn place_of(&self, corner: u32) -> (u32, [u32; 2]) {
        // A trunk without faces begins where the next one does.
        let trunk = self.parts.partition_point(|part| part.first_corner <= corner) - 1;
        let part = self.parts[trunk];
        let corners = &self.corners[self.rings(trunk as u32)];
        let last = (corners.len() - 1) as u32;
        let ends = if corner >= part.tip_corner {
            [last, last]
        } else {
            // After the last ring's corner come the faces at the base.
            match corners.partition_point(|&first| first <= corner) as u32 {
                after if after > last => [0, 0],
                after => [after - 1, after],
            }
        };
        (trunk as u32, ends)
    }

    fn rings(&self, trunk: u32) -> std::ops::Range<usize> {
        let first = self.parts[trunk as usize].first_ring as usize;
        let end = self.parts.get(trunk as usize + 1).map_or(self.lengths.len(), |part| part.first_ring as usize);
        first..end
    }
}
