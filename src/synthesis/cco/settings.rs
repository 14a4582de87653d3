//! Settings of constrained constructive optimisation, with OpenCCO's defaults.
//!
//! Source: Kerautret et al., "OpenCCO: An Implementation of Constrained Constructive Optimization for Generating 2D and
//! 3D Vascular Trees", IPOL 2023, section 5. The physical size of the tissue is a setting of its own, so a tree depends
//! on the shape of a tissue, not on its units.

use super::error::CcoSettingsError;
use crate::synthesis::{
    growth::GrowthWarning,
    roots::RootSpacing,
    tissue::Extent,
    tree::{ByKind, VesselKind},
    units::{Flow, Pressure, Viscosity},
};

/// Settings of constrained constructive optimisation.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct CcoSettings {
    /// Number k of terminals of each kind of vessels, over all its roots.
    ///
    /// More terminals give a finer tree: each supplies its share of the tissue.
    ///
    /// Limits: ≥ the number of roots, up to [`Self::MAX_TERMINALS`]. Default: [`Self::DEFAULT_TERMINALS`].
    pub terminals: u32,
    /// Physical size of the whole tissue: its area if it is flat, its volume if it is solid.
    ///
    /// A larger tissue with the same flow has vessels that are thinner in relation to it.
    ///
    /// Units: mm² or mm³. Limits: > 0. Default: [`Self::DEFAULT_PERFUSION`].
    pub perfusion: f32,
    /// Exponent γ of Murray's law, `r_p^γ = r_l^γ + r_r^γ`.
    ///
    /// Higher values make parents thinner relative to their children.
    ///
    /// Limits: 2 to 4. Default: [`Self::DEFAULT_BIFURCATION_EXPONENT`].
    pub bifurcation_exponent: f32,
    /// Flow, pressures and viscosity of each kind of vessels. Kinds without a root don't matter.
    ///
    /// Default: [`VesselFlow::default`] for all kinds.
    pub flow: ByKind<VesselFlow>,
    /// Spread of the flows of the terminals, as a share of their mean: each has a flow from 1 − spread to 1 + spread
    /// times the mean, at random.
    ///
    /// Higher values give terminals of more different widths. 0 gives all the same flow, as OpenCCO does.
    ///
    /// Limits: 0 to [`Self::MAX_FLOW_SPREAD`]. Default: 0.
    pub flow_spread: f32,
    /// Least distance between the wall of a vessel and the border of the tissue.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: 0.
    pub border_distance: f32,
    /// Number `N_con` of nearest segments to which a new terminal may be connected. It is doubled while none of them
    /// can be, up to [`Self::MOST_DOUBLINGS`] times; then another place is drawn.
    ///
    /// Higher values compare more connections, and take longer.
    ///
    /// Limits: 1 to 1000. Default: [`Self::DEFAULT_CANDIDATES`].
    pub candidates: u32,
    /// Share of the volume of a new segment below which a better place for the bifurcation is not searched for.
    ///
    /// Limits: 1e-12 to 0.1. Default: [`Self::DEFAULT_TOLERANCE`].
    pub tolerance: f32,
    /// Sweeps at the end that move every bifurcation to the place of least volume under the final flows.
    ///
    /// 0 leaves the bifurcations where they were made, as OpenCCO does. Otherwise there is one more sweep whenever the
    /// number of terminals has doubled. After four at the end little is left to gain.
    ///
    /// Limits: ≤ 100. Default: [`Self::DEFAULT_POLISH_SWEEPS`].
    pub polish_sweeps: u32,
}

/// What flows through all vessels of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct VesselFlow {
    /// Flow Q through all terminals together. Higher values give wider vessels.
    ///
    /// Limits: > 0. Default: [`Self::DEFAULT_RATE`].
    pub rate: Flow,
    /// Viscosity µ of what flows. Higher values give wider vessels.
    ///
    /// Limits: > 0. Default: [`Self::DEFAULT_VISCOSITY`].
    pub viscosity: Viscosity,
    /// Pressure `P_in` at the root: the higher end of the pressure loss, in whichever direction it flows.
    ///
    /// Limits: above [`terminal_pressure`](Self::terminal_pressure). Default: [`Self::DEFAULT_ROOT_PRESSURE`].
    pub root_pressure: Pressure,
    /// Pressure `P_out` at every terminal. The nearer it is to the root's, the wider are the vessels.
    ///
    /// Limits: below [`root_pressure`](Self::root_pressure). Default: [`Self::DEFAULT_TERMINAL_PRESSURE`].
    pub terminal_pressure: Pressure,
}

impl VesselFlow {
    /// Q of OpenCCO: 8330 mm³/s.
    pub const DEFAULT_RATE: Flow = Flow::from_cubic_metres_per_second(8.33e-6);
    /// µ of OpenCCO: 3.6 mPa·s.
    pub const DEFAULT_VISCOSITY: Viscosity = Viscosity::from_centipoise(3.6);
    /// `P_in` of OpenCCO: 13,300 Pa, which is 100 mmHg.
    pub const DEFAULT_ROOT_PRESSURE: Pressure = Pressure::from_pascals(13_300.0);
    /// `P_out` of OpenCCO for more than 250 terminals, 7980 Pa. For fewer it takes 8400 Pa.
    pub const DEFAULT_TERMINAL_PRESSURE: Pressure = Pressure::from_pascals(7980.0);

    fn validate(&self, kind: VesselKind) -> Result<(), CcoSettingsError> {
        let positive = |name, value: f64| {
            let is_good = value.is_finite() && value > 0.0;
            if is_good { Ok(()) } else { Err(CcoSettingsError::Flow { kind, name, value }) }
        };
        positive("rate, in m³/s,", self.rate.cubic_metres_per_second())?;
        positive("viscosity, in Pa·s,", self.viscosity.pascal_seconds())?;
        let (root, terminal) = (self.root_pressure.pascals(), self.terminal_pressure.pascals());
        if root.is_finite() && terminal.is_finite() && root > terminal {
            Ok(())
        } else {
            Err(CcoSettingsError::Pressures { kind, root, terminal })
        }
    }
}

impl Default for VesselFlow {
    fn default() -> Self {
        Self {
            rate: Self::DEFAULT_RATE,
            viscosity: Self::DEFAULT_VISCOSITY,
            root_pressure: Self::DEFAULT_ROOT_PRESSURE,
            terminal_pressure: Self::DEFAULT_TERMINAL_PRESSURE,
        }
    }
}

impl CcoSettings {
    /// Default number of terminals of OpenCCO.
    pub const DEFAULT_TERMINALS: u32 = 1000;
    /// Most terminals of one kind.
    pub const MAX_TERMINALS: u32 = 10_000_000;
    /// Perfusion area or volume of OpenCCO, in mm² or mm³.
    pub const DEFAULT_PERFUSION: f32 = 20_000.0;
    /// γ of OpenCCO.
    pub const DEFAULT_BIFURCATION_EXPONENT: f32 = 3.0;
    /// Highest spread of terminal flows: above it some terminals would have hardly any.
    pub const MAX_FLOW_SPREAD: f32 = 0.9;
    /// `N_con` of OpenCCO.
    pub const DEFAULT_CANDIDATES: u32 = 20;
    /// How often the number of candidates is doubled for one terminal.
    pub const MOST_DOUBLINGS: u32 = 1;
    /// Default of [`tolerance`](Self::tolerance).
    pub const DEFAULT_TOLERANCE: f32 = 1.0e-4;
    /// Default of [`polish_sweeps`](Self::polish_sweeps).
    pub const DEFAULT_POLISH_SWEEPS: u32 = 4;
    /// Checks every setting against its limits, and returns warnings about unusual ones.
    ///
    /// # Errors
    /// The first setting outside its limits.
    pub fn validate(&self) -> Result<Vec<GrowthWarning>, CcoSettingsError> {
        let count = |name, value, least, most| match value {
            value if (least..=most).contains(&value) => Ok(()),
            value => Err(CcoSettingsError::Count { name, value, least, most }),
        };
        count("terminals", self.terminals, 1, Self::MAX_TERMINALS)?;
        count("candidates", self.candidates, 1, 1000)?;
        count("polish_sweeps", self.polish_sweeps, 0, 100)?;
        let range = |name, value: f64, limits, holds: bool| {
            if value.is_finite() && holds { Ok(()) } else { Err(CcoSettingsError::OutOfRange { name, value, limits }) }
        };
        let positive = |name, value: f64| range(name, value, "above 0", value > 0.0);
        positive("perfusion", self.perfusion.into())?;
        let gamma = f64::from(self.bifurcation_exponent);
        range("bifurcation_exponent", gamma, "from 2 to 4", (2.0..=4.0).contains(&gamma))?;
        let spread = f64::from(self.flow_spread);
        range("flow_spread", spread, "from 0 to 0.9", (0.0..=0.9000001).contains(&spread))?;
        self.flow.iter().try_for_each(|(kind, flow)| flow.validate(kind))?;
        let border = f64::from(self.border_distance);
        range("border_distance", border, "0 or more", border >= 0.0)?;
        let tolerance = f64::from(self.tolerance);
        range("tolerance", tolerance, "from 1e-12 to 0.1", (0.99e-12..=0.101).contains(&tolerance))?;
        let mut warnings = Vec::new();
        if self.terminals == 1 {
            warnings.push(GrowthWarning::new("one terminal gives one straight vessel without a bifurcation"));
        }
        if self.candidates < 5 {
            warnings.push(GrowthWarning::new(format!(
                "with {} candidates a terminal often joins a segment far from the best; OpenCCO takes 20",
                self.candidates
            )));
        }
        Ok(warnings)
    }

    /// Multiplies every length in tissue lengths by `factor`. Physical sizes stay.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        self.border_distance *= factor;
        self
    }

    /// Fits settings made for a tissue of equivalent diameter 1 to a tissue of any size.
    #[must_use]
    pub fn fit(self, extent: Extent) -> Self {
        self.scaled(extent.equivalent_diameter())
    }

    /// The spacing of roots in a tissue of this extent: any kind may have roots.
    pub fn root_spacing(&self, extent: Extent) -> ByKind<Option<RootSpacing>> {
        let diameter = extent.equivalent_diameter();
        let spacing = RootSpacing { step: Self::ROOT_STEP * diameter, reach: Self::ROOT_REACH * diameter };
        ByKind::from_fn(|_: VesselKind| Some(spacing))
    }

    /// Distance between a root and another one beside it, in equivalent diameters.
    const ROOT_STEP: f32 = 0.1;
    /// Largest distance of a root from the tissue, in equivalent diameters.
    const ROOT_REACH: f32 = 0.05;
}

impl Default for CcoSettings {
    fn default() -> Self {
        Self {
            terminals: Self::DEFAULT_TERMINALS,
            perfusion: Self::DEFAULT_PERFUSION,
            bifurcation_exponent: Self::DEFAULT_BIFURCATION_EXPONENT,
            flow: ByKind::default(),
            flow_spread: 0.0,
            border_distance: 0.0,
            candidates: Self::DEFAULT_CANDIDATES,
            tolerance: Self::DEFAULT_TOLERANCE,
            polish_sweeps: Self::DEFAULT_POLISH_SWEEPS,
        }
    }
}
