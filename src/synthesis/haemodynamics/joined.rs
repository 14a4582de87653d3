//! Arteries and veins joined through the capillary bed.
//!
//! In: the networks of two trees, and the links between their nodes: each a stretch of bed with the bed's resistance.
//! Out: both networks solved, so that the flow from an artery into a link arrives in the vein. Terminals without a link
//! drain into the bed's pool, as in a single network.
//!
//! The links make loops, so no pair of sweeps solves both trees at once, but each alone is solved exactly. With T the
//! matrix of a tree whose links end in a given pressure, and E that of the links between them, the arterial pressures
//! satisfy (Tₐ − E·Tᵥ⁻¹·Eᵀ)·p = b. The matrix is symmetric and positive, and conjugate gradients preconditioned by Tₐ⁻¹
//! need one pair of sweeps of each tree in a pass: not of all its nodes, but only of those with links and open ends and
//! of the forks between them, since all others have been eliminated once. The error falls by the factor (1 − √(1 −
//! c))/(1 + √(1 − c)) or better, where c < 1 is the largest share of a change of pressure that comes back through the
//! links from the other side. A bed with high resistance takes few passes, one with low resistance many. With two trees
//! of 100,000 segments and 3,000 links, it takes 12 passes if about half of the pressure drops in the bed, 34 for a
//! sixth of it, 81 for a thirtieth. Reaching the limit of passes is an error. Starting from the last solution, it takes
//! no pass if nothing has changed. A piece that only links connect could have any pressure; a leak of 10⁻¹¹ of each
//! link into the pool gives it the pool's. Newton's method around this solves for open ends, as in a single tree.

use super::{
    FlowError, Network,
    open_ends::OpenEnds,
    side::{LEAST_PRESSURE, Side},
};
use crate::synthesis::{
    pace::{Pace, at_once},
    tree::BedLink,
    units::Resistance,
};

/// Arteries and veins of an organ, joined through the bed.
#[derive(Clone, Debug)]
pub struct Circulation {
    arterial: Network,
    venous: Network,
    links: usize,
    conductance: f64,
    passes: usize,
    sides: [Side; 2],
}

impl Circulation {
    /// Passes of the conjugate gradients after which they count as failed; ten to eighty are usual. Without rounding they
    /// need no more passes than there are linked nodes, and so many are needed if the bed resists far less than vessels.
    const MOST_PASSES: usize = 500;
    /// Passes more, for each linked node.
    const MOST_PASSES_PER_NODE: usize = 4;
    /// Imbalance of a linked node, relative to the largest flow in a link, and correction of its pressure, relative to
    /// the largest, at which the conjugate gradients end.
    const ACCURACY: f64 = 1e-12;
    /// The same in the first round for the open ends, whose flow is still a guess.
    const FIRST_ACCURACY: f64 = 1e-4;
    /// Rounding of a pressure, relative to the largest.
    const ROUNDING: f64 = 1e-14;
    /// Passes of Newton's method for the open ends after which it counts as failed; some five are usual.
    const MOST_ROUNDS: usize = 60;
    /// Passes after which it is damped.
    const UNDAMPED: usize = 20;

    /// Joins two networks by links. A node may have several, and need not be a terminal.
    ///
    /// The veins' bed gets the resistance of the arteries', which is that of each link.
    ///
    /// # Errors
    /// If a node is not in its network, or the arteries' bed has no resistance.
    pub fn new(arterial: Network, venous: Network, links: &[BedLink]) -> Result<Self, FlowError> {
        at_once(Self::new_paced(arterial, venous, links, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(
        arterial: Network,
        mut venous: Network,
        links: &[BedLink],
        pace: &Pace,
    ) -> Result<Self, FlowError> {
        let resistance = arterial.settings.bed.resistance.ok_or(FlowError::BedWithoutResistance)?;
        venous.settings.bed.resistance = Some(resistance);
        venous.set_beds(&pace.part(0.0..0.3)).await;
        let conductance = 1.0 / resistance.pascal_seconds_per_cubic_metre();
        let mut circulation = Self { arterial, venous, links: 0, conductance, passes: 0, sides: Default::default() };
        circulation.set_links_paced(links, &pace.part(0.3..1.0)).await?;
        Ok(circulation)
    }

    /// Replaces the links, for example after growth: update both networks first.
    ///
    /// # Errors
    /// If a node is not in its network. The links are unchanged then.
    pub fn set_links(&mut self, links: &[BedLink]) -> Result<(), FlowError> {
        at_once(self.set_links_paced(links, &Pace::default()))
    }

    async fn set_links_paced(&mut self, links: &[BedLink], pace: &Pace) -> Result<(), FlowError> {
        for link in links {
            self.arterial.check(link.arterial)?;
            self.venous.check(link.venous)?;
        }
        self.sides =
            [Side::new(links.iter().map(|link| link.arterial)), Side::new(links.iter().map(|link| link.venous))];
        self.arterial.set_links(links.iter().map(|link| link.arterial), &pace.part(0.0..0.5)).await;
        self.venous.set_links(links.iter().map(|link| link.venous), &pace.part(0.5..1.0)).await;
        self.links = links.len();
        Ok(())
    }

    /// Resistance of each link, and of the bed behind each terminal without one.
    pub fn bed_resistance(&self) -> Resistance {
        Resistance::from_pascal_seconds_per_cubic_metre(1.0 / self.conductance)
    }

    /// Replaces it, and solves.
    pub(super) fn set_bed_resistance(&mut self, resistance: Resistance) -> Result<(), FlowError> {
        self.conductance = 1.0 / resistance.pascal_seconds_per_cubic_metre();
        for network in [&mut self.arterial, &mut self.venous] {
            network.settings.bed.resistance = Some(resistance);
            at_once(network.set_beds(&Pace::default()));
        }
        self.solve()
    }

    /// The arteries.
    pub fn arterial(&self) -> &Network {
        &self.arterial
    }

    /// The arteries, to change interruptions or pressures.
    pub fn arterial_mut(&mut self) -> &mut Network {
        &mut self.arterial
    }

    /// The veins.
    pub fn venous(&self) -> &Network {
        &self.venous
    }

    /// The veins, to change interruptions or pressures.
    pub fn venous_mut(&mut self) -> &mut Network {
        &mut self.venous
    }

    /// Number of links.
    pub fn links(&self) -> usize {
        self.links
    }

    /// Passes of the conjugate gradients in the last solution, over all rounds for the open ends.
    pub fn passes(&self) -> usize {
        self.passes
    }

    /// Returns the two networks, separated again.
    pub fn into_networks(mut self) -> [Network; 2] {
        for network in [&mut self.arterial, &mut self.venous] {
            at_once(network.set_links(std::iter::empty(), &Pace::default()));
        }
        [self.arterial, self.venous]
    }

    /// Brings pressures and flows of both networks up to date, including those at open ends.
    ///
    /// The cost is two pairs of sweeps over both trees, one more if trees, links or gaps have changed, and for each
    /// pass of the conjugate gradients a pair of sweeps over the joints of the links in each tree. With open ends there
    /// are about five times as many passes, fewer if little has changed since the last time.
    ///
    /// # Errors
    /// If one of the iterations did not converge.
    pub fn solve(&mut self) -> Result<(), FlowError> {
        at_once(self.solve_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub async fn solve_paced(&mut self, pace: &Pace) -> Result<(), FlowError> {
        self.share_bed_pressure();
        self.passes = 0;
        let has_ends = [&self.arterial, &self.venous].iter().any(|network| !network.ends.all().is_empty());
        self.sides[0].prepare(&mut self.arterial, &pace.part(0.0..0.2)).await;
        self.sides[1].prepare(&mut self.venous, &pace.part(0.2..0.4)).await;
        let (balancing, driving) = (pace.part(0.4..0.7), pace.part(0.7..1.0));
        let mut residual = f64::INFINITY;
        let mut accuracy = if has_ends { Self::FIRST_ACCURACY } else { Self::ACCURACY };
        for round in 0..Self::MOST_ROUNDS {
            for network in [&mut self.arterial, &mut self.venous] {
                network.linearise_ends();
            }
            self.balance(accuracy, &balancing).await?;
            if !has_ends {
                self.drive(&driving).await;
                return Ok(());
            }
            let damped = round >= Self::UNDAMPED;
            let [arteries, veins] = &self.sides;
            residual = self.arterial.accept_ends(&arteries.quotient, damped);
            residual = residual.max(self.venous.accept_ends(&veins.quotient, damped));
            if residual <= 1.0 && accuracy == Self::ACCURACY {
                return self.finish(&driving).await;
            }
            // Newton's method squares the error, so a round needs no more accuracy than that. Ends with very little
            // flow need more.
            let expected = residual * OpenEnds::ACCURACY;
            accuracy = (expected * expected).min(1e-3 * accuracy).clamp(Self::ACCURACY, Self::FIRST_ACCURACY);
        }
        let what = "the flow through the open ends of a circulation";
        let residual = residual * OpenEnds::ACCURACY;
        Err(FlowError::NotConverged { what, passes: Self::MOST_ROUNDS, residual })
    }

    /// Makes pressures of both relative to the same pool.
    fn share_bed_pressure(&mut self) {
        let moved = self.venous.bed - self.arterial.bed;
        self.venous.source += moved;
        self.venous.bed = self.arterial.bed;
    }

    /// Replaces the ends' tangents by their draw, and solves once more.
    async fn finish(&mut self, pace: &Pace) -> Result<(), FlowError> {
        let [arteries, veins] = &self.sides;
        self.arterial.finish_ends(&arteries.quotient);
        self.venous.finish_ends(&veins.quotient);
        self.balance(Self::ACCURACY, &pace.part(0.0..0.0)).await?;
        self.drive(pace).await;
        Ok(())
    }

    /// Finds the pressures at links and open ends, with linearised ends.
    async fn balance(&mut self, accuracy: f64, pace: &Pace) -> Result<(), FlowError> {
        self.sides[0].quotient.eliminate(&self.arterial.ends);
        self.sides[1].quotient.eliminate(&self.venous.ends);
        let (mut pressures, residual, tolerated) = self.begin_from_last(accuracy);
        self.passes += self.descend(&mut pressures, residual, &tolerated, pace).await?;
        let Self { arterial, venous, sides: [arteries, veins], conductance, .. } = self;
        let (mut into_arteries, mut into_veins) = (vec![0.0; arteries.slots.len()], vec![0.0; veins.slots.len()]);
        veins.carry(arteries, *conductance, &pressures, &mut into_veins);
        veins.settle(venous, &into_veins);
        arteries.carry(veins, *conductance, &veins.pressures, &mut into_arteries);
        arteries.settle(arterial, &into_arteries);
        Ok(())
    }

    /// Solves both whole networks from the pressures at the links.
    async fn drive(&mut self, pace: &Pace) {
        let Self { arterial, venous, sides: [arteries, veins], conductance, .. } = self;
        let (mut into_arteries, mut into_veins) = (vec![0.0; arteries.slots.len()], vec![0.0; veins.slots.len()]);
        veins.carry(arteries, *conductance, &arteries.pressures, &mut into_veins);
        veins.drive(venous, &into_veins, &pace.part(0.0..0.5)).await;
        let pressures: Vec<f64> =
            veins.slots.iter().map(|&slot| venous.circuit.slots[slot as usize].pressure).collect();
        arteries.carry(veins, *conductance, &pressures, &mut into_arteries);
        arteries.drive(arterial, &into_arteries, &pace.part(0.5..1.0)).await;
    }

    /// Solves each tree once from the last solution. Returns the arterial pressures at the links, the remaining
    /// imbalance there, and its tolerance.
    fn begin_from_last(&mut self, accuracy: f64) -> (Vec<f64>, Vec<f64>, Tolerated) {
        let Self { arterial, venous, sides: [arteries, veins], conductance, .. } = self;
        let (mut into_arteries, mut into_veins) = (vec![0.0; arteries.slots.len()], vec![0.0; veins.slots.len()]);
        let before = veins.pressures.clone();
        arteries.carry(veins, *conductance, &before, &mut into_arteries);
        arteries.settle(arterial, &into_arteries);
        let pressures = arteries.pressures.clone();
        veins.carry(arteries, *conductance, &pressures, &mut into_veins);
        veins.settle(venous, &into_veins);
        let change: Vec<f64> = veins.pressures.iter().zip(&before).map(|(a, b)| a - b).collect();
        let mut residual = into_arteries;
        arteries.carry(veins, *conductance, &change, &mut residual);
        arteries.excuse_roots(arterial, &mut residual);
        let tolerated = self.tolerated(accuracy, &pressures, &self.sides[1].pressures);
        (pressures, residual, tolerated)
    }

    /// Conjugate gradients on the arterial pressures at the links. Returns the number of passes.
    async fn descend(
        &mut self,
        pressures: &mut [f64],
        mut residual: Vec<f64>,
        tolerated: &Tolerated,
        pace: &Pace,
    ) -> Result<usize, FlowError> {
        let Self { arterial, sides: [arteries, veins], conductance, .. } = self;
        let (mut z, mut carried) = (vec![0.0; residual.len()], vec![0.0; residual.len()]);
        let (mut into_veins, mut answer) = (vec![0.0; veins.slots.len()], vec![0.0; veins.slots.len()]);
        arteries.respond(&residual, &mut z);
        // `image` is the arteries' matrix times `direction`.
        let (mut direction, mut image) = (z.clone(), residual.clone());
        let mut product = dot(&residual, &z);
        let most = Self::MOST_PASSES + Self::MOST_PASSES_PER_NODE * residual.len();
        let mut passes = 0;
        while largest(&residual) > tolerated.flow || largest(&z) > tolerated.pressure {
            pace.rest(0.0).await;
            veins.carry(arteries, *conductance, &direction, &mut into_veins);
            veins.respond(&into_veins, &mut answer);
            arteries.carry(veins, *conductance, &answer, &mut carried);
            arteries.excuse_roots(arterial, &mut carried);
            let curvature: f64 = direction.iter().zip(image.iter().zip(&carried)).map(|(d, (i, c))| d * (i - c)).sum();
            if passes == most || !(curvature > 0.0) {
                let residual = tolerated.accuracy * largest(&residual) / tolerated.flow;
                return Err(FlowError::NotConverged { what: "the flow through the bed", passes, residual });
            }
            passes += 1;
            let step = product / curvature;
            for at in 0..pressures.len() {
                pressures[at] += step * direction[at];
                residual[at] -= step * (image[at] - carried[at]);
            }
            arteries.respond(&residual, &mut z);
            let next = dot(&residual, &z);
            let turn = next / product;
            product = next;
            for at in 0..pressures.len() {
                direction[at] = z[at] + turn * direction[at];
                image[at] = residual[at] + turn * image[at];
            }
        }
        Ok(passes)
    }

    /// The tolerance: an imbalance relative to the largest flow in a link, and a correction relative to the pressures,
    /// but at least the effect of rounding of the pressures, and of a pressure that is as good as none.
    fn tolerated(&self, accuracy: f64, arterial: &[f64], venous: &[f64]) -> Tolerated {
        let [arteries, veins] = &self.sides;
        let links = arteries.of_links.iter().zip(&veins.of_links);
        let flows = links.map(|(&a, &v)| self.conductance * (arterial[a as usize] - venous[v as usize]).abs());
        let pressure = largest(arterial).max(largest(venous)).max(self.arterial.source.abs()).max(LEAST_PRESSURE);
        let rounding = Self::ROUNDING * self.conductance * pressure;
        let least = self.conductance * LEAST_PRESSURE;
        Tolerated { accuracy, flow: accuracy * flows.fold(least, f64::max) + rounding, pressure: accuracy * pressure }
    }
}

/// Tolerance of the conjugate gradients.
struct Tolerated {
    /// Relative.
    accuracy: f64,
    /// In m³/s.
    flow: f64,
    /// In Pa.
    pressure: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| largest.max(value.abs()))
}
