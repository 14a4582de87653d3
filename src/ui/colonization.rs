//! The settings of space colonization, in the groups of the paper's section 3.

use super::{
    knob::{Field, Knob, Rows, Unit},
    widgets::choose_variant,
};
use crate::synthesis::{
    colonization::{AngleSpread, ColonizationSettings, SettingsWarning, SystemSettings},
    tissue::TissueGrowth,
    tree::VesselKind,
};
use bevy_egui::egui::{self, Color32, Grid, Ui};

/// A group of settings of one system.
struct Group {
    title: &'static str,
    knobs: &'static [Knob<SystemSettings>],
}

macro_rules! number {
    ($name:literal, $field:ident, $unit:ident, $usual:expr, $logarithmic:literal, $effect:literal) => {
        Knob {
            name: $name,
            effect: $effect,
            field: Field::Number {
                of: |settings| &mut settings.$field,
                unit: Unit::$unit,
                usual: $usual,
                logarithmic: $logarithmic,
            },
        }
    };
}

static GROUPS: [Group; 4] = [
    Group {
        title: "Demand",
        knobs: &[
            number!(
                "drain distance",
                drain_birth_distance,
                Length,
                0.01..=0.12,
                true,
                "Least distance between drains. Raise it, and the tree becomes coarser."
            ),
            number!(
                "distance to vessels",
                node_birth_distance,
                Length,
                0.01..=0.12,
                true,
                "Least distance of a new drain from a vessel. Raise it, and more room stays between vessels."
            ),
            number!(
                "kill distance",
                kill_distance,
                Length,
                0.005..=0.1,
                true,
                "Distance at which a drain is supplied. Raise it, and terminals stay further from what they supply."
            ),
        ],
    },
    Group {
        title: "Perception",
        knobs: &[
            number!(
                "influence δ",
                influence_distance,
                Length,
                0.02..=0.4,
                true,
                "Reach of a drain. Raise it, and vessels feel drains from afar."
            ),
            number!(
                "angle γ",
                perception_angle,
                Degrees,
                10.0..=180.0,
                false,
                "Opening angle in which a tip perceives drains. Raise it, and vessels bend more sharply."
            ),
        ],
    },
    Group {
        title: "Growth",
        knobs: &[
            number!(
                "direction weight ω",
                direction_weight,
                None,
                0.0..=0.95,
                false,
                "Weight of the present direction. Raise it, and vessels become straighter."
            ),
            number!(
                "step d",
                step_length,
                Length,
                0.005..=0.06,
                true,
                "Length of a new segment. Raise it, and there are fewer, longer segments."
            ),
            Knob {
                name: "lateral sprouts",
                effect: "Whether vessels sprout sideways between two nodes, and not only at tips.",
                field: Field::Switch { of: |settings| &mut settings.lateral_sprouts },
            },
            Knob {
                name: "vessels at a root",
                effect: "Most vessels that leave a root. Raise it, and the first vessels share the load.",
                field: Field::Count { of: |settings| &mut settings.root_children, usual: 1..=8, logarithmic: false },
            },
        ],
    },
    Group {
        title: "Bifurcations and radii",
        knobs: &[
            number!(
                "threshold φ",
                bifurcation_threshold,
                Degrees,
                0.0..=60.0,
                false,
                "Spread of its drains at which a tip splits in two. Raise it for more lateral, fewer symmetric branches."
            ),
            number!(
                "exponent κ",
                bifurcation_exponent,
                None,
                2.05..=3.95,
                false,
                "Murray's exponent. Raise it, and bifurcations become wider, parents thinner."
            ),
            number!(
                "tip radius",
                terminal_radius,
                Length,
                0.0001..=0.004,
                true,
                "Radius of a tip, from which all others follow. Raise it, and the whole tree becomes thicker."
            ),
            Knob {
                name: "tips shrink",
                effect: "Whether tips become finer as the tissue grows, as all other lengths do.",
                field: Field::Switch { of: |settings| &mut settings.scale_terminal_radius },
            },
        ],
    },
];

static COMMON: [Knob<ColonizationSettings>; 5] = [
    Knob {
        name: "steps",
        effect: "Growth steps. Raise it, and the tissue is filled further.",
        field: Field::Count { of: |settings| &mut settings.steps, usual: 1..=400, logarithmic: false },
    },
    Knob {
        name: "samples",
        effect: "Candidates for drains in a step. Raise it, and the tissue is filled faster.",
        field: Field::Count { of: |settings| &mut settings.samples, usual: 50..=20_000, logarithmic: true },
    },
    Knob {
        name: "idle steps",
        effect: "Steps without a drain or a segment that end the growth early. 0: never.",
        field: Field::Count { of: |settings| &mut settings.idle_steps, usual: 0..=100, logarithmic: false },
    },
    Knob {
        name: "keep to the tissue",
        effect: "Whether vessels keep to the tissue, and follow the bends of a surface.",
        field: Field::Switch { of: |settings| &mut settings.confine },
    },
    Knob {
        name: "lie on the surface",
        effect: "Whether vessels are lifted off a surface by their radius, instead of half in it.",
        field: Field::Switch { of: |settings| &mut settings.stand_off },
    },
];

/// All settings of one system with a row of their own.
#[cfg(test)]
pub(super) fn system_knobs() -> impl Iterator<Item = &'static Knob<SystemSettings>> {
    GROUPS.iter().flat_map(|group| group.knobs)
}

/// Shows all settings. `base` has the values to go back to. While the systems are `linked`, a change of the arteries
/// changes the veins alike.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut ColonizationSettings,
    base: &ColonizationSettings,
    rows: &mut Rows,
    linked: &mut bool,
) {
    let warnings = settings.validate().unwrap_or_default();
    grid(ui, "common", |ui| COMMON.iter().for_each(|knob| rows.show(ui, knob, settings, base)));
    show_system(ui, VesselKind::Artery, settings, base, rows, &warnings, linked);
    ui.checkbox(linked, "veins follow the arteries").on_hover_text("A change of the arteries changes the veins alike.");
    show_system(ui, VesselKind::Vein, settings, base, rows, &warnings, &mut false);
}

/// Shows the settings of arteries or veins, with the warnings about them.
fn show_system(
    ui: &mut Ui,
    kind: VesselKind,
    settings: &mut ColonizationSettings,
    base: &ColonizationSettings,
    rows: &mut Rows,
    warnings: &[SettingsWarning],
    linked: &mut bool,
) {
    let own = warnings.iter().filter(|warning| warning.system() == kind);
    let heading = heading(kind.plural(), own.clone().count());
    egui::CollapsingHeader::new(heading).id_salt(kind.name()).default_open(kind == VesselKind::Artery).show(ui, |ui| {
        let before = settings.system(kind).cloned().unwrap_or_default();
        let base = base.system(kind).cloned().unwrap_or_default();
        let mut after = before.clone();
        for group in &GROUPS {
            ui.strong(group.title);
            grid(ui, group.title, |ui| group.knobs.iter().for_each(|knob| rows.show(ui, knob, &mut after, &base)));
        }
        spread_row(ui, &mut after);
        growth_row(ui, &mut after);
        own.for_each(|warning| warning_row(ui, warning, &mut after));
        if after == before {
            return;
        }
        if *linked {
            follow(&before, &after, &mut settings.venous);
        }
        match kind {
            VesselKind::Artery => settings.arterial = after,
            _ => settings.venous = after,
        }
    });
}

/// The heading of a group, with the number of its warnings.
fn heading(title: &str, warnings: usize) -> String {
    if warnings == 0 { title.to_owned() } else { format!("{title}  ⚠ {warnings}") }
}

/// Changes the venous settings as the arterial ones have changed: lengths by the same factor, all else to the same value.
fn follow(before: &SystemSettings, after: &SystemSettings, venous: &mut SystemSettings) {
    for knob in GROUPS.iter().flat_map(|group| group.knobs).filter(|knob| !knob.equals(before, after)) {
        match knob.field {
            Field::Number { of, unit: Unit::Length, .. } => {
                let factor = *of(&mut after.clone()) / *of(&mut before.clone());
                if factor.is_finite() && factor > 0.0 {
                    *of(venous) *= factor;
                } else {
                    knob.copy(after, venous);
                }
            }
            _ => knob.copy(after, venous),
        }
    }
    if before.angle_spread != after.angle_spread {
        venous.angle_spread = after.angle_spread;
    }
    if before.tissue_growth != after.tissue_growth {
        venous.tissue_growth = after.tissue_growth.clone();
    }
}

fn grid(ui: &mut Ui, name: &str, rows: impl FnOnce(&mut Ui)) {
    Grid::new(name).num_columns(2).show(ui, rows);
}

fn spread_row(ui: &mut Ui, system: &mut SystemSettings) {
    ui.horizontal(|ui| {
        ui.label("spread measured by");
        ui.selectable_value(&mut system.angle_spread, AngleSpread::StandardDeviation, "deviation")
            .on_hover_text("The standard deviation of the angles, as in the paper's text.");
        ui.selectable_value(&mut system.angle_spread, AngleSpread::RootSumOfSquares, "sum")
            .on_hover_text("The root of the summed squares, as in the paper's own program: more tips split.");
    });
}

/// The law of tissue growth. Its table, if it has one, stays as it is.
fn growth_row(ui: &mut Ui, system: &mut SystemSettings) {
    let law = &mut system.tissue_growth;
    ui.horizontal(|ui| {
        ui.label("tissue growth").on_hover_text("How the organ grows during the steps. Later vessels become finer.");
        let rate = match law {
            TissueGrowth::Linear(rate) | TissueGrowth::Exponential(rate) => *rate,
            _ => TissueGrowth::DEFAULT_LINEAR,
        };
        let choices = [
            ("none", TissueGrowth::None),
            ("linear", TissueGrowth::Linear(rate)),
            ("exponential", TissueGrowth::Exponential(rate)),
        ];
        choose_variant(ui, law, choices);
        if let TissueGrowth::Linear(rate) | TissueGrowth::Exponential(rate) = law {
            ui.add(egui::DragValue::new(rate).speed(0.0005).range(0.0..=0.2).max_decimals(4)).on_hover_text("a step");
        }
    });
}

/// A warning beside the settings that cause it, and a button that mends them.
fn warning_row(ui: &mut Ui, warning: &SettingsWarning, system: &mut SystemSettings) {
    ui.horizontal_wrapped(|ui| {
        ui.colored_label(Color32::from_rgb(230, 170, 60), format!("⚠ {warning}"));
        if ui.small_button("mend").clicked() {
            warning.mend(system);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linked_veins_keep_their_own_reach() {
        let mut settings = ColonizationSettings::default();
        let before = settings.arterial.clone();
        let mut after = before.clone();
        after.influence_distance *= 2.0;
        after.direction_weight = 0.8;
        let own = settings.venous.clone();
        follow(&before, &after, &mut settings.venous);
        assert_eq!(settings.venous.influence_distance, 2.0 * own.influence_distance);
        assert_eq!(settings.venous.direction_weight, 0.8);
        let rest = SystemSettings {
            influence_distance: own.influence_distance,
            direction_weight: own.direction_weight,
            ..settings.venous
        };
        assert_eq!(rest, own, "nothing else follows");
    }

    #[test]
    fn knobs_start_within_their_usual_values() {
        for knob in system_knobs() {
            if let Field::Number { of, usual, .. } = &knob.field {
                let value = *of(&mut SystemSettings::default());
                assert!(usual.contains(&value), "{}: {value}", knob.name);
            }
        }
    }
}
