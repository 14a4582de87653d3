//! Keys that control every organ of an example, and the status line with their progress.

use super::{
    light::moist_tissue,
    studio::{StatusLine, View},
};
use bevy::{diagnostic::FrameTimeDiagnosticsPlugin, ecs::system::SystemParam, light::NotShadowCaster, prelude::*};
use bevy_vessels::{
    plugin::{SurfaceShown, TextureShown, VesselSurface, VesselTexture},
    prelude::*,
    synthesis::tree::ByKind,
};

/// Help for the keys of [`ControlsPlugin`].
pub const HELP: &str = "space  pause\n.  one step\nA V  arteries, veins\nC  colours\nM  closed mesh, segments, texture";

/// An organ of the example, with or without vessels.
#[derive(Component)]
pub struct Organ {
    /// The kinds of vessels that it ever shows.
    pub kinds: ByKind<bool>,
}

impl Default for Organ {
    fn default() -> Self {
        Self { kinds: ByKind::from_fn(|_| true) }
    }
}

/// The kinds of vessels that the keys leave visible, in all organs.
#[derive(Resource)]
struct Shown(ByKind<bool>);

/// With a window: space pauses, `.` steps, `A` and `V` toggle arteries and veins of all organs, `C` changes the meaning
/// of colours, `M` switches between closed meshes, segments and textures.
pub struct ControlsPlugin;

/// What the keys of [`ControlsPlugin`] do.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ControlKeys;

impl Plugin for ControlsPlugin {
    fn build(&self, app: &mut App) {
        let in_window = resource_exists_and_equals(View::Window);
        app.add_plugins(FrameTimeDiagnosticsPlugin::default())
            .insert_resource(Shown(ByKind::from_fn(|_| true)))
            .add_systems(Update, ((steer, show, switch).chain().in_set(ControlKeys), tell).chain().run_if(in_window));
    }
}

/// The assets of organs.
#[derive(SystemParam)]
pub struct OrganAssets<'w> {
    meshes: ResMut<'w, Assets<Mesh>>,
    materials: Option<ResMut<'w, Assets<StandardMaterial>>>,
}

impl OrganAssets<'_> {
    /// Spawns the visible part of an organ: its mesh, as tinted moist tissue. A tint with an alpha below 1 shows the
    /// inside.
    pub fn spawn<'a>(
        &mut self,
        commands: &'a mut Commands,
        mesh: Mesh,
        tint: Color,
        place: Transform,
    ) -> EntityCommands<'a> {
        let material = moist_tissue(tint);
        // Without a renderer there are no materials.
        let material = self.materials.as_mut().map(|materials| materials.add(material)).unwrap_or_default();
        let mut organ =
            commands.spawn((Organ::default(), Mesh3d(self.meshes.add(mesh)), MeshMaterial3d(material), place));
        if tint.alpha() < 1.0 {
            organ.insert(NotShadowCaster);
        }
        organ
    }
}

fn steer(
    keys: Res<ButtonInput<KeyCode>>,
    mut organs: Query<(Entity, &mut GrowthControl)>,
    mut commands: MessageWriter<GrowthCommand>,
) {
    for (organ, mut control) in &mut organs {
        if keys.just_pressed(KeyCode::Space) {
            control.toggle();
        }
        if keys.just_pressed(KeyCode::Period) {
            commands.write(GrowthCommand::new(organ, GrowthAction::Step(1)));
        }
    }
}

fn show(keys: Res<ButtonInput<KeyCode>>, mut shown: ResMut<Shown>, mut looks: Query<(&Organ, &mut VesselAppearance)>) {
    for (key, kind) in [(KeyCode::KeyA, VesselKind::Artery), (KeyCode::KeyV, VesselKind::Vein)] {
        if keys.just_pressed(key) {
            shown.0[kind] = !shown.0[kind];
            looks.iter_mut().for_each(|(organ, mut look)| look.shown[kind] = shown.0[kind] && organ.kinds[kind]);
        }
    }
    for (_, mut look) in looks.iter_mut().filter(|_| keys.just_pressed(KeyCode::KeyC)) {
        look.coloring = match look.coloring {
            SegmentColoring::Kind => SegmentColoring::Radius,
            SegmentColoring::Radius => SegmentColoring::Age,
            SegmentColoring::Age => SegmentColoring::StrahlerOrder,
            SegmentColoring::StrahlerOrder => SegmentColoring::Supply,
            SegmentColoring::Supply => SegmentColoring::Kind,
        };
    }
}

fn switch(keys: Res<ButtonInput<KeyCode>>, mut organs: Query<(&mut VesselSurface, Option<&mut VesselTexture>)>) {
    for (mut surface, texture) in organs.iter_mut().filter(|_| keys.just_pressed(KeyCode::KeyM)) {
        let is_texture = texture.as_ref().is_some_and(|texture| texture.shows != TextureShown::Vessels);
        let (shown, painted) = match surface.shows {
            _ if is_texture => (SurfaceShown::Mesh, TextureShown::Vessels),
            SurfaceShown::Mesh => (SurfaceShown::Preview, TextureShown::Vessels),
            SurfaceShown::Preview => (SurfaceShown::Mesh, TextureShown::Texture),
        };
        surface.shows = shown;
        if let Some(mut texture) = texture {
            texture.shows = painted;
        }
    }
}

/// Writes the progress of the growth.
pub fn tell(
    organs: Query<(&Vasculature, &GrowthProgress, &GrowthControl)>,
    diagnostics: Res<bevy::diagnostic::DiagnosticsStore>,
    mut status: ResMut<StatusLine>,
) {
    let Some((vasculature, first, control)) = organs.iter().next() else { return };
    let nodes: usize = organs.iter().flat_map(|(_, progress, _)| progress.nodes.values()).sum();
    let paused = if *control == GrowthControl::Paused { ", paused" } else { "" };
    let fps = diagnostics.get(&FrameTimeDiagnosticsPlugin::FPS).and_then(|fps| fps.smoothed()).unwrap_or_default();
    status.0 = format!(
        "seed {}, step {} of {}{paused}, {nodes} nodes, {fps:.1} frames a second",
        vasculature.seed, first.step, first.steps
    );
}
