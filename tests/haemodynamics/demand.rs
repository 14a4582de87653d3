//! The bed of an organ that takes the flow measured of it.

use super::trees::{resisting, settings, tube};
#[cfg(feature = "mesh_files")]
use crate::shared;
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::Colonization,
    haemodynamics::{Circulation, FlowError, FlowSettings, Network},
    preset::{Preset, PresetName},
    tissue::{Ball, Disc, Extent, Tissue, TissueMode, TissueSource},
    tree::VesselKind,
    units::{Flow, Scale},
};
#[cfg(feature = "mesh_files")]
use bevy_vessels::synthesis::{io::load_mesh, tissue::SourceData};
use std::{ops::Range, sync::Arc};

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

/// A preset with blood, the real organ that it is for, and what is published of that.
struct Organ {
    preset: PresetName,
    file: &'static str,
    /// Flow into its arteries, in mL/min.
    flow: Range<f64>,
    /// Wall shear of its arteries, in Pa.
    shear: Range<f64>,
}

/// Wall shear of arterioles.
const ARTERIOLES: Range<f64> = 1.0..5.0;

fn organs() -> [Organ; 5] {
    let organ = |preset, file, flow, shear| Organ { preset, file, flow, shear };
    [
        // From 4 % of a cardiac output of 5.9 L/min to what the superior mesenteric artery brings to a fed gut.
        organ(PresetName::Colon, "colon_vhf", 236.0..706.0, ARTERIOLES),
        organ(PresetName::Retina, "eyeball_mh", 0.044..0.080, ARTERIOLES),
        // Half of 17 % of 5.9 L/min in women, and of 19 % of 6.5 L/min in men (Williams & Leggett 1989).
        organ(PresetName::Kidney, "kidney_left_vhf", 501.0..618.0, ARTERIOLES),
        // 3.5 mL/min per kg, with a deviation of 45 % (Carlisle et al. 1992), for 70 to 80 kg.
        organ(PresetName::Liver, "liver_vhf", 135.0..406.0, ARTERIOLES),
        // At most 462 pL/s in each of its vessels, and what these bear (Koutsiaris et al. 2007).
        organ(PresetName::Conjunctiva, "eyeball_mh", 0.0..0.012, 0.28..9.55),
    ]
}

fn grown(preset: &Preset, tissue: &Arc<dyn Tissue>) -> Result<Colonization, Box<dyn std::error::Error>> {
    let generator = preset.generator_for(tissue.extent());
    let settings = generator.colonization().ok_or("presets colonize")?.clone();
    let mut growth = Colonization::new(Arc::clone(tissue), settings, &preset.roots(), 1)?;
    growth.run();
    Ok(growth)
}

/// With the blood that its preset names, an organ takes the published flow, in a single tree and joined with its veins.
#[test]
fn organs_of_presets_take_the_published_flow() -> Outcome {
    for Organ { preset: name, flow: range, .. } in organs() {
        let preset = name.load();
        let blood = preset.blood.ok_or("the preset names its blood")?;
        // In a unit of its own, which the scale makes good.
        let solid = matches!(&preset.tissue, TissueSource::Mesh(mesh) if mesh.mode == TissueMode::Volume);
        let tissue: Arc<dyn Tissue> =
            if solid { Arc::new(Ball::new(Vec3::ZERO, 70.0)?) } else { Arc::new(Disc::flat(70.0)?) };
        let growth = grown(&preset, &tissue)?;
        let scale = blood.scale(tissue.extent())?;
        assert!((scale.to_metres(140.0) / blood.diameter - 1.0).abs() < 1e-5);
        let whole = blood.flow_into(tissue.extent(), scale).ml_per_min();
        assert!((whole / blood.flow.ml_per_min() - 1.0).abs() < 1e-5, "{name}: {whole} mL/min at its own size");
        let [arteries, veins] = [VesselKind::Artery, VesselKind::Vein].map(|kind| growth.tree(kind));
        let bed = resisting(1e3).bed;
        let mut alone = Network::new(arteries, FlowSettings { scale, ..FlowSettings::arterial() })?;
        alone.fit_bed(blood.flow).map_err(|error| format!("{name}: {error}"))?;
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

/// On the real organs, the flow that the preset names is in the published range, and so is the wall shear of most
/// arteries at this flow, which nothing was fitted to.
#[cfg(feature = "mesh_files")]
#[test]
fn real_organs_bear_the_published_shear() -> Outcome {
    for Organ { preset: name, file, flow, shear } in organs() {
        let Some(folder) = shared::folder("data/organs") else { return Ok(()) };
        let mesh = Arc::new(load_mesh(&folder.join(file).with_extension("glb"))?);
        let preset = name.load();
        let prepared = preset.tissue.prepare(&SourceData { mesh: Some(mesh), ..SourceData::default() })?;
        let growth = grown(&preset, prepared.tissue())?;
        let blood = preset.blood.ok_or("the preset names its blood")?;
        let scale = blood.scale(prepared.tissue().extent())?;
        let settings = FlowSettings { scale, ..FlowSettings::arterial() };
        let mut network = Network::new(growth.tree(VesselKind::Artery), settings)?;
        network.fit_bed(blood.flow).map_err(|error| format!("{file}: {error}"))?;
        let inflow = network.inflow().ml_per_min();
        assert!(flow.contains(&inflow), "{file}: {inflow} mL/min");
        let mut stresses: Vec<f64> = network.wall_shear_stresses().filter(|&stress| stress > 0.0).collect();
        stresses.sort_by(f64::total_cmp);
        let [median, most] = [0.5, 0.99].map(|share| stresses[(stresses.len() as f64 * share) as usize]);
        println!("{file}, {name}: {inflow} mL/min, {median} Pa, 1 % of the vessels above {most} Pa");
        assert!(shear.contains(&median), "{file}: the median wall shear is {median} Pa");
        assert!(most < 20.0, "{file}: 1 % of the vessels bear more than {most} Pa");
    }
    Ok(())
}

/// Twice as long, an organ weighs eight times as much, and its wall four times.
#[test]
fn flow_goes_with_mass() -> Outcome {
    let scale = Scale::CENTIMETRES;
    for (name, small, large, factor) in [
        (PresetName::Kidney, Extent::Volume(10.0), Extent::Volume(80.0), 8.0),
        (PresetName::Colon, Extent::Area(10.0), Extent::Area(40.0), 4.0),
    ] {
        let blood = name.load().blood.ok_or("the preset names its blood")?;
        let [one, other] = [small, large].map(|extent| blood.flow_into(extent, scale).ml_per_min());
        assert!((other / one / factor - 1.0).abs() < 1e-5, "{name}: {one} and {other} mL/min");
    }
    Ok(())
}
