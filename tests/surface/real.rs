//! Real vessels.

use crate::measures::{sound_surface, widened};
use crate::shared;
use bevy_vessels::synthesis::{
    io::{SwcReadOptions, load_swc},
    surface::SurfaceSettings,
};
use std::fs;

/// The organs' arteries and veins have room; the others are planar, or have radii wider than their segments are long.
const WITHOUT_FAULT: [&str; 6] = [
    "colon_arteries_vhf",
    "heart_coronary_arteries_vhf",
    "kidney_left_renal_artery_vhf",
    "liver_portal_vein_vhf",
    "vascpy_penetrating_artery",
    "vascpy_smaller_vasculature",
];

#[test]
fn real_vessels_have_closed_surfaces() {
    let Some(folder) = shared::folder("data/vessels") else { return };
    let mut count = 0;
    for path in fs::read_dir(&folder).expect("a readable folder").map(|entry| entry.expect("an entry").path()) {
        let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        if path.extension().is_none_or(|extension| extension != "swc") {
            continue;
        }
        let tree = load_swc(&path, &SwcReadOptions { least_radius: Some(1.0) }).expect(&name);
        let surface = sound_surface(&name, &tree, &SurfaceSettings::default());
        if WITHOUT_FAULT.contains(&name.as_str()) {
            let check = surface.mesh.validate();
            assert!(check.is_sound(), "{name}: {:?}", check.vessels);
        }
        for factor in [4.0, 8.0] {
            sound_surface(&format!("{name} × {factor}"), &widened(&tree, factor), &SurfaceSettings::default());
        }
        count += 1;
    }
    assert!(count > 0, "no SWC in {}", folder.display());
}
