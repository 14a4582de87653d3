//! Organs of all presets, wounded at random, whose patient bleeds in any circumstances: the solver sees it through.

use super::trees::rng;
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::Colonization,
    haemodynamics::{
        BedSettings, Bleeding, BleedingSettings, BloodVolume, BloodVolumeSettings, Circulation, Clotting, FlowSettings,
        Interruption, Network, Pulse, RootPressure,
    },
    preset::{Preset, PresetName},
    tissue::{Ball, Disc, Tissue, TissueMode, TissueSource},
    tree::{NO_PARENT, NodeId, VesselKind, VesselTree},
    units::{Pressure, Resistance, Scale, Volume},
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// A preset on a flat tissue, or in a ball, in fewer steps than its own.
fn grown(preset: &Preset) -> Result<Option<Colonization>, Box<dyn std::error::Error>> {
    let solid = matches!(&preset.tissue, TissueSource::Mesh(mesh) if mesh.mode == TissueMode::Volume);
    let tissue: Arc<dyn Tissue> =
        if solid { Arc::new(Ball::new(Vec3::ZERO, 0.05)?) } else { Arc::new(Disc::flat(0.05)?) };
    let generator = preset.generator_for(tissue.extent());
    let Some(mut settings) = generator.colonization().cloned() else { return Ok(None) };
    (settings.steps, settings.samples) = (settings.steps.min(60), settings.samples.min(300));
    let mut growth = Colonization::new(tissue, settings, &preset.roots(), 1)?;
    growth.run();
    Ok(Some(growth))
}

/// Cuts and clamps, half of them in trunks.
fn wound(rng: &mut ChaCha8Rng, network: &mut Network, tree: &VesselTree) -> Outcome {
    for _ in 0..[1, 4, 30][rng.random_range(0..3)] {
        let last = if rng.random_bool(0.5) { tree.len().min(60) } else { tree.len() };
        let node = rng.random_range(0..last);
        if tree.parents()[node] != NO_PARENT {
            let along = rng.random_range(0.0..1.0);
            let is_clamp = rng.random_bool(0.2);
            let gap = if is_clamp { Interruption::clamp(along) } else { Interruption::cut(along, tree.radii()[node]) };
            network.set_interruption(NodeId(node as u32), Some(gap))?;
        }
    }
    Ok(())
}

/// Arteries and veins with a bed, a pressure around and a scale of any kind, right or wrong.
fn circulation(rng: &mut ChaCha8Rng, growth: &Colonization) -> Result<Circulation, Box<dyn std::error::Error>> {
    let scale = [Scale::METRES, Scale::CENTIMETRES, Scale::MILLIMETRES, Scale::MICROMETRES][rng.random_range(0..4)];
    let ambient = Pressure::from_mmhg(if rng.random_bool(0.3) { -100.0 } else { 0.0 });
    let resistance = Resistance::from_mmhg_min_per_ml(10.0_f64.powf(rng.random_range(-3.0..5.0)));
    let bed = BedSettings { resistance: Some(resistance), ..BedSettings::default() };
    let pulse = FlowSettings { root: RootPressure::Pulsatile(Pulse::default()), ..FlowSettings::arterial() };
    let arterial = if rng.random_bool(0.3) { pulse } else { FlowSettings::arterial() };
    let network = |kind, settings: FlowSettings| {
        Network::new(growth.tree(kind), FlowSettings { scale, ambient, bed, ..settings })
    };
    let [mut arteries, mut veins] =
        [network(VesselKind::Artery, arterial)?, network(VesselKind::Vein, FlowSettings::venous())?];
    wound(rng, &mut arteries, growth.tree(VesselKind::Artery))?;
    wound(rng, &mut veins, growth.tree(VesselKind::Vein))?;
    Ok(Circulation::new(arteries, veins, growth.bed_links())?)
}

#[test]
fn wounded_organs_bleed_to_the_end_and_lose_no_more_than_there_is() -> Outcome {
    let mut pairs = 0;
    for name in PresetName::ALL {
        // The reference cases have their roots at places of their own.
        if name.name().starts_with("reference") {
            continue;
        }
        let Some(growth) = grown(&name.load())? else { continue };
        for seed in 0..6 {
            let mut rng = rng(seed);
            let mut joined = circulation(&mut rng, &growth)?;
            joined.solve().map_err(|error| format!("{name}, seed {seed}: {error}"))?;
            let ends = joined.arterial().open_ends().iter().chain(joined.venous().open_ends());
            let rate: f64 = ends.map(|end| end.flow().cubic_metres_per_second()).sum();
            // A patient's blood, or so little that it is gone after a hundredth of a second to a hundred.
            let little = (rate * 10.0_f64.powi(rng.random_range(-2..3))).max(1e-12);
            let total = if seed % 2 == 0 { 4.9e-3 } else { little };
            let total = BloodVolumeSettings { total: Volume::from_cubic_metres(total), ..Default::default() };
            let mut blood = BloodVolume::new(total)?;
            let clotting = rng.random_bool(0.3).then(Clotting::default);
            let settings = BleedingSettings { clotting, longest_step: 2.0 };
            let [mut arteries, mut veins] = [Bleeding::new(settings)?, Bleeding::new(settings)?];
            for (step, seconds) in [0.02, 0.5, 2.0, 2.0, 2.0].into_iter().enumerate() {
                Bleeding::step_joined([&mut arteries, &mut veins], &mut joined, seconds, &mut blood)
                    .map_err(|error| format!("{name}, seed {seed}, step {step}, {}: {error}", blood.lost_share()))?;
                let lost = arteries.lost().cubic_metres() + veins.lost().cubic_metres();
                assert!(
                    lost >= 0.0 && lost <= total.total.cubic_metres() * (1.0 + 1e-9),
                    "{name}, seed {seed}: {lost}"
                );
            }
            pairs += 1;
        }
    }
    assert!(pairs >= 50, "only {pairs} pairs");
    Ok(())
}
