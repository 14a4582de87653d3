//! Presets: the built-in ones, and files that a user loads and saves.

use crate::{
    plugin::Vasculature,
    synthesis::{
        io::write_atomically,
        preset::{Preset, PresetName},
        roots::RootPlacement,
        tree::VesselKind,
    },
};
use bevy_egui::egui::{Button, ComboBox, TextEdit, Ui};
use std::{fs, path::Path};

/// The preset that an organ's settings are compared with.
#[derive(Clone, Debug)]
pub(super) struct Base {
    pub(super) name: String,
    pub(super) preset: Preset,
}

impl Base {
    /// The preset with these settings; the settings themselves, as found, if there is none.
    pub(super) fn of(wish: &Vasculature) -> Self {
        let own = unsigned(Preset::from(wish));
        let known = PresetName::ALL.into_iter().find(|name| makes(&unsigned(name.load()), &own));
        match known {
            Some(name) => Self { name: name.name().to_owned(), preset: name.load() },
            None => Self { name: "as found".to_owned(), preset: own },
        }
    }

    /// Whether settings differ from the preset in what the panel shows.
    fn is_modified(&self, wish: &Vasculature) -> bool {
        !makes(&self.preset, &Preset::from(wish))
    }
}

/// Whether two presets have the same settings. Where vessels enter and what they grow in belong to the organ.
fn makes(first: &Preset, second: &Preset) -> bool {
    first.generator == second.generator && first.fit == second.fit
}

/// A preset without its origin.
fn unsigned(preset: Preset) -> Preset {
    Preset { source: String::new(), ..preset }
}

/// Shows the choice of a preset, and a file to load one from or save it to. `told` is what the last file said.
pub(super) fn show(ui: &mut Ui, wish: &mut Vasculature, base: &mut Base, file: &mut String, told: &mut String) {
    ui.horizontal(|ui| {
        let modified = base.is_modified(wish);
        let text = if modified { format!("{} *", base.name) } else { base.name.clone() };
        let choice = ComboBox::from_id_salt("preset").selected_text(text).show_ui(ui, |ui| {
            let pick = |name: &PresetName| ui.selectable_label(base.name == name.name(), name.name()).clicked();
            PresetName::ALL.into_iter().find(pick)
        });
        choice.response.on_hover_text("Settings to begin with. * marks changed ones.");
        if let Some(name) = choice.inner.flatten() {
            *base = Base { name: name.name().to_owned(), preset: name.load() };
            adopt(wish, &base.preset);
        }
        if ui.add_enabled(modified, Button::new("revert")).clicked() {
            adopt(wish, &base.preset);
        }
    });
    ui.horizontal(|ui| {
        ui.add(TextEdit::singleline(file).hint_text("my.vessels.ron").desired_width(150.0));
        let named = !file.trim().is_empty();
        if ui.add_enabled(named, Button::new("load")).clicked() {
            *told = match load(Path::new(file.trim())) {
                Ok(preset) => {
                    adopt(wish, &preset);
                    *base = Base { name: file.trim().to_owned(), preset };
                    String::new()
                }
                Err(reason) => reason,
            };
        }
        if ui.add_enabled(named, Button::new("save")).clicked() {
            let preset = Preset::from(&*wish);
            *told = match save(&preset, Path::new(file.trim())) {
                Ok(()) => {
                    *base = Base { name: file.trim().to_owned(), preset };
                    format!("saved to {}", file.trim())
                }
                Err(reason) => reason,
            };
        }
    });
    if !told.is_empty() {
        ui.weak(&*told);
    }
}

/// Takes settings over. The organ keeps its tissue; roots come along where they are not places of another organ.
fn adopt(wish: &mut Vasculature, preset: &Preset) {
    (wish.generator, wish.fit) = (preset.generator.clone(), preset.fit);
    let is_placed =
        |placement: &RootPlacement| matches!(placement, RootPlacement::Nearest(_) | RootPlacement::Exact(_));
    if !VesselKind::ALL.into_iter().any(|kind| is_placed(&wish.roots[kind])) {
        wish.roots = preset.roots.clone();
    }
    if preset.blood.is_some() {
        wish.blood.clone_from(&preset.blood);
    }
}

fn load(path: &Path) -> Result<Preset, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("{} can't be read: {error}", path.display()))?;
    Preset::from_ron(&text).map_err(|error| format!("{}: {error}", path.display()))
}

fn save(preset: &Preset, path: &Path) -> Result<(), String> {
    let text = preset.to_ron().map_err(|error| error.to_string())?;
    write_atomically(path, |out| out.write_all(text.as_bytes())).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_preset_is_recognised() {
        for name in PresetName::ALL {
            let found = Base::of(&Vasculature::new(name));
            assert!(makes(&found.preset, &name.load()), "{name}: {}", found.name);
            assert!(!found.is_modified(&Vasculature::new(name)));
        }
    }

    #[test]
    fn a_saved_preset_loads_as_it_was_and_a_file_without_one_says_why() {
        let folder = std::env::temp_dir().join(format!("panel-preset-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("own.vessels.ron");
        let preset = Preset::from(&Vasculature::new(PresetName::Colon));
        save(&preset, &path).unwrap();
        assert_eq!(load(&path).unwrap(), preset);
        fs::write(&path, "no preset").unwrap();
        assert!(load(&path).unwrap_err().contains("own.vessels.ron"));
        assert!(load(&folder.join("nowhere.ron")).unwrap_err().contains("nowhere.ron"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
