//! What an app may read and set of the panel.

use super::brush::Brush;
use crate::synthesis::tree::VesselKind;
use bevy::prelude::*;

/// The panel of vessels.
#[derive(Resource, Clone, Debug, PartialEq)]
pub struct VesselPanel {
    /// Whether it is shown. Default: true.
    pub open: bool,
    /// The organ that it shows. `None`, or an entity that is gone: the first one. Default: `None`.
    pub organ: Option<Entity>,
    /// What the primary button of the pointer does to the organ and its vessels. Default: [`PanelTool::Hand`].
    pub tool: PanelTool,
    /// How painting tools paint.
    pub brush: Brush,
    /// Whether a change of the arteries' settings changes the veins' alike. Default: true.
    pub linked: bool,
}

impl Default for VesselPanel {
    fn default() -> Self {
        Self { open: true, organ: None, tool: PanelTool::default(), brush: Brush::default(), linked: true }
    }
}

/// A tool that the primary button of the pointer holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PanelTool {
    /// None: the pointer belongs to the app's camera.
    #[default]
    Hand,
    /// Severs what it is drawn over.
    Scalpel,
    /// Clamps the vessel that is clicked.
    Clamp,
    /// Takes off the clamp that is clicked.
    Unclamp,
    /// Ties off the vessel that is clicked.
    Ligature,
    /// Seals small vessels that it touches.
    Cautery,
    /// Draws guides for large vessels, and moves their points.
    Guide,
    /// Paints the density of vessels.
    Density,
    /// Paints where no vessel may be.
    NoGo,
    /// Places roots of a kind, and moves them.
    Root(VesselKind),
}

impl PanelTool {
    /// The tools that operate on vessels, after the empty hand.
    pub const OPERATING: [Self; 6] =
        [Self::Hand, Self::Scalpel, Self::Clamp, Self::Unclamp, Self::Ligature, Self::Cautery];

    /// The tools that paint on the organ.
    pub const PAINTING: [Self; 7] = [
        Self::Guide,
        Self::Density,
        Self::NoGo,
        Self::Root(VesselKind::Artery),
        Self::Root(VesselKind::Vein),
        Self::Root(VesselKind::PortalVein),
        Self::Root(VesselKind::Duct),
    ];

    /// Its name in the panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hand => "hand",
            Self::Scalpel => "scalpel",
            Self::Clamp => "clamp",
            Self::Unclamp => "unclamp",
            Self::Ligature => "ligate",
            Self::Cautery => "cautery",
            Self::Guide => "guide",
            Self::Density => "density",
            Self::NoGo => "no-go",
            Self::Root(VesselKind::Artery) => "arterial root",
            Self::Root(VesselKind::Vein) => "venous root",
            Self::Root(VesselKind::PortalVein) => "portal root",
            Self::Root(VesselKind::Duct) => "ductal root",
        }
    }

    /// Whether it paints on the organ.
    pub fn paints(self) -> bool {
        Self::PAINTING.contains(&self)
    }
}
