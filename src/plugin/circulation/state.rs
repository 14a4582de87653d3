//! The flow in an organ's vessels, kept between frames.

use crate::plugin::{
    circulation::{
        gauge::Gauge,
        messages::CirculationError,
        organ_flow::{FlowingEnd, Hydraulics, OrganFlow},
    },
    job::Job,
    lineage::Lineage,
};
use crate::synthesis::{
    haemodynamics::{Bleeding, BleedingSettings, FlowError},
    preset::OrganBlood,
    tree::{ByKind, VesselKind},
    units::Scale,
};
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, ReflectDeserialize, ReflectSerialize, std_traits::ReflectDefault},
};
use serde::{Deserialize, Serialize};

/// The flow in an organ's vessels. The plugin drives it.
///
/// Scenes and clones of the organ keep how far its open ends have clotted. Everything else is made again.
#[derive(Component, Debug, Default, Reflect, Serialize, Deserialize)]
#[reflect(opaque, Component, Default, Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CirculationState {
    /// The vessels of the present or coming flow.
    #[serde(skip)]
    pub(super) made_for: Option<MadeFor>,
    /// What the organ's preset knows of its blood.
    #[serde(skip)]
    pub(super) blood: Option<OrganBlood>,
    /// The settings of this flow.
    #[serde(skip)]
    pub(super) made_with: Option<(Hydraulics, BleedingSettings)>,
    #[serde(skip)]
    pub(super) job: Option<Job<Result<OrganFlow, FlowError>>>,
    #[serde(skip)]
    pub(crate) flow: Option<OrganFlow>,
    pub(crate) bleeding: ByKind<Bleeding>,
    /// Open ends, in the order of the networks.
    #[serde(skip)]
    pub(crate) ends: ByKind<Vec<FlowingEnd>>,
    /// Whether the gaps have to be laid again.
    #[serde(skip)]
    pub(crate) is_unlaid: bool,
    /// Measures the supply, once the vessels have grown.
    #[serde(skip)]
    pub(crate) gauge: Gauge,
    #[serde(skip)]
    pub(super) error: Option<CirculationError>,
}

/// The vessels of a flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MadeFor {
    pub(super) lineages: ByKind<Lineage>,
    pub(super) nodes: ByKind<usize>,
    pub(super) is_grown: bool,
}

/// A clone keeps what a scene keeps.
impl Clone for CirculationState {
    fn clone(&self) -> Self {
        Self { bleeding: self.bleeding.clone().map(|_, bleeding| bleeding.resumed()), ..Self::default() }
    }
}

impl MadeFor {
    /// Whether some of its vessels have been replaced.
    pub(super) fn is_replaced_by(&self, now: &Self) -> bool {
        VesselKind::ALL.into_iter().any(|kind| self.nodes[kind] > 0 && self.lineages[kind] != now.lineages[kind])
    }
}

impl CirculationState {
    /// Whether blood flows: the vessels exist, and their network has been made.
    pub fn flows(&self) -> bool {
        self.flow.is_some()
    }

    /// The bleeding of each open end of a kind of vessels, as of the last frame.
    pub fn bleeding(&self, kind: VesselKind) -> &Bleeding {
        &self.bleeding[kind]
    }

    /// Length of a unit of the organ's mesh for its blood: the one that is given, or that of the preset; `None` before
    /// the first flow.
    pub fn scale(&self) -> Option<Scale> {
        let (hydraulics, _) = self.made_with.as_ref()?;
        hydraulics.settings.artery.as_ref().map(|settings| settings.scale)
    }

    /// Why no blood flows, if something is wrong.
    pub fn error(&self) -> Option<&CirculationError> {
        self.error.as_ref()
    }

    pub(crate) fn flow(&self) -> Option<&OrganFlow> {
        self.flow.as_ref()
    }

    /// Takes over a new flow, with the gaps of the old one.
    pub(super) fn take(&mut self, mut flow: OrganFlow, is_grown: bool) -> Result<(), FlowError> {
        if let Some(before) = &self.flow {
            flow.keep_gaps_of(before)?;
        }
        self.flow = Some(flow);
        self.is_unlaid = true;
        self.gauge = if is_grown { Gauge::ready() } else { Gauge::default() };
        Ok(())
    }
}
