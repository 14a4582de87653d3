//! The panel: its groups, from the organ to what is made of it.

use super::{
    generator, growth,
    history::{History, Work},
    knob::Rows,
    organ,
    painting::{self, Painting},
    preset::{self, Base},
    products::{self, ProductNews},
    sketch::Sketches,
    state::VesselPanel,
    statistics::Statistics,
    surgery::{self, LossCurve},
};
use crate::plugin::{
    BloodLoss, CuttableVessels, GrowthCommand, GrowthControl, GrowthProgress, GrowthState, OrganPaint, OrganVessels,
    Patient, RegrowsUnseen, SegmentColoring, Vasculature, VesselAppearance, VesselMaps, VesselMesh, VesselSurface,
    VesselTexture, Vessels, job::Jobs,
};
use crate::synthesis::{roots::RootPlacement, tree::VesselKind};
use bevy::{
    ecs::{query::QueryData, system::SystemParam},
    platform::collections::HashMap,
    prelude::*,
};
use bevy_egui::{
    EguiContexts,
    egui::{self, Align2, CollapsingHeader, Ui},
};

/// Width of the panel, in points.
const WIDTH: f32 = 330.0;
/// Room above and below the panel, in points.
const MARGIN: f32 = 8.0;

/// What the panel remembers from frame to frame.
#[derive(Resource, Default)]
pub(super) struct PanelMemory {
    sketches: Sketches,
    history: History,
    bases: HashMap<Entity, Base>,
    statistics: Statistics,
    losses: HashMap<Entity, LossCurve>,
    preset_file: String,
    told_of_preset: String,
}

/// An organ, with all that the panel shows and changes.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct Organ {
    entity: Entity,
    name: Option<&'static Name>,
    wish: &'static mut Vasculature,
    paint: Option<&'static mut OrganPaint>,
    control: &'static GrowthControl,
    progress: &'static GrowthProgress,
    state: &'static GrowthState,
    look: &'static mut VesselAppearance,
    vessels: Option<&'static OrganVessels>,
    surface: Option<&'static VesselSurface>,
    texture: Option<&'static VesselTexture>,
    maps: Option<&'static VesselMaps>,
    loss: Option<&'static BloodLoss>,
    patient: Option<&'static Patient>,
    unseen: Has<RegrowsUnseen>,
}

/// What the panel works with beside the organs.
#[derive(SystemParam)]
pub(super) struct Tools<'w, 's> {
    commands: Commands<'w, 's>,
    growth: MessageWriter<'w, GrowthCommand>,
    cuttable: Option<ResMut<'w, CuttableVessels>>,
    vessels: Query<'w, 's, &'static Vessels>,
    meshes: Query<'w, 's, &'static VesselMesh>,
    news: ResMut<'w, ProductNews>,
    jobs: Jobs<'w>,
    painting: Res<'w, Painting>,
    time: Res<'w, Time>,
}

/// Shows the panel.
pub(super) fn show_panel(
    mut contexts: EguiContexts,
    mut panel: ResMut<VesselPanel>,
    mut memory: ResMut<PanelMemory>,
    mut organs: Query<Organ>,
    mut tools: Tools,
) -> Result {
    // Without a camera there is nothing to draw it on.
    let Ok(context) = contexts.ctx_mut() else { return Ok(()) };
    let names: Vec<(Entity, String)> = organs
        .iter()
        .map(|organ| (organ.entity, organ.name.map_or_else(|| organ.entity.to_string(), ToString::to_string)))
        .collect();
    let lives = |organ: Entity| names.iter().any(|(own, _)| *own == organ);
    memory.forget(lives, |vessels| tools.vessels.contains(vessels));
    let mut chosen = panel.organ.filter(|&organ| lives(organ)).or(names.first().map(|(organ, _)| *organ));
    let height = context.content_rect().height() - 2.0 * MARGIN;
    egui::Window::new("Vessels")
        .anchor(Align2::RIGHT_TOP, [-MARGIN, MARGIN])
        .resizable([true, false])
        .default_size([WIDTH, height])
        .max_height(height)
        .vscroll(true)
        .show(context, |ui| {
            organ::choose(ui, &names, &mut chosen);
            match chosen.and_then(|organ| organs.get_mut(organ).ok()) {
                Some(mut organ) => memory.show(ui, &mut panel, &mut organ, &mut tools),
                None => drop(ui.label("There is no entity with a Vasculature.")),
            }
        });
    if panel.organ != chosen {
        panel.organ = chosen;
    }
    Ok(())
}

impl PanelMemory {
    /// Forgets organs and vessels that are gone.
    fn forget(&mut self, organ_lives: impl Fn(Entity) -> bool, vessels_live: impl Fn(Entity) -> bool) {
        self.history.retain(&organ_lives);
        self.bases.retain(|&organ, _| organ_lives(organ));
        self.losses.retain(|&organ, _| organ_lives(organ));
        self.statistics.retain(vessels_live);
    }

    /// Shows an organ.
    fn show(&mut self, ui: &mut Ui, panel: &mut VesselPanel, organ: &mut OrganItem, tools: &mut Tools) {
        if !organ.unseen {
            tools.commands.entity(organ.entity).insert(RegrowsUnseen);
        }
        growth::show_progress(ui, organ.progress, organ.state.error().map(ToString::to_string));
        if let Some(action) = growth::show_buttons(ui, *organ.control) {
            tools.growth.write(GrowthCommand::new(organ.entity, action));
        }
        ui.separator();
        self.show_wish(ui, panel, organ, tools);
        let mut look = organ.look.clone();
        CollapsingHeader::new("Looks").show(ui, |ui| show_look(ui, &mut look, organ.progress));
        organ.look.set_if_neq(look);
        let entities = organ.vessels.map_or(&[][..], OrganVessels::entities);
        CollapsingHeader::new("Statistics").show(ui, |ui| {
            for &entity in entities {
                let Ok(vessels) = tools.vessels.get(entity) else { continue };
                CollapsingHeader::new(vessels.kind().plural())
                    .default_open(vessels.kind() == VesselKind::Artery)
                    .show(ui, |ui| self.statistics.show(ui, entity, vessels, &tools.jobs));
            }
        });
        CollapsingHeader::new("Mesh, texture, files").show(ui, |ui| {
            let made = (products::count_meshes(entities, &tools.meshes), organ.maps);
            let mut commands = tools.commands.entity(organ.entity);
            products::show(ui, &mut commands, organ.surface, organ.texture, made, &mut tools.news);
        });
        if let Some(cuttable) = &mut tools.cuttable {
            let curve = self.losses.entry(organ.entity).or_default();
            let curve = (curve, tools.time.elapsed_secs_f64());
            CollapsingHeader::new("Operate").show(ui, |ui| {
                surgery::show(ui, &mut panel.tool, cuttable, organ.loss, organ.patient, curve);
            });
        }
    }

    /// Shows what makes an organ's vessels, and takes changes over.
    fn show_wish(&mut self, ui: &mut Ui, panel: &mut VesselPanel, organ: &mut OrganItem, tools: &mut Tools) {
        // A draft, so that only changes are changes.
        let paint = organ.paint.as_deref().cloned().unwrap_or_default();
        let mut draft = Work { wish: organ.wish.clone(), paint };
        self.history.note(organ.entity, &draft, tools.painting.goes_on() || ui.ctx().egui_is_using_pointer());
        ui.horizontal(|ui| self.history.show(ui, organ.entity, &mut draft));
        let Work { wish, paint } = &mut draft;
        let base = self.bases.entry(organ.entity).or_insert_with(|| Base::of(wish));
        preset::show(ui, wish, base, &mut self.preset_file, &mut self.told_of_preset);
        organ::show_seed(ui, &mut wish.seed);
        let mut rows = Rows { sketches: &mut self.sketches, fitted: wish.fit };
        CollapsingHeader::new("Settings").default_open(true).show(ui, |ui| {
            generator::show(ui, wish, &base.preset, &mut rows, &mut panel.linked);
        });
        CollapsingHeader::new("Tissue and roots").show(ui, |ui| {
            organ::show_tissue(ui, &mut wish.tissue);
            organ::show_roots(ui, &mut wish.roots);
        });
        CollapsingHeader::new("Paint").show(ui, |ui| {
            let grows = |kind| wish.roots[kind] != RootPlacement::None;
            painting::show(ui, &mut panel.tool, &mut panel.brush, grows);
            if ui.add_enabled(!paint.is_blank(), egui::Button::new("clear all paint")).clicked() {
                *paint = OrganPaint::default();
            }
        });
        match &mut organ.paint {
            Some(own) => drop(own.set_if_neq(std::mem::take(paint))),
            None if !paint.is_blank() => drop(tools.commands.entity(organ.entity).insert(std::mem::take(paint))),
            None => {}
        }
        organ.wish.set_if_neq(draft.wish);
    }
}

/// Shows the colours of vessels, and which kinds are visible.
fn show_look(ui: &mut Ui, look: &mut VesselAppearance, progress: &GrowthProgress) {
    for kind in VesselKind::ALL.into_iter().filter(|&kind| progress.nodes[kind] > 0) {
        ui.horizontal(|ui| {
            ui.checkbox(&mut look.shown[kind], kind.plural());
            let mut color = look.colors[kind].to_srgba().to_f32_array();
            let before = color;
            ui.color_edit_button_rgba_unmultiplied(&mut color);
            if color != before {
                look.colors[kind] = Srgba::from_f32_array(color).into();
            }
        });
    }
    ui.horizontal_wrapped(|ui| {
        ui.label("colours by");
        for (name, coloring) in [
            ("kind", SegmentColoring::Kind),
            ("radius", SegmentColoring::Radius),
            ("age", SegmentColoring::Age),
            ("order", SegmentColoring::StrahlerOrder),
            ("supply", SegmentColoring::Supply),
        ] {
            ui.selectable_value(&mut look.coloring, coloring, name);
        }
    });
}
