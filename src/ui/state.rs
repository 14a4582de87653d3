//! What an app may read and set of the panel.

use bevy::prelude::*;

/// The panel of vessels.
#[derive(Resource, Clone, Debug, PartialEq)]
pub struct VesselPanel {
    /// Whether it is shown. Default: true.
    pub open: bool,
    /// The organ that it shows. `None`, or an entity that is gone: the first one. Default: `None`.
    pub organ: Option<Entity>,
    /// What the primary button of the pointer does to the organ's vessels. Default: [`PanelTool::Hand`].
    pub tool: PanelTool,
    /// Whether a change of the arteries' settings changes the veins' alike. Default: true.
    pub linked: bool,
}

impl Default for VesselPanel {
    fn default() -> Self {
        Self { open: true, organ: None, tool: PanelTool::default(), linked: true }
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
}

impl PanelTool {
    /// All tools.
    pub const ALL: [Self; 6] = [Self::Hand, Self::Scalpel, Self::Clamp, Self::Unclamp, Self::Ligature, Self::Cautery];

    /// Its name in the panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hand => "hand",
            Self::Scalpel => "scalpel",
            Self::Clamp => "clamp",
            Self::Unclamp => "unclamp",
            Self::Ligature => "ligate",
            Self::Cautery => "cautery",
        }
    }
}
