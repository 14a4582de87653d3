//! All types that users touch are registered for reflection: for inspectors, remote tools and scenes.

use super::*;
use bevy::{
    ecs::reflect::{ReflectComponent, ReflectEvent, ReflectMessage, ReflectResource},
    reflect::{TypeRegistration, TypeRegistry},
};
use bevy_vessels::plugin::{Cuttable, JobSettings, Perfusion, SurfaceShown, VesselAppearance, VesselSurface};
use std::{fs, path::Path};

/// Types that are not registered, and why.
const EXCEPTIONS: &[(&str, &str)] = &[
    ("CuttableVessels", "a queue of requests, empty between frames"),
    ("GrowthState", "a growth under way, with its tissue: regrown from the Vasculature"),
    ("RestMesh", "a copy of the organ's mesh"),
    ("SegmentBuffer", "buffers on the graphics card"),
    ("ChangeLog", "what changed in which frame"),
    ("VesselIndex", "made anew from the Vessels"),
    ("VesselMaps", "made anew from the Vessels"),
    ("VesselMesh", "made anew from the Vessels"),
];

/// A public type of the plugin or the renderer, and what it derives.
struct Exported {
    name: String,
    derives: Vec<String>,
}

impl Exported {
    fn derives(&self, what: &str) -> bool {
        self.derives.iter().any(|derived| derived == what)
    }
}

/// Every public type below a folder that is a component, a resource or a message.
fn exported(folder: &Path, found: &mut Vec<Exported>) {
    for entry in fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
        if entry.is_dir() {
            exported(&entry, found);
            continue;
        }
        if entry.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let mut derives = Vec::new();
        for line in fs::read_to_string(&entry).expect("a source file").lines() {
            if let Some(list) = line.strip_prefix("#[derive(").and_then(|line| line.strip_suffix(")]")) {
                derives.extend(list.split(", ").map(str::to_owned));
            } else if let Some(name) = line.strip_prefix("pub struct ").or(line.strip_prefix("pub enum ")) {
                let name = name.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_owned();
                found.push(Exported { name, derives: std::mem::take(&mut derives) });
            } else if !line.starts_with("#[") {
                derives.clear();
            }
        }
    }
}

#[test]
fn every_component_resource_and_message_of_the_public_interface_is_registered() {
    let mut found = Vec::new();
    for folder in ["src/plugin", "src/render"] {
        exported(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut found);
    }
    found.retain(|found| ["Component", "Resource", "Message"].iter().any(|what| found.derives(what)));
    assert!(found.len() > 25, "only {} types found", found.len());
    let app = headless(GrowthBudget::default());
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let mut missing = Vec::new();
    for Exported { name, derives } in &found {
        let is_exception = EXCEPTIONS.iter().any(|(exception, _)| exception == name);
        match (registry.get_with_short_type_path(name), is_exception) {
            (None, false) => missing.push(format!("{name} is not registered")),
            (Some(_), true) => missing.push(format!("{name} is registered; strike it from the exceptions")),
            (Some(registration), false) => missing.extend(lacking(name, derives, registration)),
            (None, true) => {}
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    for (exception, _) in EXCEPTIONS {
        assert!(found.iter().any(|found| found.name == *exception), "there is no {exception} any more");
    }
}

/// Traits that a registered type derives but does not reflect.
fn lacking(name: &str, derives: &[String], registration: &TypeRegistration) -> Vec<String> {
    let has = |what: &str| match what {
        "Component" => registration.data::<ReflectComponent>().is_some(),
        "Resource" => registration.data::<ReflectResource>().is_some(),
        "Message" => registration.data::<ReflectMessage>().is_some(),
        "EntityEvent" => registration.data::<ReflectEvent>().is_some(),
        _ => true,
    };
    derives.iter().filter(|what| !has(what)).map(|what| format!("{name} is not reflected as {what}")).collect()
}

#[test]
fn settings_survive_a_file() {
    fn assert_round_trip<T>(settings: &T)
    where
        T: serde::Serialize + serde::de::DeserializeOwned + Default + PartialEq + std::fmt::Debug,
    {
        let text = ron::to_string(settings).expect("settings can be written");
        assert_eq!(ron::from_str::<T>(&text).as_ref(), Ok(settings), "{text}");
        assert_eq!(ron::from_str::<T>("()"), Ok(T::default()), "what a file leaves out has its default");
        assert!(ron::from_str::<T>("(nonsense: 3)").is_err());
    }
    assert_round_trip(&Perfusion { paused: true, ischaemic_below: 0.3, ..default() });
    assert_round_trip(&VesselAppearance { shown: Default::default(), ..default() });
    assert_round_trip(&Cuttable::default());
    assert_round_trip(&quick());
    assert_round_trip(&VesselSurface { shows: SurfaceShown::Preview, detail: None, ..default() });
    assert_round_trip(&JobSettings { at_once: 3, ..default() });
    let budget = GrowthBudget::Steps(3);
    assert_eq!(ron::from_str(&ron::to_string(&budget).expect("a budget")), Ok(budget));
}

#[test]
fn types_within_registered_types_are_registered() {
    let app = headless(GrowthBudget::default());
    let registry: &TypeRegistry = &app.world().resource::<AppTypeRegistry>().read();
    for path in ["Preset", "Generator", "WoundReport", "SeveredEnd", "ByKind<Color>", "ByKind<Flow>", "Place", "EndId"]
    {
        assert!(registry.get_with_short_type_path(path).is_some(), "{path}");
    }
}
