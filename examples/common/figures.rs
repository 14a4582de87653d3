//! Figures of the circulation, read from the organs and shown over the picture.

use bevy::{ecs::system::SystemParam, prelude::*};
use bevy_vessels::plugin::{BloodLoss, OpenEnd, OrganSupply, Patient, Perfusion, VesselSystems};

/// The sources of the figures.
#[derive(SystemParam)]
pub struct Figures<'w, 's> {
    organs: Query<'w, 's, (&'static Perfusion, &'static BloodLoss, &'static OrganSupply, Option<&'static Patient>)>,
    ends: Query<'w, 's, &'static OpenEnd>,
}

/// The figures at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Ends whose lumen is open, bleeding or not.
    pub open_ends: usize,
    /// Loss of all ends, in mL/min.
    pub rate: f64,
    /// Total loss, in mL.
    pub loss: f64,
    /// Share of the tissue that lacks blood.
    pub ischaemic_share: f32,
    /// Mean pressure at the arteries' roots, in mmHg.
    pub root_pressure: f64,
}

impl Figures<'_, '_> {
    /// The present figures, summed over the organs; for shares and pressures, the worst.
    pub fn read(&self) -> Reading {
        let mut reading = Reading { open_ends: self.ends.iter().count(), root_pressure: f64::INFINITY, ..default() };
        for (perfusion, loss, supply, patient) in &self.organs {
            let share = patient.map_or(1.0, |patient| patient.blood().pressure_share());
            reading.rate += loss.rate.ml_per_min();
            reading.loss += loss.total.ml();
            reading.ischaemic_share = reading.ischaemic_share.max(supply.ischaemic_share);
            reading.root_pressure = reading.root_pressure.min(share * perfusion.arterial_pressure.mean().mmhg());
        }
        reading
    }
}

/// Shows the figures, in windows and on pictures.
pub struct FiguresPlugin;

impl Plugin for FiguresPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn_text).add_systems(Update, show.after(VesselSystems::Publish));
    }
}

#[derive(Component)]
struct FiguresText;

fn spawn_text(mut commands: Commands) {
    let font = TextFont { font_size: FontSize::Px(15.0), ..default() };
    let node = Node { position_type: PositionType::Absolute, right: px(14), top: px(12), ..default() };
    commands.spawn((Text::default(), font, TextColor(Color::srgba(1.0, 1.0, 1.0, 0.85)), node, FiguresText));
}

fn show(figures: Figures, mut text: Single<&mut Text, With<FiguresText>>) {
    let Reading { open_ends, rate, loss, ischaemic_share, root_pressure } = figures.read();
    let now = if root_pressure.is_finite() {
        format!(
            "open ends {open_ends}\nbleeding {rate:.1} mL/min\nlost {loss:.1} mL\nischaemic {:.1} %\nroot {root_pressure:.0} mmHg",
            100.0 * ischaemic_share
        )
    } else {
        String::new()
    };
    if text.0 != now {
        text.0 = now;
    }
}
