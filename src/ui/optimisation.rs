//! The settings of constrained constructive optimisation, in the order of OpenCCO's table.

use super::knob::{Field, Knob, Rows, Unit};
use crate::synthesis::{
    cco::{CcoSettings, VesselFlow},
    tree::VesselKind,
    units::{Flow, Pressure, Viscosity},
};
use bevy_egui::egui::{self, DragValue, Grid, Ui};

static KNOBS: [Knob<CcoSettings>; 8] = [
    Knob {
        name: "terminals k",
        effect: "Terminals of each kind of vessels. Raise it, and the tree becomes finer.",
        field: Field::Count { of: |settings| &mut settings.terminals, usual: 10..=20_000, logarithmic: true },
    },
    Knob {
        name: "perfusion",
        effect: "Physical size of the tissue. Raise it, and vessels become thinner in relation to it.",
        field: Field::Number {
            of: |settings| &mut settings.perfusion,
            unit: Unit::SquareOrCubicMillimetres,
            usual: 100.0..=1e7,
            logarithmic: true,
        },
    },
    Knob {
        name: "exponent γ",
        effect: "Murray's exponent. Raise it, and parents become thinner relative to their children.",
        field: Field::Number {
            of: |settings| &mut settings.bifurcation_exponent,
            unit: Unit::None,
            usual: 2.0..=4.0,
            logarithmic: false,
        },
    },
    Knob {
        name: "spread of flows",
        effect: "Spread of the terminals' flows. Raise it, and terminals become more different.",
        field: Field::Number {
            of: |settings| &mut settings.flow_spread,
            unit: Unit::None,
            usual: 0.0..=0.9,
            logarithmic: false,
        },
    },
    Knob {
        name: "distance to border",
        effect: "Least distance between a vessel's wall and the border of the tissue.",
        field: Field::Number {
            of: |settings| &mut settings.border_distance,
            unit: Unit::Length,
            usual: 0.0..=0.1,
            logarithmic: false,
        },
    },
    Knob {
        name: "candidates N_con",
        effect: "Segments that a new terminal may join. Raise it, and more connections are compared.",
        field: Field::Count { of: |settings| &mut settings.candidates, usual: 1..=100, logarithmic: true },
    },
    Knob {
        name: "tolerance",
        effect: "Share of a segment's volume below which no better place for a bifurcation is searched for.",
        field: Field::Number {
            of: |settings| &mut settings.tolerance,
            unit: Unit::None,
            usual: 1e-8..=0.1,
            logarithmic: true,
        },
    },
    Knob {
        name: "polishing sweeps",
        effect: "Sweeps that move all bifurcations to their best place. 0: they stay where they were made.",
        field: Field::Count { of: |settings| &mut settings.polish_sweeps, usual: 0..=10, logarithmic: false },
    },
];

/// All settings with a row of their own.
#[cfg(test)]
pub(super) fn knobs() -> impl Iterator<Item = &'static Knob<CcoSettings>> {
    KNOBS.iter()
}

/// Shows all settings. `base` has the values to go back to; only the `kinds` that have roots have a flow.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut CcoSettings,
    base: &CcoSettings,
    rows: &mut Rows,
    kinds: impl Fn(VesselKind) -> bool,
) {
    Grid::new("cco").num_columns(2).show(ui, |ui| KNOBS.iter().for_each(|knob| rows.show(ui, knob, settings, base)));
    for kind in VesselKind::ALL.into_iter().filter(|&kind| kinds(kind)) {
        egui::CollapsingHeader::new(format!("Flow of the {}", kind.plural().to_lowercase()))
            .id_salt(kind.name())
            .show(ui, |ui| show_flow(ui, kind, &mut settings.flow[kind]));
    }
}

/// Shows what flows through the vessels of a kind, in the units of a clinic.
fn show_flow(ui: &mut Ui, kind: VesselKind, flow: &mut VesselFlow) {
    let (lowest, highest) = (0.0..=f64::MAX, 1e-9..=f64::MAX);
    Grid::new(("flow", kind.name())).num_columns(2).show(ui, |ui| {
        let mut rate = flow.rate.ml_per_min();
        row(ui, "flow Q", " ml/min", "Through all terminals together.", &mut rate, highest.clone());
        let mut viscosity = flow.viscosity.centipoise();
        row(ui, "viscosity µ", " mPa·s", "Of what flows.", &mut viscosity, highest);
        let mut root = flow.root_pressure.mmhg();
        row(ui, "pressure P_in", " mmHg", "At the root: the higher end of the loss.", &mut root, lowest.clone());
        let mut terminal = flow.terminal_pressure.mmhg();
        row(ui, "pressure P_out", " mmHg", "At every terminal.", &mut terminal, lowest);
        let changed = VesselFlow {
            rate: Flow::from_ml_per_min(rate),
            viscosity: Viscosity::from_centipoise(viscosity),
            root_pressure: Pressure::from_mmhg(root),
            terminal_pressure: Pressure::from_mmhg(terminal),
        };
        // Units that go there and back round.
        if !is_about(&changed, flow) {
            *flow = changed;
        }
    });
}

fn is_about(first: &VesselFlow, second: &VesselFlow) -> bool {
    let values = |flow: &VesselFlow| {
        let pressures = [flow.root_pressure.pascals(), flow.terminal_pressure.pascals()];
        [flow.rate.cubic_metres_per_second(), flow.viscosity.pascal_seconds(), pressures[0], pressures[1]]
    };
    values(first).iter().zip(values(second)).all(|(a, b)| (a - b).abs() <= 1e-12 * b.abs())
}

fn row(ui: &mut Ui, name: &str, unit: &str, effect: &str, value: &mut f64, range: std::ops::RangeInclusive<f64>) {
    ui.label(name).on_hover_text(effect);
    let speed = 0.005 * value.abs().max(1e-6);
    ui.add(DragValue::new(value).suffix(unit).speed(speed).range(range).max_decimals(4));
    ui.end_row();
}
