//! The settings of the blood flow in an organ's vessels, and its results: loss and supply.

use crate::plugin::{
    circulation::{organ_flow::Hydraulics, state::CirculationState},
    surgery::cuttable::Cuttable,
};
use crate::synthesis::{
    haemodynamics::{BedSettings, BleedingSettings, FlowSettings, RootPressure, ViscosityLaw},
    preset::OrganBlood,
    tissue::Extent,
    tree::{ByKind, VesselKind},
    units::{Flow, Pressure, Scale, Volume},
};
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// Fills an organ's vessels with blood, so that open ends bleed. Put it beside the organ's
/// [`Vasculature`](crate::plugin::Vasculature).
///
/// Blood flows once the vessels have grown; with fewer than 8192 nodes, also while they grow. It costs nothing while no
/// end is open. A changed setting takes effect at the next frame: open ends go on bleeding, but changed bleeding
/// settings restart the clotting. If several vessel entities have one kind, the first has blood.
///
/// Flow is that of the organ at rest: neither its transform nor its deformation changes it.
///
/// Vessels alone let through many times what an organ takes: litres a minute in a colon. Presets that know their
/// organ's blood, in [`Vasculature::blood`](crate::plugin::Vasculature::blood), give a physiological flow: unless
/// [`scale`](Self::scale) and [`bed`](Self::bed) are given, the organ has the size of such an organ, and its bed the
/// resistance at which it takes that flow once its vessels have grown. Without such a preset, give the bed a
/// resistance.
///
/// Time is that of Bevy's generic clock. Its virtual time counts at most a quarter of a second of a frame, unless an app
/// sets another `max_delta` of [`Time<Virtual>`](bevy::time::Virtual): in longer frames blood loses time, as all does that
/// follows this clock.
///
/// ```
/// # use bevy_vessels::{plugin::{Perfusion, Vasculature}, synthesis::{preset::PresetName, units::Scale}};
/// let organ = (
///     Vasculature::new(PresetName::Colon),
///     Perfusion { scale: Some(Scale::MILLIMETRES), ..Perfusion::default() },
/// );
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(Cuttable, CirculationState, BloodLoss, OrganSupply)]
pub struct Perfusion {
    /// Length of a unit of the organ's mesh. Flow rises with its cube, so a wrong scale is easily seen.
    ///
    /// The scale of the organ's transform doesn't count.
    ///
    /// Default: `None`, for the one at which the organ has the size that its preset knows. Where it knows none:
    /// [`Self::DEFAULT_SCALE`], as in glTF files and Bevy's worlds.
    pub scale: Option<Scale>,
    /// How viscosity depends on vessel diameter. Default: [`ViscosityLaw::IN_VIVO`].
    pub viscosity: ViscosityLaw,
    /// Pressure at the arteries' roots; a [`Pulse`](crate::synthesis::haemodynamics::Pulse) makes open ends spurt.
    ///
    /// Default: constant, [`FlowSettings::DEFAULT_ARTERIAL_PRESSURE`].
    pub arterial_pressure: RootPressure,
    /// Pressure at the veins' roots. Default: constant, [`FlowSettings::DEFAULT_VENOUS_PRESSURE`].
    pub venous_pressure: RootPressure,
    /// Pressure at the portal veins' roots. Default: constant, [`FlowSettings::DEFAULT_PORTAL_PRESSURE`].
    pub portal_pressure: RootPressure,
    /// The bed behind the portal veins' terminals, the sinusoids of the liver. No links join it to other vessels.
    ///
    /// Default: at [`FlowSettings::DEFAULT_SINUSOID_PRESSURE`], without a resistance.
    pub portal_bed: BedSettings,
    /// The capillary bed behind the terminals of arteries and veins.
    ///
    /// With a resistance, the arteries and veins of an organ that grew are joined where an artery supplied a drain that
    /// a vein then drained, so a loss on one side affects the other. Each frame then takes several sweeps over both
    /// trees. Without a resistance, each side ends in the bed on its own, and the cost of a frame depends only on the
    /// number of open ends.
    ///
    /// Default: `None`, for the resistance at which the flow that the preset knows enters the organ; if the vessels
    /// don't let through that much, or it knows none, without a resistance, at the pressure of
    /// [`FlowSettings::arterial`].
    pub bed: Option<BedSettings>,
    /// Pressure outside the vessels. Default: atmospheric, 0.
    pub ambient: Pressure,
    /// Discharge coefficient of open ends. Limits: > 0, at most 1. Default:
    /// [`FlowSettings::DEFAULT_DISCHARGE_COEFFICIENT`].
    pub discharge_coefficient: f32,
    /// How open ends bleed and clot.
    pub bleeding: BleedingSettings,
    /// Supply below which tissue counts as ischaemic. Limits: 0 to 1. Default: [`Self::DEFAULT_ISCHAEMIC_BELOW`].
    pub ischaemic_below: f32,
    /// Shortest time between two measurements of the supply while something bleeds; after an action it is measured at
    /// once. Each is a sweep over the whole tree, in a job for large ones.
    ///
    /// Units: seconds. Limits: ≥ 0. Default: [`Self::DEFAULT_SUPPLY_INTERVAL`].
    pub supply_interval: f32,
    /// Whether time stops for the blood of this organ. Default: false.
    pub paused: bool,
}

impl Perfusion {
    /// Scale of an organ of which none is known.
    pub const DEFAULT_SCALE: Scale = Scale::METRES;
    /// Default of [`ischaemic_below`](Self::ischaemic_below): half the supply of the intact organ.
    pub const DEFAULT_ISCHAEMIC_BELOW: f32 = 0.5;
    /// Default of [`supply_interval`](Self::supply_interval), in seconds.
    pub const DEFAULT_SUPPLY_INTERVAL: f32 = 0.5;

    /// The flow settings of a kind of vessels, without what a preset knows; `None` for those that carry no blood.
    pub fn flow_settings(&self, kind: VesselKind) -> Option<FlowSettings> {
        let scale = self.scale.unwrap_or(Self::DEFAULT_SCALE);
        let bed = self.bed.unwrap_or_else(|| FlowSettings::arterial().bed);
        let (root, bed) = match kind {
            VesselKind::Artery => (self.arterial_pressure, bed),
            VesselKind::Vein => (self.venous_pressure, bed),
            VesselKind::PortalVein => (self.portal_pressure, self.portal_bed),
            VesselKind::Duct => return None,
        };
        let Self { viscosity, ambient, discharge_coefficient, .. } = *self;
        Some(FlowSettings { scale, viscosity, root, bed, ambient, discharge_coefficient })
    }

    /// The same for all kinds, in an organ of this extent with this blood.
    pub(crate) fn hydraulics(&self, blood: Option<OrganBlood>, extent: Option<Extent>) -> Hydraulics {
        let scale = || blood?.scale(extent?).ok();
        let scaled = Self { scale: self.scale.or_else(scale), ..self.clone() };
        let flow = if self.bed.is_none() { blood.map(|blood| blood.flow) } else { None };
        Hydraulics { settings: ByKind::from_fn(|kind| scaled.flow_settings(kind)), flow }
    }
}

impl Default for Perfusion {
    fn default() -> Self {
        let (arterial, venous, portal) = (FlowSettings::arterial(), FlowSettings::venous(), FlowSettings::portal());
        Self {
            scale: None,
            viscosity: arterial.viscosity,
            arterial_pressure: arterial.root,
            venous_pressure: venous.root,
            portal_pressure: portal.root,
            portal_bed: portal.bed,
            bed: None,
            ambient: arterial.ambient,
            discharge_coefficient: arterial.discharge_coefficient,
            bleeding: BleedingSettings::default(),
            ischaemic_below: Self::DEFAULT_ISCHAEMIC_BELOW,
            supply_interval: Self::DEFAULT_SUPPLY_INTERVAL,
            paused: false,
        }
    }
}

/// The blood that an organ loses. Read-only: the plugin writes it, and adds to the present values, so inserting a new
/// one restarts the count.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct BloodLoss {
    /// Total loss.
    pub total: Volume,
    /// Rate of loss, as a mean over the last frame.
    pub rate: Flow,
    /// The same for each kind of vessels.
    pub rates: ByKind<Flow>,
    /// Number of bleeding ends.
    pub bleeding_ends: usize,
}

/// The blood that reaches the tissue of an organ, relative to the intact organ. Read-only: the plugin writes it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct OrganSupply {
    /// Supply of every vertex of the organ's mesh by the arteries, from 0 to 1. Empty until it has been measured, and
    /// for an organ without a mesh.
    pub vertices: Vec<f32>,
    /// Share of the bed that gets less than [`Perfusion::ischaemic_below`], from 0 to 1.
    pub ischaemic_share: f32,
}

/// The blood flow through the segments of a vessel entity, relative to the intact vessels. Read-only: the plugin writes
/// it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct SegmentSupply {
    /// Supply of every segment, indexed by its end node, from 0 to 1. Segments that grew later are missing.
    pub segments: Vec<f32>,
}
