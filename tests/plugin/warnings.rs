//! The log says once what an organ waits for in vain, and what to do.

use super::*;
use bevy::log::tracing_subscriber;
use bevy_vessels::plugin::VasculatureOfScene;
use std::{
    io::{self, Write},
    sync::{Mutex, Once},
};

/// All that was logged in this process.
static LOG: Mutex<Vec<u8>> = Mutex::new(Vec::new());

struct Log;

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        LOG.lock().expect("nobody panics").extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// An app whose entities have numbers that those of other tests don't have.
fn logging_app(first: usize) -> App {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| _ = tracing_subscriber::fmt().with_writer(|| Log).with_ansi(false).try_init());
    let mut app = headless(GrowthBudget::Steps(1));
    (0..first).for_each(|_| _ = app.world_mut().spawn_empty());
    app
}

/// The warnings about an entity after so many frames that nobody can miss them.
fn warnings(app: &mut App, entity: Entity) -> Vec<String> {
    (0..700).for_each(|_| app.update());
    let log = String::from_utf8(LOG.lock().expect("nobody panics").clone()).expect("text");
    let about = format!("{entity}: ");
    log.lines().filter(|line| line.contains(&about)).map(str::to_owned).collect()
}

#[track_caller]
fn assert_one(warnings: &[String], words: &[&str]) {
    let [warning] = warnings else { panic!("one warning, not {warnings:?}") };
    assert!(words.iter().all(|word| warning.contains(word)), "{warning}");
}

#[test]
fn an_organ_without_a_mesh_is_told_of_once() {
    let mut app = logging_app(10_000);
    let organ = app.world_mut().spawn(quick()).id();
    assert_one(&warnings(&mut app, organ), &["no Mesh3d", "plain shape"]);
}

#[test]
fn the_root_of_a_scene_is_told_of_its_meshes() {
    let mut app = logging_app(20_000);
    let organ = app.world_mut().spawn(quick()).id();
    let mesh = add_mesh(&mut app, sphere());
    let node = app.world_mut().spawn((Transform::default(), ChildOf(organ))).id();
    app.world_mut().spawn((Mesh3d(mesh), ChildOf(node)));
    assert_one(&warnings(&mut app, organ), &["no Mesh3d", "VasculatureOfScene"]);
}

#[test]
fn a_mesh_that_nobody_loads_is_told_of() {
    let mut app = logging_app(30_000);
    let mesh = add_mesh(&mut app, sphere());
    let gone = app.world_mut().resource_mut::<Assets<Mesh>>().remove(&mesh);
    assert!(gone.is_some());
    let organ = app.world_mut().spawn((Mesh3d(mesh), quick())).id();
    assert_one(&warnings(&mut app, organ), &["mesh is not there"]);
}

#[test]
fn a_scene_without_the_meant_mesh_names_those_that_it_has() {
    let mut app = logging_app(40_000);
    let scene = app.world_mut().spawn(VasculatureOfScene::new(quick()).named(["Liver"])).id();
    let mesh = add_mesh(&mut app, sphere());
    app.world_mut().spawn((Mesh3d(mesh), Name::new("Spleen"), ChildOf(scene)));
    assert_one(&warnings(&mut app, scene), &["Liver", "Spleen"]);
    let empty = app.world_mut().spawn(VasculatureOfScene::new(quick())).id();
    assert_one(&warnings(&mut app, empty), &["has no mesh"]);
}

#[test]
fn nobody_is_told_of_what_comes_in_time() {
    let mut app = logging_app(50_000);
    let organ = app.world_mut().spawn(quick()).id();
    (0..200).for_each(|_| app.update());
    let mesh = add_mesh(&mut app, sphere());
    app.world_mut().entity_mut(organ).insert(Mesh3d(mesh));
    assert!(warnings(&mut app, organ).is_empty());
}
