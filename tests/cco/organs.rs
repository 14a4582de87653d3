//! Trees in real organs, as far as they are there.

use crate::{
    oracle::{check_inside, check_tree},
    shared,
};
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings},
    generator::Generator,
    io::load_mesh,
    preset::PresetName,
    roots::{RootPlacement, RootPlacements},
    tissue::{Extent, MeshVolume, Tissue},
    tree::VesselKind,
};
use std::sync::Arc;

fn organ(name: &str) -> Option<Arc<dyn Tissue>> {
    let path = shared::folder(&format!("data/organs/{name}.glb"))?;
    let mesh = load_mesh(&path).unwrap_or_else(|error| panic!("{error}"));
    Some(Arc::new(MeshVolume::new(&mesh, MeshVolume::DEFAULT_RESOLUTION).expect("a closed organ")))
}

#[test]
fn organs_have_sound_arteries() {
    for name in ["liver_vhf", "kidney_left_vhf", "colon_vhf", "heart_vhf"] {
        let Some(tissue) = organ(name) else { continue };
        let Extent::Volume(volume) = tissue.extent() else { panic!("{name} has no volume") };
        // The organs are in metres.
        let settings = CcoSettings { terminals: 2000, perfusion: volume * 1e9, ..CcoSettings::default() };
        let artery = RootPlacement::Spread(1);
        let roots = RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() };
        let mut growth = Cco::new(Arc::clone(&tissue), settings, &roots.into(), 1).expect("a growth");
        growth.run().unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(growth.overlaps(), 0, "{name}");
        check_tree(name, &growth, VesselKind::Artery);
        check_inside(name, &growth);
    }
}

#[test]
fn a_liver_has_four_trees_that_avoid_each_other() {
    let Some(tissue) = organ("liver_vhf") else { return };
    let preset = PresetName::CcoLiver.load();
    let Generator::Cco(settings) = preset.generator_for(tissue.extent()) else { panic!("another generator") };
    let settings = CcoSettings { terminals: 2000, ..settings };
    let mut growth = Cco::new(tissue, settings, &preset.roots(), 1).expect("a growth");
    growth.run().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(growth.overlaps(), 0);
    check_inside("liver", &growth);
    for kind in VesselKind::ALL {
        assert_eq!(growth.tree(kind).tips().len(), 2000);
        check_tree("liver", &growth, kind);
    }
}

#[test]
fn organs_as_they_were_found_give_sound_trees_or_say_what_is_wrong() {
    let Some(folder) = shared::folder("data/organs/awkward") else { return };
    let mut files: Vec<_> = folder.read_dir().expect("a folder").map(|file| file.expect("a file").path()).collect();
    files.sort();
    for path in files.iter().filter(|path| path.extension().is_some_and(|ending| ending == "glb")) {
        let name = path.display().to_string();
        let tissue = load_mesh(path)
            .map_err(|error| error.to_string())
            .and_then(|mesh| MeshVolume::new(&mesh, 40).map_err(|error| error.to_string()));
        let tissue: Arc<dyn Tissue> = match tissue {
            Ok(tissue) => Arc::new(tissue),
            Err(error) => {
                println!("{name}: {error}");
                continue;
            }
        };
        let Extent::Volume(volume) = tissue.extent() else { panic!("{name} has no volume") };
        let settings = CcoSettings { terminals: 300, perfusion: volume * 1e9, ..CcoSettings::default() };
        let artery = RootPlacement::Spread(1);
        let roots = RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() };
        match Cco::new(tissue, settings, &roots.into(), 1) {
            Ok(mut growth) => {
                println!("{name}: {:?}", growth.run());
                assert_eq!(growth.overlaps(), 0, "{name}");
                check_inside(&name, &growth);
            }
            Err(error) => println!("{name}: {error}"),
        }
    }
}
