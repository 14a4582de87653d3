//! A network of any form, solved by eliminating its nodes one by one.
//!
//! In: conductances between nodes, some of which are held at given pressures. Out: the pressures of the others, for any
//! pressures of the held nodes and any currents into the others.
//!
//! A node that is eliminated leaves its neighbours joined to each other: with G the sum of its conductances, neighbours
//! to which it had a and b get a·b/G more between them (the star–mesh transform; Rosen 1924). Its own pressure is later
//! the mean of theirs, weighted by the conductances. All operations add, multiply and divide positive numbers: nothing
//! cancels, so pressures are right to rounding for any range of conductances, and no iteration could fail. The cost
//! lies in the new joints. They are few while the node with the fewest neighbours is always the next (minimum degree).

use crate::synthesis::pace::{Pace, Stretch};
use std::{cmp::Reverse, collections::BinaryHeap, mem};

/// Least sum of conductances that joins a node to anything.
const LEAST: f64 = 1e-290;

/// A neighbour and the conductance to it, or the share of its pressure.
type Arm = (u32, f64);

/// A node after its elimination.
#[derive(Clone, Copy, Debug)]
struct Eliminated {
    node: u32,
    /// Where its arms end in the list of all. They begin where those of the node before end.
    arms_end: usize,
    /// Pressure per current into the node, with its neighbours at pressure 0.
    resistance: f64,
}

/// A network of free nodes, which come first, and held ones.
#[derive(Clone, Debug, Default)]
pub(super) struct StarMesh {
    free: usize,
    /// The arms of the free nodes that are left, in rising order of their other ends.
    stars: Vec<Vec<Arm>>,
    order: Vec<Eliminated>,
    /// The arms of eliminated nodes, as shares that add up to 1.
    arms: Vec<Arm>,
    /// Pressures of all nodes as of the last solution.
    values: Vec<f64>,
}

impl StarMesh {
    /// Begins a network without conductances.
    pub fn begin(&mut self, free: usize, held: usize) {
        self.free = free;
        self.stars.iter_mut().for_each(Vec::clear);
        self.stars.resize(free, Vec::new());
        self.values.clear();
        self.values.resize(free + held, 0.0);
    }

    /// Adds a conductance between two nodes. Nothing flows through one between held nodes, or from a node to itself.
    pub fn join(&mut self, a: u32, b: u32, conductance: f64) {
        if a == b || !(conductance > 0.0) {
            return;
        }
        for (from, to) in [(a, b), (b, a)] {
            if (from as usize) < self.free {
                self.stars[from as usize].push((to, conductance));
            }
        }
    }

    /// Eliminates all free nodes.
    pub async fn eliminate(&mut self, pace: &Pace) {
        self.order.clear();
        self.arms.clear();
        self.stars.iter_mut().for_each(add_up);
        let mut queue: BinaryHeap<_> = (0..self.free as u32).map(|node| Reverse((self.degree(node), node))).collect();
        let (mut is_left, mut stretch, mut merged) = (vec![true; self.free], Stretch::default(), Vec::new());
        while let Some(Reverse((degree, node))) = queue.pop() {
            if !is_left[node as usize] || degree != self.degree(node) {
                continue;
            }
            is_left[node as usize] = false;
            let mut star = mem::take(&mut self.stars[node as usize]);
            let total: f64 = star.iter().map(|arm| arm.1).sum();
            // A piece that nothing holds keeps the pressure 0.
            let resistance = if total > LEAST { 1.0 / total } else { 0.0 };
            let mut work = 0;
            for &(neighbour, conductance) in star.iter().filter(|arm| (arm.0 as usize) < self.free) {
                let own = &mut self.stars[neighbour as usize];
                merge(own, &star, [node, neighbour], conductance * resistance, &mut merged);
                mem::swap(own, &mut merged);
                work += own.len();
                queue.push(Reverse((own.len(), neighbour)));
            }
            star.iter_mut().for_each(|arm| arm.1 *= resistance);
            self.arms.append(&mut star);
            self.order.push(Eliminated { node, arms_end: self.arms.len(), resistance });
            self.stars[node as usize] = star;
            if stretch.ends_after(1 + work) {
                pace.rest(self.order.len() as f32 / self.free as f32).await;
            }
        }
    }

    fn degree(&self, node: u32) -> usize {
        self.stars[node as usize].len()
    }

    /// Begins a solution, with held nodes at these pressures.
    pub fn hold(&mut self, pressures: &[f64]) {
        self.values[..self.free].fill(0.0);
        self.values[self.free..].copy_from_slice(pressures);
    }

    /// Adds a current into a free node.
    pub fn give(&mut self, node: u32, current: f64) {
        self.values[node as usize] += current;
    }

    /// Finds the pressures of all nodes.
    pub fn solve(&mut self) {
        let mut begin = 0;
        for &Eliminated { node, arms_end, .. } in &self.order {
            let current = self.values[node as usize];
            if current != 0.0 {
                for &(neighbour, share) in &self.arms[begin..arms_end] {
                    if (neighbour as usize) < self.free {
                        self.values[neighbour as usize] += share * current;
                    }
                }
            }
            begin = arms_end;
        }
        for (at, &Eliminated { node, arms_end, resistance }) in self.order.iter().enumerate().rev() {
            let begin = at.checked_sub(1).map_or(0, |before| self.order[before].arms_end);
            let shares = self.arms[begin..arms_end].iter();
            let from_others: f64 = shares.map(|&(neighbour, share)| share * self.values[neighbour as usize]).sum();
            self.values[node as usize] = from_others + resistance * self.values[node as usize];
        }
    }

    /// Pressure of a node.
    pub fn pressure(&self, node: u32) -> f64 {
        self.values[node as usize]
    }
}

/// Sorts a star, and makes one of arms to the same node.
fn add_up(star: &mut Vec<Arm>) {
    star.sort_by_key(|arm| arm.0);
    star.dedup_by(|next, kept| {
        let is_same = next.0 == kept.0;
        if is_same {
            kept.1 += next.1;
        }
        is_same
    });
}

/// A neighbour's star with those of its arms that an eliminated node leaves: `share` of each of that node's. Arms to one
/// of the two themselves are gone.
fn merge(own: &[Arm], other: &[Arm], pair: [u32; 2], share: f64, merged: &mut Vec<Arm>) {
    merged.clear();
    let is_other = |arm: &&Arm| !pair.contains(&arm.0);
    let (mut own, mut other) = (own.iter().filter(is_other).peekable(), other.iter().filter(is_other).peekable());
    loop {
        merged.push(match (own.peek(), other.peek()) {
            (Some(&&(a, conductance)), Some(&&(b, there))) if a == b => {
                (own.next(), other.next());
                (a, conductance + share * there)
            }
            (Some(&&(a, conductance)), Some(&&(b, _))) if a < b => {
                own.next();
                (a, conductance)
            }
            (Some(&&arm), None) => {
                own.next();
                arm
            }
            (_, Some(&&(b, there))) => {
                other.next();
                (b, share * there)
            }
            (None, None) => return,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::pace::at_once;
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Any network of so many nodes, held at two more.
    fn joints(rng: &mut ChaCha8Rng, free: u32, decades: f64) -> Vec<(u32, u32, f64)> {
        let mut joints = vec![(0, free, 1.0), (free - 1, free + 1, 1.0)];
        joints.extend((1..free).map(|node| (node, rng.random_range(0..node), 1.0)));
        joints.extend((0..free).map(|_| (rng.random_range(0..free), rng.random_range(0..free), 1.0)));
        joints.iter_mut().for_each(|joint| joint.2 = 10.0_f64.powf(rng.random_range(-decades..=decades)));
        joints
    }

    fn eliminated(joints: &[(u32, u32, f64)], free: u32) -> StarMesh {
        let mut mesh = StarMesh::default();
        mesh.begin(free as usize, 2);
        joints.iter().for_each(|&(a, b, conductance)| mesh.join(a, b, conductance));
        at_once(mesh.eliminate(&Pace::default()));
        mesh
    }

    #[test]
    fn pressures_are_those_of_a_dense_solver() {
        for seed in 0..50 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let free = rng.random_range(2..60);
            let joints = joints(&mut rng, free, 1.0);
            let (mut mesh, held) = (eliminated(&joints, free), [3.0, -2.0]);
            mesh.hold(&held);
            let (mut matrix, mut currents) =
                (DMatrix::zeros(free as usize, free as usize), DVector::zeros(free as usize));
            for &(a, b, conductance) in joints.iter().filter(|joint| joint.0 != joint.1) {
                for (from, to) in [(a as usize, b as usize), (b as usize, a as usize)] {
                    if from < free as usize {
                        matrix[(from, from)] += conductance;
                        match to.checked_sub(free as usize) {
                            Some(at) => currents[from] += conductance * held[at],
                            None => matrix[(from, to)] -= conductance,
                        }
                    }
                }
            }
            for node in 0..free {
                let current = rng.random_range(-1.0..1.0);
                currents[node as usize] += current;
                mesh.give(node, current);
            }
            mesh.solve();
            let expected: DVector<f64> = matrix.lu().solve(&currents).expect("a network that is held");
            for node in 0..free {
                let (found, expected) = (mesh.pressure(node), expected[node as usize]);
                assert!((found - expected).abs() < 1e-9, "seed {seed}, node {node}: {found}, not {expected}");
            }
        }
    }

    /// Without currents a pressure is a mean of the held ones, so it can't leave their range, and with both at the same
    /// pressure it is that.
    #[test]
    fn conductances_of_any_range_leave_pressures_exact() {
        for seed in 0..200 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let free = rng.random_range(2..80);
            let joints = joints(&mut rng, free, 90.0);
            let mut mesh = eliminated(&joints, free);
            for held in [[7.0, 7.0], [1.0, 0.0]] {
                mesh.hold(&held);
                mesh.solve();
                for node in 0..free {
                    let pressure = mesh.pressure(node);
                    let range = held[1] * (1.0 - 1e-12)..=held[0] * (1.0 + 1e-12);
                    assert!(range.contains(&pressure), "seed {seed}, node {node}: {pressure}");
                }
            }
        }
    }

    #[test]
    fn a_node_joined_to_nothing_has_no_pressure() {
        let mut mesh = eliminated(&[(0, 3, 1.0), (1, 2, 5.0)], 3);
        mesh.hold(&[7.0, 7.0]);
        mesh.solve();
        assert_eq!([0, 1, 2].map(|node| mesh.pressure(node)), [7.0, 0.0, 0.0]);
    }
}
