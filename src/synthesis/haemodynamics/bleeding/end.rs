//! What is known of each open end.

use crate::synthesis::{
    haemodynamics::{EndSide, NetworkEnd},
    tree::NodeId,
    units::{Flow, Pressure, Volume},
};

/// The state of an open end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum EndState {
    /// Blood leaves it.
    Bleeding,
    /// It is open, but has too little pressure to bleed: behind a clamp, or with a low bed pressure.
    Dry,
    /// It has clotted.
    Clotted,
}

/// The bleeding of one open end.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BleedingEnd {
    /// End node of the severed segment.
    pub node: NodeId,
    /// Which end of the gap.
    pub side: EndSide,
    /// Place on the segment, as a share of the way from its parent.
    pub along: f32,
    /// Seconds since it was opened.
    pub age: f64,
    /// Mean flow during the last step.
    pub flow: Flow,
    /// Pressure in the vessel before the hole, at the end of the last step.
    pub pressure: Pressure,
    /// Mean velocity in the hole in m/s, at the end of the last step: the speed at which a drop leaves.
    pub velocity: f64,
    /// Volume lost since it was opened.
    pub lost: Volume,
    /// Its state after the last step.
    pub state: EndState,
    /// Radius of its hole before clotting, in tissue lengths. A later cut makes a new hole.
    pub(super) radius: f32,
    /// Loss during this step, in m³.
    #[cfg_attr(feature = "serialize", serde(skip))]
    pub(super) lost_in_step: f64,
    /// Whether it bled before this step.
    #[cfg_attr(feature = "serialize", serde(skip))]
    pub(super) bled: bool,
}

impl BleedingEnd {
    pub(super) fn new(end: &NetworkEnd) -> Self {
        Self {
            node: end.node,
            side: end.side,
            along: end.along,
            age: 0.0,
            flow: Flow::ZERO,
            pressure: Pressure::ZERO,
            velocity: 0.0,
            lost: Volume::ZERO,
            state: EndState::Dry,
            radius: end.outlet.radius,
            lost_in_step: 0.0,
            bled: false,
        }
    }

    pub(super) fn key(&self) -> (NodeId, EndSide) {
        (self.node, self.side)
    }

    pub(super) fn is_of(&self, end: &NetworkEnd) -> bool {
        self.key() == (end.node, end.side) && self.along == end.along && self.radius == end.outlet.radius
    }
}

/// An end that began or stopped bleeding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BleedingChange {
    /// End node of the severed segment.
    pub node: NodeId,
    /// Which end of the gap.
    pub side: EndSide,
    /// Whether it bleeds now.
    pub bleeds: bool,
}
