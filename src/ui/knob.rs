//! One setting in the panel: its name, a slider or a switch, and what it does.

use super::sketch::{Sketched, Sketches};
use bevy_egui::egui::{self, Slider, SliderClamping, Ui};
use std::ops::RangeInclusive;

/// A setting among the settings `S`.
pub(super) struct Knob<S: 'static> {
    /// Its name in the panel, with the paper's symbol.
    pub(super) name: &'static str,
    /// What it does, in one line.
    pub(super) effect: &'static str,
    pub(super) field: Field<S>,
}

/// The value of a setting.
pub(super) enum Field<S: 'static> {
    /// A number.
    Number {
        of: fn(&mut S) -> &mut f32,
        unit: Unit,
        /// Usual values: those of the slider. Others may be typed.
        usual: RangeInclusive<f32>,
        logarithmic: bool,
    },
    /// A number of things.
    Count { of: fn(&mut S) -> &mut u32, usual: RangeInclusive<u32>, logarithmic: bool },
    /// On or off.
    Switch { of: fn(&mut S) -> &mut bool },
}

/// The unit of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    None,
    Degrees,
    /// A length: a share of the organ's size if the settings are fitted to it, else in the lengths of its mesh.
    Length,
    SquareOrCubicMillimetres,
}

impl Unit {
    fn suffix(self, fitted: bool) -> &'static str {
        match self {
            Self::None | Self::SquareOrCubicMillimetres => "",
            Self::Degrees => "°",
            Self::Length if fitted => " d",
            Self::Length => "",
        }
    }

    fn text(self, fitted: bool) -> &'static str {
        match self {
            Self::None => "",
            Self::Degrees => "Degrees. ",
            Self::Length if fitted => "In diameters d of the organ. ",
            Self::Length => "In lengths of the organ's mesh. ",
            Self::SquareOrCubicMillimetres => "In mm² of a flat tissue, in mm³ of a solid one. ",
        }
    }
}

/// How knobs are shown.
pub(super) struct Rows<'a> {
    pub(super) sketches: &'a mut Sketches,
    /// Whether lengths are shares of the organ's size.
    pub(super) fitted: bool,
}

impl Rows<'_> {
    /// Shows a setting in a row of two columns. `usual` values are those of its default.
    pub(super) fn show<S: Sketched>(&mut self, ui: &mut Ui, knob: &Knob<S>, settings: &mut S, default: &S) {
        let label = ui.label(knob.name);
        ui.horizontal(|ui| {
            self.widget(ui, knob, settings);
            let is_default = knob.equals(settings, default);
            let reset = egui::Button::new("↺").frame(false);
            if ui.add_enabled(!is_default, reset).on_hover_text("Back to the preset's value").clicked() {
                knob.copy(default, settings);
            }
        });
        ui.end_row();
        label.on_hover_ui(|ui| {
            ui.set_max_width(320.0);
            ui.label(knob.effect);
            ui.weak(format!("{}Preset: {}.", knob.unit().text(self.fitted), knob.value(default, self.fitted)));
            self.sketches.show_low_and_high(ui, knob.name, knob.low_and_high(&S::default()));
        });
    }

    fn widget<S>(&self, ui: &mut Ui, knob: &Knob<S>, settings: &mut S) {
        match &knob.field {
            Field::Number { of, unit, usual, logarithmic } => {
                let value = of(settings);
                let slider = Slider::new(value, usual.clone())
                    .clamping(SliderClamping::Never)
                    .logarithmic(*logarithmic)
                    .smallest_positive(1e-6)
                    .max_decimals(5)
                    .suffix(unit.suffix(self.fitted));
                ui.add(slider);
            }
            Field::Count { of, usual, logarithmic } => {
                let value = of(settings);
                ui.add(Slider::new(value, usual.clone()).clamping(SliderClamping::Never).logarithmic(*logarithmic));
            }
            Field::Switch { of } => {
                ui.checkbox(of(settings), "");
            }
        }
    }
}

impl<S: Clone> Knob<S> {
    fn unit(&self) -> Unit {
        match self.field {
            Field::Number { unit, .. } => unit,
            _ => Unit::None,
        }
    }

    /// Whether the setting is the same in both.
    pub(super) fn equals(&self, first: &S, second: &S) -> bool {
        let (mut first, mut second) = (first.clone(), second.clone());
        match self.field {
            Field::Number { of, .. } => of(&mut first) == of(&mut second),
            Field::Count { of, .. } => of(&mut first) == of(&mut second),
            Field::Switch { of } => of(&mut first) == of(&mut second),
        }
    }

    /// Takes the setting over.
    pub(super) fn copy(&self, from: &S, to: &mut S) {
        let mut from = from.clone();
        match self.field {
            Field::Number { of, .. } => *of(to) = *of(&mut from),
            Field::Count { of, .. } => *of(to) = *of(&mut from),
            Field::Switch { of } => *of(to) = *of(&mut from),
        }
    }

    fn value(&self, settings: &S, fitted: bool) -> String {
        let mut settings = settings.clone();
        match self.field {
            Field::Number { of, unit, .. } => format!("{}{}", of(&mut settings), unit.suffix(fitted)),
            Field::Count { of, .. } => of(&mut settings).to_string(),
            Field::Switch { of } => (if *of(&mut settings) { "on" } else { "off" }).to_owned(),
        }
    }

    /// The settings with this one low and high.
    pub(super) fn low_and_high(&self, settings: &S) -> [(String, S); 2] {
        [false, true].map(|high| {
            let mut settings = settings.clone();
            let end = |range: (f32, f32)| if high { range.1 } else { range.0 };
            match &self.field {
                Field::Number { of, usual, .. } => *of(&mut settings) = end((*usual.start(), *usual.end())),
                Field::Count { of, usual, .. } => *of(&mut settings) = if high { *usual.end() } else { *usual.start() },
                Field::Switch { of } => *of(&mut settings) = high,
            }
            (self.value(&settings, true), settings)
        })
    }
}
