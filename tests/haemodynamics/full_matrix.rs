//! Two trees and all that joins them as one full matrix, eliminated node by node.
//!
//! Only positive numbers are added, multiplied and divided (Grassmann, Taksar & Heyman 1985), so that this is exact for
//! resistances of any ratio, where LU decomposition isn't.

/// A node of a side, 0 or 1, or a place with a given pressure, as [`POOL`] and [`OUTSIDE`].
pub type Node = (usize, usize);

/// Sides of places that are no nodes.
const HELD: usize = 2;
pub const OUTSIDE: Node = (HELD, 0);
pub const POOL: Node = (HELD, 1);

#[derive(Clone)]
pub struct FullMatrix {
    /// The row of every node of each side, and of the held places.
    pub place: [Vec<usize>; 3],
    conductances: Vec<Vec<f64>>,
    free: usize,
}

impl FullMatrix {
    pub fn new([of_arteries, of_veins]: [usize; 2]) -> Self {
        let free = of_arteries + of_veins;
        let place = [(0..of_arteries).collect(), (of_arteries..free).collect(), (free..free + 4).collect()];
        Self { place, conductances: vec![vec![0.0; free + 4]; free + 4], free }
    }

    /// The row of the roots of a side.
    pub fn source(&self, side: usize) -> usize {
        self.free + 2 + side
    }

    pub fn join(&mut self, a: Node, b: Node, conductance: f64) {
        let [a, b] = [a, b].map(|(side, node)| self.place[side][node]);
        if a != b {
            self.conductances[a][b] += conductance;
            self.conductances[b][a] += conductance;
        }
    }

    /// Pressures of the nodes of both sides; NaN where nothing holds them. Given are those outside, of the pool, and of
    /// the roots of both sides.
    pub fn pressures(mut self, held: [f64; 4]) -> [Vec<f64>; 2] {
        let mut stars = Vec::new();
        for node in (0..self.free).rev() {
            let row = std::mem::take(&mut self.conductances[node]);
            let others = (0..node).chain(self.free..row.len());
            let star: Vec<(usize, f64)> =
                others.filter(|&other| row[other] > 0.0).map(|other| (other, row[other])).collect();
            let total: f64 = star.iter().map(|arm| arm.1).sum();
            for &(a, first) in &star {
                for &(b, second) in star.iter().filter(|arm| arm.0 != a) {
                    self.conductances[a][b] += first / total * second;
                }
            }
            stars.push((star, total));
        }
        let mut pressures = [vec![f64::NAN; self.free], held.to_vec()].concat();
        for (node, (star, total)) in stars.into_iter().rev().enumerate() {
            if total > 0.0 {
                pressures[node] = star.iter().map(|&(other, conductance)| conductance / total * pressures[other]).sum();
            }
        }
        let [arteries, veins, _] = self.place;
        [arteries, veins].map(|places| places.iter().map(|&place| pressures[place]).collect())
    }
}
