//! Makes room around a vessel that is in the way of all those below it.
//!
//! A trunk becomes wider with each terminal below it. Once it touches a neighbour or the border, none of its subtree
//! can grow on. Then its ends move a little to where there is room, and where that costs least volume; or those of the
//! neighbour do.

use super::{forest::NONE, space::Space};
use bevy_math::DVec3;

/// How far a bifurcation moves, in radii of the vessel, tried in turn.
const WAYS: [f64; 5] = [0.2, 0.5, 1.0, 2.0, 4.0];
/// Room for growth that the vessel must have afterwards, as factors of its radius, tried in turn.
const ROOMS: [f64; 2] = [1.1, 1.02];

impl Space {
    /// Moves an end of a segment, or of its neighbour, so that it gets room to grow. Returns whether that was possible.
    pub(super) fn relieve(&mut self, [segment, neighbour]: [u32; 2]) -> bool {
        let is_there = |node: &u32| (*node as usize) < self.forest.nodes.len();
        if !is_there(&segment) {
            return false;
        }
        let mut ends: Vec<u32> = Vec::with_capacity(4);
        for node in [segment, neighbour].into_iter().filter(is_there) {
            ends.extend([node, self.forest.node(node).parent].into_iter().filter(|end| *end != NONE));
        }
        ends.dedup();
        let step = self.radius(segment);
        let tries = ROOMS.into_iter().flat_map(|room| WAYS.map(|way| (room, way * step)));
        let mut tries = tries.flat_map(|(room, way)| ends.iter().map(move |&end| (room, way, end)));
        tries.any(|(room, way, end)| self.evade(end, way, room))
    }

    /// Moves a bifurcation by this way, in the direction of least volume of those in which there is room.
    fn evade(&mut self, node: u32, way: f64, room: f64) -> bool {
        let own = *self.forest.node(node);
        if own.parent == NONE || own.children[1] == NONE || node < self.given {
            return false;
        }
        let (reserve, mut best) = (std::mem::replace(&mut self.reserve, room), None);
        for place in self.directions().map(|direction| (own.at.as_dvec3() + direction * way).as_vec3().as_dvec3()) {
            if self.try_shift(node, place) {
                let volume = self.forest.node(self.root_segment(own.tree)).volume;
                if best.is_none_or(|(least, _)| volume < least) {
                    best = Some((volume, place));
                }
                self.undo();
            }
        }
        let moves = best.is_some_and(|(_, place)| self.try_shift(node, place));
        self.reserve = reserve;
        moves
    }

    /// Directions that differ by 45° or less from any direction in the domain.
    fn directions(&self) -> impl Iterator<Item = DVec3> + use<> {
        let (axes, layers) = (self.domain.axes, if self.domain.dimension == 2 { 0..=0 } else { -1..=1 });
        layers
            .flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| [x, y, z].map(f64::from))))
            .filter(|&[x, y, z]| x != 0.0 || y != 0.0 || z != 0.0)
            .map(move |[x, y, z]| (axes[0] * x + axes[1] * y + axes[2] * z).normalize())
    }
}
