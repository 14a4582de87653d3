//! Growth diagnostics, for logs and overlays.

use crate::plugin::growth::{budget::GrowthFrame, progress::GrowthProgress, shared::SharedTissues};
use crate::synthesis::tree::ByKind;
use bevy::{
    app::App,
    diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic},
    ecs::{change_detection::Res, system::Query},
};

/// Steps done in a frame, over all organs.
pub const STEPS: DiagnosticPath = DiagnosticPath::const_new("vessels/steps");
/// Milliseconds that these steps took.
pub const STEP_TIME: DiagnosticPath = DiagnosticPath::const_new("vessels/step_time");
/// Milliseconds of all growth work in a frame, which the [`GrowthBudget`](crate::plugin::GrowthBudget) limits.
pub const GROWTH_TIME: DiagnosticPath = DiagnosticPath::const_new("vessels/growth_time");
/// Nodes of all vessels.
pub const NODES: DiagnosticPath = DiagnosticPath::const_new("vessels/nodes");
/// Attraction points of all organs that wait for a vessel.
pub const WAITING: DiagnosticPath = DiagnosticPath::const_new("vessels/waiting");

/// Prepared tissues that organs grow on or wait for: one for all organs with the same mesh and
/// [`Vasculature::tissue`](crate::plugin::Vasculature::tissue).
pub const TISSUES: DiagnosticPath = DiagnosticPath::const_new("vessels/tissues");

/// Registers the diagnostics.
pub(crate) fn register(app: &mut App) {
    app.register_diagnostic(Diagnostic::new(STEPS))
        .register_diagnostic(Diagnostic::new(STEP_TIME).with_suffix(" ms"))
        .register_diagnostic(Diagnostic::new(GROWTH_TIME).with_suffix(" ms"))
        .register_diagnostic(Diagnostic::new(NODES).with_smoothing_factor(0.0))
        .register_diagnostic(Diagnostic::new(WAITING).with_smoothing_factor(0.0))
        .register_diagnostic(Diagnostic::new(TISSUES).with_smoothing_factor(0.0));
}

/// Measures a frame.
pub(crate) fn measure(
    mut diagnostics: Diagnostics,
    frame: Res<GrowthFrame>,
    tissues: Res<SharedTissues>,
    organs: Query<&GrowthProgress>,
) {
    let total = |count: fn(&GrowthProgress) -> ByKind<usize>| -> f64 {
        organs.iter().map(|progress| count(progress).values().sum::<usize>()).sum::<usize>() as f64
    };
    diagnostics.add_measurement(&STEPS, || f64::from(frame.steps));
    diagnostics.add_measurement(&STEP_TIME, || frame.step_time.as_secs_f64() * 1000.0);
    diagnostics.add_measurement(&GROWTH_TIME, || frame.time().as_secs_f64() * 1000.0);
    diagnostics.add_measurement(&NODES, || total(|progress| progress.nodes));
    diagnostics.add_measurement(&WAITING, || total(|progress| progress.waiting));
    diagnostics.add_measurement(&TISSUES, || tissues.count() as f64);
}
