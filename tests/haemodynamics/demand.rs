//! The bed of an organ that takes the flow measured of it.

use super::trees::{resisting, settings, tube};
use bevy_vessels::synthesis::{
    colonization::Colonization,
    haemodynamics::{Circulation, FlowError, FlowSettings, Network},
    preset::PresetName,
    tissue::{Disc, Extent, Tissue},
    tree::VesselKind,
    units::Flow,
};
use std::sync::Arc;

type Outcome = Result<(), Box<dyn std::error::Error>>;

#[test]
fn the_bed_behind_a_tube_has_the_rest_of_the_resistance() -> Outcome {
    let mut network = Network::new(&tube(5, 40.0, 0.5), settings())?;
    network.solve()?;
    let (free, drop) = (network.inflow().cubic_metres_per_second(), 80.0 * 133.322_387_415);
    for share in [0.9, 0.5, 1e-3, 1e-6] {
        let flow = Flow::from_cubic_metres_per_second(share * free);
        let bed = network.fit_bed(flow)?.pascal_seconds_per_cubic_metre();
        let expected = drop / (share * free) - drop / free;
        assert!((bed / expected - 1.0).abs() < 1e-6, "{bed} instead of {expected}");
        assert!((network.inflow().cubic_metres_per_second() / (share * free) - 1.0).abs() < 1e-8);
    }
    Ok(())
}

#[test]
fn a_flow_that_vessels_do_not_let_through_is_refused_and_changes_nothing() -> Outcome {
    let mut network = Network::new(&tube(5, 40.0, 0.5), resisting(2.0))?;
    network.solve()?;
    let before = (network.settings().bed, network.inflow());
    let error = network.fit_bed(Flow::from_ml_per_min(1e9));
    assert!(matches!(error, Err(FlowError::OutOfReach { .. })), "{error:?}");
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(network.fit_bed(Flow::from_ml_per_min(bad)).is_err());
    }
    assert_eq!((network.settings().bed, network.inflow()), before);
    Ok(())
}

/// With the blood that its preset names, an organ takes the published flow, in a single tree and joined with its veins.
#[test]
fn organs_of_presets_take_the_published_flow() -> Outcome {
    // mL/min: up to what the superior mesenteric artery brings to fasted to fed guts, and the retina's.
    for (name, range) in [(PresetName::Colon, 0.0..706.0), (PresetName::Retina, 0.044..0.080)] {
        let preset = name.load();
        let blood = preset.blood.ok_or("the preset names its blood")?;
        // In a unit of its own, which the scale makes good.
        let tissue: Arc<dyn Tissue> = Arc::new(Disc::flat(70.0)?);
        let generator = preset.generator_for(tissue.extent());
        let growth_settings = generator.colonization().ok_or("presets colonize")?.clone();
        let mut growth = Colonization::new(Arc::clone(&tissue), growth_settings, &preset.roots(), 1)?;
        growth.run();
        let scale = blood.scale(tissue.extent())?;
        assert!((scale.to_metres(140.0) / blood.diameter - 1.0).abs() < 1e-5);
        let [arteries, veins] = [VesselKind::Artery, VesselKind::Vein].map(|kind| growth.tree(kind));
        let bed = resisting(1e3).bed;
        let mut alone = Network::new(arteries, FlowSettings { scale, ..FlowSettings::arterial() })?;
        alone.fit_bed(blood.flow).map_err(|error| format!("{name}: {error}"))?;
        let shear = alone.wall_shear_stresses().fold(0.0, f64::max);
        println!("{name}: largest wall shear {shear} Pa");
        let arterial = Network::new(arteries, FlowSettings { scale, bed, ..FlowSettings::arterial() })?;
        let venous = Network::new(veins, FlowSettings { scale, bed, ..FlowSettings::venous() })?;
        let mut joined = Circulation::new(arterial, venous, growth.bed_links())?;
        let bed = joined.fit_bed(blood.flow).map_err(|error| format!("{name}: {error}"))?;
        println!("{name}: {} mmHg·min/mL, {} passes", bed.mmhg_min_per_ml(), joined.passes());
        for inflow in [alone.inflow(), joined.arterial().inflow()] {
            assert!(range.contains(&inflow.ml_per_min()), "{name}: {} mL/min", inflow.ml_per_min());
            assert!((inflow.ml_per_min() / blood.flow.ml_per_min() - 1.0).abs() < 1e-6);
        }
    }
    let without_size = PresetName::Retina.load().blood.ok_or("blood")?.scale(Extent::Area(0.0));
    assert!(without_size.is_err(), "{without_size:?}");
    Ok(())
}
