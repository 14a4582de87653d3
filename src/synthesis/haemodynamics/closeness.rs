//! How closely links tie two trees: what share of a change of pressure comes back from the other side.
//!
//! In: the traced sides of a circulation. Out: a bound for conjugate gradients, before any is made. A change of the
//! arterial pressures at the links spreads to the veins and comes back as P = Tₐ⁻¹·E·Tᵥ⁻¹·Eᵀ of it (`gradients.rs`).
//! P has no negative elements, so that its largest eigenvalue lies below the largest ratio of an element of P·x to that
//! of x, for any positive x (Collatz 1942, Wielandt 1950). With x = P·x the bound gets closer each time.

use super::{gradients::Gradients, open_ends::OpenEnds};
use crate::synthesis::mesh::disjoint_sets::DisjointSets;

/// Times that the bound is improved before the trees count as tied too closely.
const MOST_PASSES: usize = 16;

impl Gradients<'_> {
    /// The least share of a change of pressure that doesn't come back, with all ends closed: at least this, or less than
    /// `enough`. What open ends let out comes back even less.
    pub fn loose_share(&mut self, enough: f64) -> f64 {
        let is_held = self.held();
        let Self { networks: [arterial, venous], sides: [arteries, veins], conductance } = self;
        arteries.eliminate(arterial, &OpenEnds::default());
        veins.eliminate(venous, &OpenEnds::default());
        // A piece that only links connect has no flow to be found.
        let mut change: Vec<f64> = arteries.linked().map(|(_, joint)| f64::from(is_held[joint as usize])).collect();
        let (mut into_arteries, mut into_veins) = (vec![0.0; arteries.slots.len()], vec![0.0; veins.slots.len()]);
        let (mut answer, mut back) = (into_veins.clone(), into_arteries.clone());
        let mut share = 0.0;
        for _ in 0..MOST_PASSES {
            veins.carry(arteries, *conductance, &change, &mut into_veins);
            veins.respond(&into_veins, &mut answer);
            arteries.carry(veins, *conductance, &answer, &mut into_arteries);
            arteries.excuse_roots(arterial, &mut into_arteries);
            arteries.respond(&into_arteries, &mut back);
            let ratios =
                back.iter().zip(&change).filter(|(_, change)| **change > 0.0).map(|(back, change)| back / change);
            share = 1.0 - ratios.fold(0.0, f64::max);
            if share >= enough {
                break;
            }
            std::mem::swap(&mut change, &mut back);
        }
        share
    }

    /// Whether the arterial joints are connected with a root or with the pool, through links or not.
    fn held(&self) -> Vec<bool> {
        let [of_arteries, of_veins] = [0, 1].map(|side| self.sides[side].joints().len() as u32);
        let anywhere = of_arteries + of_veins;
        let mut sets = DisjointSets::new(anywhere as usize + 1);
        for (side, first) in self.sides.iter().zip([0, of_arteries]) {
            let mut is_linked = vec![false; side.joints().len()];
            side.linked().for_each(|(_, joint)| is_linked[joint as usize] = true);
            for (at, joint) in side.joints().iter().enumerate() {
                let here = first + at as u32;
                let bed = if is_linked[at] { joint.subtrees.y } else { joint.hanging.y };
                if joint.is_root || bed > 0.0 {
                    sets.unite(here, anywhere);
                }
                if let Some(above) = joint.above() {
                    sets.unite(here, first + above);
                    if joint.run.upper.y > 0.0 || joint.run.lower.y > 0.0 {
                        sets.unite(here, anywhere);
                    }
                }
            }
        }
        let [arteries, veins] = &*self.sides;
        for (a, v) in arteries.linked_joints().zip(veins.linked_joints()) {
            sets.unite(a, of_arteries + v);
        }
        let held = sets.first(anywhere);
        (0..of_arteries).map(|joint| sets.first(joint) == held).collect()
    }
}
