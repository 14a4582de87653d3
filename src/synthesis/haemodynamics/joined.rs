//! Arteries and veins joined through the capillary bed.
//!
//! In: the networks of two trees, and the links between their nodes: each a stretch of bed with the bed's resistance.
//! Out: both networks solved, so that the flow from an artery into a link arrives in the vein. Terminals without a link
//! drain into the bed's pool, as in a single network.
//!
//! The links make loops, so no pair of sweeps solves both trees at once, but each alone is solved exactly. That is what
//! conjugate gradients need (`gradients.rs`): few passes where the bed resists, as that of an organ does. They begin at
//! the last solution, so there is no pass if nothing has changed. The less the bed resists, the more passes it takes,
//! and the less its flow is known from pressures on both sides that hardly differ. Then all joints of both trees are
//! eliminated instead (`whole.rs`): more work, but with an exact result for any resistances. A piece that only links
//! connect could have any pressure; a leak of 10⁻¹¹ of each link into the pool gives it the pool's. Newton's method
//! around this solves for open ends, as in a single tree.

use super::{
    FlowError, Network,
    gradients::{Gradients, Target},
    open_ends::OpenEnds,
    side::{LEAST_PRESSURE, Side},
    whole::Whole,
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
    whole: Whole,
    /// Least share of a change of pressure in the arteries that doesn't come back from the veins; `None` if the links tie
    /// the trees too closely for conjugate gradients.
    loose_share: Option<f64>,
}

impl Circulation {
    /// Share of a change of pressure that must not come back from the veins for conjugate gradients: one that needs as
    /// many passes as an elimination of all joints is worth.
    const LEAST_SHARE: f64 = 1e-5;
    /// Accuracy of the conjugate gradients.
    const ACCURACY: f64 = 1e-12;
    /// The same in the first round for the open ends, whose flow is still a guess.
    const FIRST_ACCURACY: f64 = 1e-4;
    /// Error of a pressure found by conjugate gradients, relative to the largest.
    const GRADIENT_ERROR: f64 = 1e-11;
    /// Share of a flow through an open end that this error may be.
    const BLUR: f64 = 1e-6;
    /// Pressure without effect, in Pa, however small the others are.
    const NOTHING: f64 = Self::GRADIENT_ERROR * LEAST_PRESSURE;
    /// Passes of Newton's method for the open ends after which it counts as failed; some five are usual.
    const MOST_ROUNDS: usize = 200;
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
        let conductance = arterial.settings.bed.conductance().ok_or(FlowError::BedWithoutResistance)?;
        venous.settings.bed.resistance = arterial.settings.bed.resistance;
        venous.set_beds(&pace.part(0.0..0.3)).await;
        let mut circulation = Self {
            arterial,
            venous,
            links: 0,
            conductance,
            passes: 0,
            sides: Default::default(),
            whole: Whole::default(),
            loose_share: None,
        };
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
        for network in [&mut self.arterial, &mut self.venous] {
            network.settings.bed.resistance = Some(resistance);
            at_once(network.set_beds(&Pace::default()));
        }
        self.conductance = self.arterial.settings.bed.conductance().ok_or(FlowError::BedWithoutResistance)?;
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
        let has_changed = [
            self.sides[0].prepare(&mut self.arterial, &pace.part(0.0..0.2)).await,
            self.sides[1].prepare(&mut self.venous, &pace.part(0.2..0.4)).await,
        ];
        if has_changed != [false; 2] {
            let share = self.gradients().loose_share(Self::LEAST_SHARE);
            self.loose_share = (share >= Self::LEAST_SHARE).then_some(share);
        }
        let (balancing, driving) = (pace.part(0.4..0.7), pace.part(0.7..1.0));
        if self.networks().iter().all(|network| network.ends.all().is_empty()) {
            self.balance(Self::ACCURACY, &balancing).await;
            self.drive(&driving).await;
            return Ok(());
        }
        self.start_ends();
        let (mut residual, mut accuracy) = (f64::INFINITY, Self::FIRST_ACCURACY);
        for round in 0..Self::MOST_ROUNDS {
            self.arterial.ends.linearise();
            self.venous.ends.linearise();
            self.balance(accuracy, &balancing).await;
            let is_exact = self.loose_share.is_none() || accuracy == Self::ACCURACY;
            residual = self.accept_ends(round >= Self::UNDAMPED);
            if residual <= 1.0 && is_exact {
                self.finish(&driving).await;
                return Ok(());
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

    fn networks(&self) -> [&Network; 2] {
        [&self.arterial, &self.venous]
    }

    /// Makes pressures of both relative to the same pool.
    fn share_bed_pressure(&mut self) {
        let moved = self.venous.bed - self.arterial.bed;
        self.venous.source += moved;
        self.venous.bed = self.arterial.bed;
    }

    /// First guess of the flows through open ends: the last ones, but no more than the highest pressure of all drives.
    fn start_ends(&mut self) {
        let highest = self.arterial.source.max(self.venous.source).max(0.0);
        for network in [&mut self.arterial, &mut self.venous] {
            let ambient = network.ambient();
            network.ends.start_below(highest - ambient);
        }
    }

    /// Takes the flows through open ends from the pressures. Returns the largest change, in units of the tolerance.
    fn accept_ends(&mut self, damped: bool) -> f64 {
        let mut residual = 0.0;
        let is_tight = self.loose_share.is_none();
        for (network, side) in [&mut self.arterial, &mut self.venous].into_iter().zip(&self.sides) {
            let largest = network.source.abs().max(network.ambient().abs()).max(LEAST_PRESSURE);
            let rounding = if is_tight { Self::NOTHING } else { Self::GRADIENT_ERROR * largest };
            residual = f64::max(residual, network.ends.accept(|end| side.from_outside(end), rounding, damped));
            if network.ends.is_blurred(rounding, Self::BLUR) {
                self.loose_share = None;
            }
        }
        residual
    }

    /// Replaces the ends' tangents by their draw, and solves once more.
    async fn finish(&mut self, pace: &Pace) {
        for (network, side) in [&mut self.arterial, &mut self.venous].into_iter().zip(&self.sides) {
            let ambient = network.ambient() + network.bed;
            network.ends.finish(|end| side.from_outside(end), ambient);
        }
        self.balance(Self::ACCURACY, &pace.part(0.0..0.0)).await;
        for network in [&mut self.arterial, &mut self.venous] {
            let ambient = network.ambient();
            network.ends.count_from(-ambient);
        }
        self.drive(pace).await;
    }

    /// Finds the pressures at links and open ends, with linearised ends.
    async fn balance(&mut self, accuracy: f64, pace: &Pace) {
        if let Some(share) = self.loose_share {
            match self.gradients().balance(Target { accuracy, share }, pace).await {
                Some(passes) => {
                    self.passes += passes;
                    return;
                }
                None => self.loose_share = None,
            }
        }
        let Self { arterial, venous, sides, conductance, .. } = self;
        self.whole.balance([arterial, venous], sides, *conductance, pace).await;
    }

    fn gradients(&mut self) -> Gradients<'_> {
        let Self { arterial, venous, sides, conductance, .. } = self;
        Gradients { networks: [arterial, venous], sides, conductance: *conductance }
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
}
