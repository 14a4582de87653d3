//! Both trees of a circulation and the links between them, solved as one network.

use super::{
    Network,
    side::{Side, leak},
    star_mesh::StarMesh,
};
use crate::synthesis::pace::Pace;

/// Places with a given pressure: the outside of both trees, the bed's pool, the roots of both.
const HELD: u32 = 5;
const OUTSIDES: u32 = 0;
const POOL: u32 = 2;
const SOURCES: u32 = 3;
/// What is enough of the leak for nothing but pieces that only links connect.
const FAINT: f64 = 1e-20;

/// The joints of both sides, those of the arteries first, then the held places.
#[derive(Clone, Debug, Default)]
pub(super) struct Whole {
    mesh: StarMesh,
    /// Conductance of every joint of a side to the pool.
    to_pool: Vec<f64>,
}

impl Whole {
    /// Finds the pressures of all joints, with linearised ends. Each link has this conductance.
    pub async fn balance(&mut self, networks: [&Network; 2], sides: &mut [Side; 2], conductance: f64, pace: &Pace) {
        let [arteries, veins] = &*sides;
        let places = Places { of_arteries: arteries.joints().len() as u32, of_veins: veins.joints().len() as u32 };
        self.mesh.begin(places.free() as usize, HELD as usize);
        for (number, (network, side)) in networks.into_iter().zip(&*sides).enumerate() {
            self.add(network, side, places, number as u32);
        }
        for (a, v) in arteries.linked_joints().zip(veins.linked_joints()) {
            self.mesh.join(places.of(arteries, 0, a), places.of(veins, 1, v), conductance);
        }
        self.mesh.eliminate(pace).await;
        // Relative to what is outside of the arteries, so that rounding doesn't lose the pressure before a wide hole.
        let outside = networks[0].ambient();
        let [a, v] = networks.map(|network| network.source - outside);
        self.mesh.hold(&[0.0, networks[1].ambient() - outside, -outside, a, v]);
        for (number, (network, side)) in networks.into_iter().zip(&*sides).enumerate() {
            for end in network.ends.all() {
                let place = places.of(side, number as u32, side.joint_at(end.attached));
                if place < places.free() {
                    self.mesh.give(place, end.stump.s);
                }
            }
        }
        self.mesh.solve();
        for (number, (network, side)) in networks.into_iter().zip(sides).enumerate() {
            let joints = 0..side.joints().len() as u32;
            let pressures: Vec<f64> =
                joints.map(|joint| self.mesh.pressure(places.of(side, number as u32, joint))).collect();
            side.take(pressures.into_iter(), outside, network.ambient());
        }
    }

    /// Adds one side, without its links.
    fn add(&mut self, network: &Network, side: &Side, places: Places, number: u32) {
        let (joints, pool) = (side.joints(), places.held(POOL));
        self.to_pool.clear();
        self.to_pool.extend(joints.iter().map(|joint| joint.hanging.y));
        for (slot, joint) in side.linked() {
            self.to_pool[joint as usize] = joints[joint as usize].subtrees.y + FAINT * leak(network, slot);
        }
        for (at, joint) in joints.iter().enumerate() {
            let here = places.of(side, number, at as u32);
            self.mesh.join(here, pool, self.to_pool[at]);
            if let Some(above) = joint.above() {
                let there = places.of(side, number, above);
                self.mesh.join(here, there, joint.run.through);
                self.mesh.join(here, pool, joint.run.lower.y);
                self.mesh.join(there, pool, joint.run.upper.y);
            }
        }
        for end in network.ends.all() {
            let here = places.of(side, number, side.joint_at(end.attached));
            self.mesh.join(here, places.held(OUTSIDES + number), end.stump.y);
        }
    }
}

/// Where joints are among the nodes of the whole.
#[derive(Clone, Copy)]
struct Places {
    of_arteries: u32,
    of_veins: u32,
}

impl Places {
    fn free(self) -> u32 {
        self.of_arteries + self.of_veins
    }

    fn held(self, place: u32) -> u32 {
        self.free() + place
    }

    /// The place of a joint of the arteries, number 0, or of the veins. All roots of a side are one.
    fn of(self, side: &Side, number: u32, joint: u32) -> u32 {
        match side.joints()[joint as usize].is_root {
            true => self.held(SOURCES + number),
            false => joint + number * self.of_arteries,
        }
    }
}
