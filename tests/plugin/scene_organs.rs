//! Organs in the scene of a file: meshes below its root get vessels, all of them or those with a name.

use super::*;
use bevy_vessels::{plugin::VasculatureOfScene, synthesis::tissue::TissueMode};

/// A scene as a glTF file gives it: nodes with their meshes as children, each named after mesh and material.
fn spawn_scene(app: &mut App, wish: VasculatureOfScene) -> (Entity, [Entity; 3]) {
    let root = app.world_mut().spawn((Transform::default(), Visibility::default(), wish)).id();
    let meshes = ["Liver", "Bone", "Gut"].map(|name| {
        let mesh = add_mesh(app, sphere());
        let node = (Name::new(name), Transform::default(), Visibility::default(), ChildOf(root));
        let node = app.world_mut().spawn(node).id();
        app.world_mut().spawn((Name::new(format!("{name}Mesh.Flesh")), Mesh3d(mesh), ChildOf(node))).id()
    });
    (root, meshes)
}

fn have_vessels(app: &App, meshes: [Entity; 3]) -> [bool; 3] {
    meshes.map(|mesh| app.world().get::<Vasculature>(mesh).is_some())
}

#[test]
fn all_meshes_of_a_scene_become_organs() {
    let mut app = headless(GrowthBudget::Steps(100));
    let (_, meshes) = spawn_scene(&mut app, VasculatureOfScene::new(quick()));
    for mesh in meshes {
        run_until(&mut app, "an organ", |world| world.get::<GrowthProgress>(mesh).is_some());
        run_to_phase(&mut app, mesh, GrowthPhase::Finished);
        assert_published(app.world(), mesh);
    }
    (0..3).for_each(|_| app.update());
    let organs = app.world_mut().query::<&Vasculature>().iter(app.world()).count();
    assert_eq!(organs, 3, "nothing that draws vessels is an organ");
}

#[test]
fn meshes_are_meant_by_the_name_of_node_or_mesh() {
    for (name, expected) in [("Liver", [true, false, false]), ("GutMesh", [false, false, true])] {
        let mut app = headless(GrowthBudget::Steps(1));
        let (_, meshes) = spawn_scene(&mut app, VasculatureOfScene::new(quick()).named([name]));
        app.update();
        assert_eq!(have_vessels(&app, meshes), expected, "{name}");
    }
}

#[test]
fn meshes_that_come_later_and_changed_wishes_are_followed() {
    let mut app = headless(GrowthBudget::Steps(1));
    let (root, meshes) = spawn_scene(&mut app, VasculatureOfScene::new(quick()).named(["Liver"]));
    app.update();
    let late = add_mesh(&mut app, sphere());
    let late = app.world_mut().spawn((Name::new("Liver"), Mesh3d(late), ChildOf(root))).id();
    app.update();
    assert!(app.world().get::<Vasculature>(late).is_some());
    let lining = quick().with_tissue(TissueMode::Lining);
    app.world_mut().entity_mut(root).insert(VasculatureOfScene::new(lining.clone()));
    app.update();
    assert_eq!(have_vessels(&app, meshes), [true; 3]);
    assert!(meshes.iter().chain([&late]).all(|&mesh| app.world().get::<Vasculature>(mesh) == Some(&lining)));
    app.world_mut().entity_mut(root).remove::<VasculatureOfScene>();
    app.update();
    assert_eq!(have_vessels(&app, meshes), [true; 3], "they stay");
}
