//! Progress of the growth, and what steers it.

use super::widgets::show_error;
use crate::plugin::{GrowthAction, GrowthControl, GrowthPhase, GrowthProgress};
use crate::synthesis::tree::VesselKind;
use bevy_egui::egui::{ProgressBar, Ui};

/// Shows the buttons that steer a growth, and returns what was asked for.
pub(super) fn show_buttons(ui: &mut Ui, control: GrowthControl) -> Option<GrowthAction> {
    let is_running = control == GrowthControl::Running;
    ui.horizontal(|ui| {
        let run = ui.button(if is_running { "⏸ pause" } else { "▶ grow" });
        let buttons = [
            (run, if is_running { GrowthAction::Pause } else { GrowthAction::Resume }),
            (ui.button("⏭ step"), GrowthAction::Step(1)),
            (ui.button("⟲ restart"), GrowthAction::Restart),
            (
                ui.button("⏩ finish").on_hover_text("All steps in one frame, however long it takes."),
                GrowthAction::Finish,
            ),
        ];
        buttons.into_iter().find(|(button, _)| button.clicked()).map(|(_, action)| action)
    })
    .inner
}

/// Shows what a growth is doing, and why it can't if it can't.
pub(super) fn show_progress(ui: &mut Ui, progress: &GrowthProgress, error: Option<String>) {
    let (share, text) = match progress.phase {
        GrowthPhase::WaitingForMesh => (0.0, "waiting for a mesh".to_owned()),
        GrowthPhase::WaitingForImage => (0.0, "waiting for an image".to_owned()),
        GrowthPhase::PreparingTissue => (progress.prepared, "preparing the tissue".to_owned()),
        GrowthPhase::Growing => (progress.fraction(), format!("step {} of {}", progress.step, progress.steps)),
        GrowthPhase::Held => (progress.fraction(), "resting until cuts are undone".to_owned()),
        GrowthPhase::Regrowing => {
            (progress.fraction(), format!("regrowing, step {} of {}", progress.step, progress.steps))
        }
        GrowthPhase::Finished => (1.0, format!("grown in {:.0} ms", 1e3 * progress.grow_time.as_secs_f64())),
        GrowthPhase::Failed => (0.0, "failed".to_owned()),
    };
    ui.add(ProgressBar::new(share).text(text));
    if let Some(error) = error {
        show_error(ui, error);
    }
    let kinds = VesselKind::ALL.into_iter().filter(|&kind| progress.nodes[kind] > 0);
    let counts: Vec<String> =
        kinds.map(|kind| format!("{} {}", progress.nodes[kind], kind.plural().to_lowercase())).collect();
    if !counts.is_empty() {
        ui.weak(format!("nodes: {}", counts.join(", ")));
    }
}
