//! Presets from files: loaded, changed while the app runs, and invalid.

use super::*;
use bevy::asset::AssetServer;
use bevy_vessels::{
    plugin::{GrowthFailed, OrganGrowthError, PresetAsset, VesselPreset},
    synthesis::preset::Preset,
};
use std::{fs, path::PathBuf};

/// A folder of assets, removed after the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("{}-{name}-{}", env!("CARGO_CRATE_NAME"), std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        Self(folder)
    }

    fn write(&self, file: &str, text: &str) {
        fs::write(self.0.join(file), text).expect("a file");
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

/// The preset of [`quick`], with another number of steps.
fn text(steps: u32) -> String {
    let mut vasculature = quick();
    vasculature.generator.colonization_mut().expect("colonization").steps = steps;
    Preset::from(&vasculature).to_ron().expect("a preset can be written")
}

fn app(folder: &Folder) -> App {
    let assets = AssetPlugin { file_path: folder.0.to_string_lossy().into_owned(), ..default() };
    headless_with_assets(GrowthBudget::default(), assets)
}

fn spawn_with_preset(app: &mut App, file: &'static str) -> Entity {
    let preset = VesselPreset::new(app.world().resource::<AssetServer>().load(file)).with_seed(7);
    let mesh = add_mesh(app, sphere());
    app.world_mut().spawn((Mesh3d(mesh), preset)).id()
}

fn steps(world: &World, organ: Entity) -> Option<u32> {
    Some(world.get::<Vasculature>(organ)?.generator.colonization()?.steps)
}

#[test]
fn an_organ_grows_by_its_preset_and_anew_when_the_file_changes() {
    let folder = Folder::new("reload");
    folder.write("organ.vessels.ron", &text(6));
    let mut app = app(&folder);
    let organ = spawn_with_preset(&mut app, "organ.vessels.ron");
    run_until(&mut app, "a preset", |world| world.get::<Vasculature>(organ).is_some());
    let made = app.world().get::<Vasculature>(organ).cloned().expect("a vasculature");
    let preset = Preset::from_ron(&text(6)).expect("a preset");
    assert_eq!(made, Vasculature::from_preset(preset.clone()).with_seed(7));
    assert_eq!(Preset { source: preset.source.clone(), ..Preset::from(&made) }, preset, "the way back");
    run_to_phase(&mut app, organ, GrowthPhase::Finished);

    app.world_mut().get_mut::<Vasculature>(organ).expect("a vasculature").seed = 8;
    folder.write("organ.vessels.ron", &text(9));
    app.world().resource::<AssetServer>().reload("organ.vessels.ron");
    run_until(&mut app, "the changed file", |world| steps(world, organ) == Some(9));
    assert_eq!(app.world().get::<Vasculature>(organ).map(|vasculature| vasculature.seed), Some(8), "the seed stays");
    run_until(&mut app, "nine steps", |world| progress(world, organ).is_finished() && progress(world, organ).step == 9);

    // A file that becomes invalid changes nothing.
    let mut failed = MessageCursor::default();
    folder.write("organ.vessels.ron", "(generator: Sorcery)");
    app.world().resource::<AssetServer>().reload("organ.vessels.ron");
    (0..30).for_each(|_| {
        app.update();
        thread::sleep(Duration::from_millis(2));
    });
    assert_eq!((steps(app.world(), organ), progress(app.world(), organ).step), (Some(9), 9));
    assert!(drain::<GrowthFailed>(app.world(), &mut failed).is_empty());
    folder.write("organ.vessels.ron", &text(4));
    app.world().resource::<AssetServer>().reload("organ.vessels.ron");
    run_until(&mut app, "the repaired file", |world| steps(world, organ) == Some(4));
}

#[test]
fn a_change_of_the_asset_itself_counts_too() {
    let folder = Folder::new("asset");
    let mut app = app(&folder);
    let preset = Preset::from_ron(&text(3)).expect("a preset");
    let handle = app.world_mut().resource_mut::<Assets<PresetAsset>>().add(PresetAsset(preset));
    let mesh = add_mesh(&mut app, sphere());
    let organ = app.world_mut().spawn((Mesh3d(mesh), VesselPreset::new(handle.clone()))).id();
    run_until(&mut app, "three steps", |world| steps(world, organ) == Some(3));
    let changed = PresetAsset(Preset::from_ron(&text(5)).expect("a preset"));
    app.world_mut().resource_mut::<Assets<PresetAsset>>().insert(&handle, changed).expect("a living handle");
    run_until(&mut app, "five steps", |world| steps(world, organ) == Some(5));
    // The same preset again is no change.
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.world_mut().get_mut::<VesselPreset>(organ).expect("a preset").set_changed();
    app.update();
    app.update();
    assert!(progress(app.world(), organ).is_finished());
}

#[test]
fn files_that_are_no_presets_say_why_and_leave_other_organs_alone() {
    let folder = Folder::new("broken");
    folder.write("good.vessels.ron", &text(3));
    folder.write("broken.vessels.ron", "(fit: maybe)");
    fs::write(folder.0.join("bytes.vessels.ron"), [0xff, 0xfe, 0x00]).expect("a file");
    folder.write("newer.vessels.ron", "(version: 99)");
    let mut app = app(&folder);
    let cases = [
        ("broken.vessels.ron", "1:7"),
        ("bytes.vessels.ron", "UTF-8"),
        ("newer.vessels.ron", "version 99"),
        ("missing.vessels.ron", "not found"),
    ];
    let organs = cases.map(|(file, message)| (spawn_with_preset(&mut app, file), file, message));
    let good = spawn_with_preset(&mut app, "good.vessels.ron");
    let mut failures: Vec<GrowthFailed> = Vec::new();
    let mut cursor = MessageCursor::default();
    run_until(&mut app, "failures and vessels", |world| {
        failures.extend(drain(world, &mut cursor));
        let has_grown = world.get::<GrowthProgress>(good).is_some_and(GrowthProgress::is_finished);
        failures.len() >= cases.len() && has_grown
    });
    assert_eq!(failures.len(), cases.len(), "each is told once");
    for (organ, file, message) in organs {
        let failure = failures.iter().find(|failure| failure.organ == organ).expect("a failure");
        assert!(matches!(failure.error, OrganGrowthError::Preset { .. }));
        let told = failure.error.to_string();
        assert!(told.contains(file) && told.contains(message), "{file}: {told}");
        assert!(app.world().get::<Vasculature>(organ).is_none());
    }
    // Requested after it failed, the failure is reported, too.
    let late = spawn_with_preset(&mut app, "broken.vessels.ron");
    run_until(&mut app, "a failure", |world| {
        drain(world, &mut cursor).iter().any(|failure: &GrowthFailed| failure.organ == late)
    });
}
