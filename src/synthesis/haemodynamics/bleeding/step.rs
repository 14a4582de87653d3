//! Steps of the bleeding: of one tree, and of arteries and veins together.

use super::{Bleeding, BleedingEnd, EndState};
use crate::synthesis::{
    haemodynamics::{BloodVolume, Circulation, FlowError, Network},
    units::{Flow, Pressure, Volume},
};

/// Most parts into which a part of a step is divided because much of the blood flows: several times as many as take all
/// of it.
const MOST_SHORTER_PARTS: u32 = 256;

/// What bleeds as a whole.
trait Wounded {
    /// Flow of all open ends in the last part of a step, in m³/s.
    fn rate(&self) -> f64;

    /// Solves for the middle of a part of a step, in which the patient loses `rate` m³/s. Returns the flow of all open
    /// ends, in m³/s.
    fn solve(&mut self, part: f64, rate: f64, blood: &BloodVolume) -> Result<f64, FlowError>;

    /// Takes over the solved flows. Only a `share` of the blood that would flow is there.
    fn collect(&mut self, part: f64, share: f64, blood: &mut BloodVolume);

    /// Bleeds for a number of equal parts of a time. A part in which much of the blood flows is divided further.
    fn bleed(&mut self, parts: u32, seconds: f64, blood: &mut BloodVolume) -> Result<(), FlowError> {
        for _ in 0..parts {
            let mut left = seconds / f64::from(parts);
            let mut shorter_parts = 0;
            loop {
                let mut part = left;
                let mut rate = self.solve(part, self.rate(), blood)?;
                if let Some(shorter) = blood.shorter(rate, part) {
                    // So many let all the blood flow: what is left of the time is without pressure.
                    if shorter_parts < MOST_SHORTER_PARTS {
                        part = shorter;
                    }
                    shorter_parts += 1;
                    rate = self.solve(part, rate, blood)?;
                }
                self.collect(part, blood.share_there(rate, part), blood);
                left -= part;
                if !(left > 0.0) {
                    break;
                }
            }
        }
        Ok(())
    }
}

/// One tree.
struct Single<'a> {
    bleeding: &'a mut Bleeding,
    network: &'a mut Network,
}

impl Wounded for Single<'_> {
    fn rate(&self) -> f64 {
        self.bleeding.rate
    }

    fn solve(&mut self, part: f64, rate: f64, blood: &BloodVolume) -> Result<f64, FlowError> {
        self.bleeding.prepare(self.network, part, rate, blood)?;
        self.network.solve_ends()?;
        Ok(flow_of(self.network))
    }

    fn collect(&mut self, part: f64, share: f64, blood: &mut BloodVolume) {
        self.bleeding.collect(self.network, part, share, blood);
    }
}

/// Joined arteries and veins.
struct Joined<'a> {
    arteries: &'a mut Bleeding,
    veins: &'a mut Bleeding,
    circulation: &'a mut Circulation,
}

impl Wounded for Joined<'_> {
    fn rate(&self) -> f64 {
        self.arteries.rate + self.veins.rate
    }

    fn solve(&mut self, part: f64, rate: f64, blood: &BloodVolume) -> Result<f64, FlowError> {
        self.arteries.prepare(self.circulation.arterial_mut(), part, rate, blood)?;
        self.veins.prepare(self.circulation.venous_mut(), part, rate, blood)?;
        self.circulation.solve()?;
        Ok(flow_of(self.circulation.arterial()) + flow_of(self.circulation.venous()))
    }

    fn collect(&mut self, part: f64, share: f64, blood: &mut BloodVolume) {
        self.arteries.collect(self.circulation.arterial(), part, share, blood);
        self.veins.collect(self.circulation.venous(), part, share, blood);
    }
}

impl Bleeding {
    /// Bleeds for a time. With 0 seconds, only the present rates are computed.
    ///
    /// Sets the network's root and bed pressure to those of its settings at this time, lowered by the patient's loss,
    /// and the openings of its ends. Then the open ends are solved; call [`Network::solve`] for all pressures.
    ///
    /// # Errors
    /// If the time is negative, NaN or above [`Self::LONGEST_TIME`], or the flow did not converge.
    pub fn step(&mut self, network: &mut Network, seconds: f64, blood: &mut BloodVolume) -> Result<(), FlowError> {
        let parts = self.begin(network, seconds)?;
        Single { bleeding: self, network }.bleed(parts, seconds, blood)?;
        self.end(seconds);
        Ok(())
    }

    /// Bleeds joined arteries and veins together: the first of the pair is the arteries'. Both networks are completely
    /// solved afterwards.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_joined(
        [arteries, veins]: [&mut Self; 2],
        circulation: &mut Circulation,
        seconds: f64,
        blood: &mut BloodVolume,
    ) -> Result<(), FlowError> {
        let parts = arteries.begin(circulation.arterial(), seconds)?.max(veins.begin(circulation.venous(), seconds)?);
        Joined { arteries: &mut *arteries, veins: &mut *veins, circulation }.bleed(parts, seconds, blood)?;
        arteries.end(seconds);
        veins.end(seconds);
        Ok(())
    }

    /// Sets pressures and openings at the middle of a part of a step. `rate` is the patient's loss in m³/s.
    fn prepare(&self, network: &mut Network, part: f64, rate: f64, blood: &BloodVolume) -> Result<(), FlowError> {
        let middle = 0.5 * part;
        let left = blood.pressure_share_after(rate * middle);
        let lowered = |pressure: Pressure| Pressure::from_pascals(pressure.pascals() * left);
        network.set_bed_pressure(lowered(network.settings().bed.pressure))?;
        network.set_root_pressure(lowered(network.settings().root.at(self.time + middle)))?;
        for (index, end) in self.ends.iter().enumerate() {
            network.set_opening(index, self.opening(network, end, end.age + middle))?;
        }
        Ok(())
    }

    fn opening(&self, network: &Network, end: &BleedingEnd, age: f64) -> f64 {
        let diameter = 2.0 * network.settings().scale.to_metres(end.radius);
        self.settings.clotting.map_or(1.0, |clotting| clotting.opening(diameter, age))
    }

    /// Takes the flows of a part of a step over, once the network has solved for them. Only a `share` of the blood that
    /// would flow is there.
    fn collect(&mut self, network: &Network, part: f64, share: f64, blood: &mut BloodVolume) {
        self.rate = 0.0;
        for (end, open) in self.ends.iter_mut().zip(network.open_ends()) {
            let flow = share * open.flow().cubic_metres_per_second();
            self.rate += flow;
            end.flow = Flow::from_cubic_metres_per_second(flow);
            end.pressure = open.pressure();
            end.velocity = if flow > 0.0 { open.velocity() } else { 0.0 };
            end.lost_in_step += flow * part;
            end.age += part;
            end.state = match (flow > 0.0, open.opening > 0.0) {
                (true, _) => EndState::Bleeding,
                (false, true) => EndState::Dry,
                (false, false) => EndState::Clotted,
            };
        }
        self.time += part;
        blood.lose(Volume::from_cubic_metres(self.rate * part));
    }
}

/// Flow of all open ends, in m³/s.
fn flow_of(network: &Network) -> f64 {
    network.open_ends().iter().map(|end| end.flow().cubic_metres_per_second()).sum()
}
