//! What is made of the vessels: closed meshes, textures and files.

use crate::plugin::{
    SurfaceCommandsExt, SurfaceFailed, SurfaceNotSaved, SurfaceReady, SurfaceSaved, SurfaceShown, TextureFailed,
    TextureReady, TextureShown, VesselMaps, VesselMesh, VesselSurface, VesselTexture,
};
use crate::synthesis::surface::SurfaceSettings;
use bevy::prelude::*;
use bevy_egui::egui::{self, Slider, Ui};

/// The extensions of meshes that can be saved.
const MESH_FILES: &str = "vessels.glb, .stl, .ply, .obj or .off";

/// What became of the last mesh, texture or file, and the file to save to.
#[derive(Resource, Debug, Default)]
pub(super) struct ProductNews {
    told: String,
    mesh_file: String,
}

/// Hears what became of meshes, textures and files, and tells it in the panel.
pub(super) fn hear(
    mut ready: MessageReader<SurfaceReady>,
    mut failed: MessageReader<SurfaceFailed>,
    mut saved: MessageReader<SurfaceSaved>,
    mut not_saved: MessageReader<SurfaceNotSaved>,
    mut textures: MessageReader<TextureReady>,
    mut not_baked: MessageReader<TextureFailed>,
    mut news: ResMut<ProductNews>,
) {
    let mut told = Vec::new();
    told.extend(ready.read().map(|_| "the closed mesh is ready".to_owned()));
    told.extend(failed.read().map(|failed| failed.error.to_string()));
    told.extend(saved.read().map(|saved| format!("saved to {}", saved.path.display())));
    told.extend(not_saved.read().map(|failed| failed.error.to_string()));
    told.extend(textures.read().map(|_| "the texture is ready".to_owned()));
    told.extend(not_baked.read().map(|failed| failed.error.to_string()));
    if let Some(last) = told.pop() {
        news.told = last;
    }
}

/// Shows what can be made of an organ's vessels. Components are added to it, changed and removed.
pub(super) fn show(
    ui: &mut Ui,
    organ: &mut EntityCommands,
    surface: Option<&VesselSurface>,
    texture: Option<&VesselTexture>,
    (meshes, maps): (usize, Option<&VesselMaps>),
    news: &mut ProductNews,
) {
    show_surface(ui, organ, surface, meshes, &mut news.mesh_file);
    show_texture(ui, organ, texture, maps);
    if !news.told.is_empty() {
        ui.weak(&news.told);
    }
}

fn show_surface(
    ui: &mut Ui,
    organ: &mut EntityCommands,
    surface: Option<&VesselSurface>,
    meshes: usize,
    file: &mut String,
) {
    let mut wanted = surface.is_some();
    ui.checkbox(&mut wanted, "closed mesh").on_hover_text("Skjermo & Eidheim: closed, smooth, of any finesse.");
    let Some(surface) = surface else {
        if wanted {
            organ.insert(VesselSurface::default());
        }
        return;
    };
    if !wanted {
        organ.remove::<VesselSurface>();
        return;
    }
    let mut changed = surface.clone();
    ui.indent("mesh", |ui| {
        let level = Slider::new(&mut changed.settings.level, 0..=SurfaceSettings::MOST_LEVEL).text("subdivisions");
        ui.add(level);
        ui.horizontal(|ui| {
            ui.label("sides");
            for sides in [4, 8, 16, 32] {
                let choice = ui.selectable_label(changed.settings.most_sides == sides, sides.to_string());
                if choice.on_hover_text("Around the widest vessels.").clicked() {
                    changed.settings.most_sides = sides;
                    changed.settings.least_sides = changed.settings.least_sides.min(sides);
                }
            }
            let mut shown = changed.shows == SurfaceShown::Mesh;
            ui.checkbox(&mut shown, "shown");
            changed.shows = if shown { SurfaceShown::Mesh } else { SurfaceShown::Preview };
        });
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(file).hint_text(MESH_FILES).desired_width(150.0));
            if ui.add_enabled(meshes > 0 && !file.trim().is_empty(), egui::Button::new("save")).clicked() {
                organ.save_surface(file.trim());
            }
            if meshes == 0 {
                ui.spinner();
            }
        });
    });
    if changed != *surface {
        organ.insert(changed);
    }
}

fn show_texture(ui: &mut Ui, organ: &mut EntityCommands, texture: Option<&VesselTexture>, maps: Option<&VesselMaps>) {
    let mut wanted = texture.is_some();
    ui.checkbox(&mut wanted, "vessels in the texture").on_hover_text("The organ's mesh needs texture coordinates.");
    let Some(texture) = texture else {
        if wanted {
            organ.insert(VesselTexture::default());
        }
        return;
    };
    if !wanted {
        organ.remove::<VesselTexture>();
        return;
    }
    let mut changed = texture.clone();
    ui.indent("texture", |ui| {
        ui.horizontal(|ui| {
            ui.label("texels");
            for size in [1024, 2048, 4096, 8192] {
                ui.selectable_value(&mut changed.settings.size, size, size.to_string());
            }
        });
        ui.horizontal(|ui| {
            for (name, shows) in
                [("texture", TextureShown::Texture), ("both", TextureShown::Both), ("vessels", TextureShown::Vessels)]
            {
                ui.selectable_value(&mut changed.shows, shows, name);
            }
            if maps.is_none() {
                ui.spinner();
            }
        });
    });
    if changed != *texture {
        organ.insert(changed);
    }
}

/// How many vessel entities of an organ have a closed mesh.
pub(super) fn count_meshes<'a>(vessels: impl IntoIterator<Item = &'a Entity>, meshes: &Query<&VesselMesh>) -> usize {
    vessels.into_iter().filter(|&&vessels| meshes.contains(vessels)).count()
}
