//! A panel to tweak vessels with: every setting of both generators, presets, seeds, progress, statistics, products and
//! operating tools.
//!
//! In: organs with a [`Vasculature`](crate::plugin::Vasculature), and what a user does in the panel. Out: changed
//! components and messages of the plugin, as code would write them. The panel has no way of its own to anything.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_vessels::{prelude::*, ui::VesselPanelPlugin};
//!
//! App::new().add_plugins((DefaultPlugins, VesselPlugin::default(), VesselPanelPlugin)).run();
//! ```
//!
//! What is drawn stays while settings change: organs in the panel [regrow unseen](crate::plugin::RegrowsUnseen).
//!
//! [`PanelFocus`] tells whether the pointer and the keys belong to the panel. A camera that asks it never moves while
//! the panel is used.

mod brush;
mod colonization;
mod focus;
mod generator;
mod growth;
mod history;
mod knob;
mod optimisation;
mod organ;
mod overlay;
mod painting;
mod panel;
mod pointer;
mod preset;
mod products;
mod sketch;
mod state;
mod statistics;
mod stroke;
mod surgery;
mod widgets;

pub use brush::Brush;
pub use focus::PanelFocus;
pub use state::{PanelTool, VesselPanel};

use bevy::prelude::*;
use bevy_egui::{EguiPlugin, EguiPreUpdateSet, EguiPrimaryContextPass};

/// Shows the panel of vessels in the primary context of egui: that of the first camera, or of one with
/// `PrimaryEguiContext`.
///
/// Add it after `DefaultPlugins` and [`VesselPlugin`](crate::VesselPlugin). It adds `EguiPlugin` where that is missing.
/// [`VesselPanel`] has its state.
#[derive(Clone, Copy, Debug, Default)]
pub struct VesselPanelPlugin;

impl Plugin for VesselPanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<VesselPanel>()
            .init_resource::<PanelFocus>()
            .init_resource::<painting::Painting>()
            .init_resource::<products::ProductNews>()
            .init_resource::<panel::PanelMemory>()
            .add_systems(PreUpdate, focus::note_focus.after(EguiPreUpdateSet::BeginPass))
            .add_systems(Update, (surgery::operate, painting::paint, overlay::lay_paint, products::hear))
            .add_systems(EguiPrimaryContextPass, (overlay::draw_lines, panel::show_panel).chain().run_if(is_open));
    }
}

/// Whether the panel is open.
fn is_open(panel: Res<VesselPanel>) -> bool {
    panel.open
}
