//! Procedural blood vessels for Bevy: arteries and veins that grow over an organ, or through it, while you watch.
//!
//! Add [`VesselPlugin`] to an app, and a [`Vasculature`](plugin::Vasculature) to any entity with a mesh. Plain shapes and
//! images are [sources of tissue](synthesis::tissue::TissueSource), too, and need no mesh.
//!
//! ```
//! # #[cfg(feature = "plugin")] {
//! use bevy::prelude::*;
//! use bevy_vessels::prelude::*;
//!
//! fn spawn_organ(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
//!     let organ = meshes.add(Sphere::new(0.1).mesh().ico(20).expect("fewer than 80 subdivisions"));
//!     commands.spawn((Mesh3d(organ), Vasculature::new(PresetName::Colon).with_seed(7)));
//! }
//! # }
//! ```
//!
//! # From organ to picture
//!
//! Data flows one way: organ mesh → [`tissue`](synthesis::tissue) → attraction points → a growth step
//! ([`colonization`](synthesis::colonization)) → [`VesselTree`](synthesis::tree::VesselTree) → what is drawn
//! ([`instances`](synthesis::instances)) or written ([`io`](synthesis::io)).
//!
//! - [`synthesis`] makes vessels without an engine. Use it alone, without default features, for batches of organs.
//! - [`plugin`] brings it into a Bevy world: components, a time budget for each frame, messages. Vessels can also be
//!   cut and bleed: see [`Cuttable`](plugin::Cuttable) and [`Perfusion`](plugin::Perfusion).
//! - [`render`] draws the segments by instancing while they grow.
//! - `ui` is a panel to tweak them with, behind a feature.
//!
//! # Units
//!
//! All lengths are in the local space of the organ's mesh, in any unit. Presets fit themselves to the organ's size.
//! Angles in settings are in degrees.
//!
//! # Features
//!
//! | feature | default | what it adds |
//! |---|---|---|
//! | `plugin` | yes | the ECS glue, and `serialize` |
//! | `render` | yes | instanced drawing |
//! | `parallel` | yes | large steps on all threads, with the same result on any number |
//! | `serialize` | with `plugin` | settings and presets as RON files |
//! | `mesh_files` | no | organ meshes from GLB, glTF and OBJ files without Bevy |
//! | `unwrap` | no | texture coordinates for meshes without usable ones |
//! | `texture_files` | no | baked textures as PNG and KTX2 |
//! | `ui` | no | a panel with every setting, presets, statistics and tools |
//!
//! # Frequent questions
//!
//! **Is an organ the same at another frame rate, thread count or platform?** Yes. A step depends on settings and seed
//! alone; the time budget only decides how many steps run in a frame.
//!
//! **My organ is in millimetres.** Nothing to do: see Units.
//!
//! **My organ bleeds by the litre, or not at all.** Flow depends on real size: set the length of a unit of the mesh in
//! [`Perfusion::scale`](plugin::Perfusion::scale).
//!
//! **My organ is a soft body.** Put [`FollowsMesh`](plugin::FollowsMesh) on it, and its vessels follow its surface.
//! With [`FollowsTetrahedra`](plugin::FollowsTetrahedra) they follow its inside.
//!
//! **I need a closed mesh: to draw, to print or to compute with.** Put a [`VesselSurface`](plugin::VesselSurface) on the
//! organ. [`SurfaceCommandsExt`](plugin::SurfaceCommandsExt) saves it.
//!
//! **The vessels in my translucent organ are dark.** They are in its shadow, which Bevy draws as that of an opaque
//! mesh. Put `NotShadowCaster` on the organ. Vessels take that over, as they do its `RenderLayers`.
//!
//! **My organ is in a glTF scene.** Put a [`VasculatureOfScene`](plugin::VasculatureOfScene) on the scene's root.
//!
//! **Why does nothing grow?** Look at the entity's [`GrowthProgress`](plugin::GrowthProgress) and the log. They name an
//! unusable mesh, or settings outside their limits, and say what to change.

pub mod synthesis;

#[cfg(feature = "plugin")]
pub mod plugin;
#[cfg(feature = "render")]
pub mod render;
#[cfg(feature = "ui")]
pub mod ui;

/// The names that most apps with vessels need: `use bevy_vessels::prelude::*`.
#[cfg(feature = "plugin")]
pub mod prelude {
    pub use crate::VesselPlugin;
    pub use crate::plugin::{
        Cuttable, CuttableVessels, EntityCommandsExt, FollowsMesh, GrowthAction, GrowthBudget, GrowthCommand,
        GrowthControl, GrowthFailed, GrowthFinished, GrowthPhase, GrowthProgress, OpenEnd, OrganPaint, Perfusion,
        SegmentColoring, StrokeId, Vasculature, VesselAppearance, VesselSystems, Vessels,
    };
    pub use crate::synthesis::colonization::ColonizationSettings;
    pub use crate::synthesis::generator::Generator;
    pub use crate::synthesis::preset::PresetName;
    pub use crate::synthesis::roots::{RootPlacement, RootPlacements};
    pub use crate::synthesis::tissue::TissueMode;
    pub use crate::synthesis::tree::VesselKind;
    pub use crate::synthesis::wound::Blade;
}

#[cfg(feature = "plugin")]
use bevy::{
    app::{App, Plugin},
    ecs::schedule::ScheduleLabel,
};

/// Everything that an app with vessels needs: growth, surgery, blood, deformation, surfaces, textures, and drawing if the app
/// draws.
///
/// Add it after `DefaultPlugins`. Vessels also grow in an app without a renderer. Each part is a plugin of its own: an
/// app that only grows vessels may add [`GrowthPlugin`](plugin::GrowthPlugin) alone.
#[cfg(feature = "plugin")]
#[derive(Clone, Debug, Default)]
pub struct VesselPlugin {
    /// How vessels grow in this app: schedule and budget.
    pub growth: plugin::GrowthPlugin,
    /// How vessels follow organs that are deformed.
    pub deformation: plugin::DeformationPlugin,
    /// How vessels are cut.
    pub surgery: plugin::SurgeryPlugin,
    /// How blood flows.
    pub circulation: plugin::CirculationPlugin,
    /// How closed surfaces are made.
    pub surface: plugin::SurfacePlugin,
    /// How vessels are painted into textures.
    pub texture: plugin::TexturePlugin,
    /// How presets are loaded.
    pub scene: plugin::ScenePlugin,
    /// How segments are drawn: how round they are.
    #[cfg(feature = "render")]
    pub segments: render::SegmentRenderPlugin,
}

#[cfg(feature = "plugin")]
impl VesselPlugin {
    /// Runs everything but drawing in a schedule other than `Update`.
    #[must_use]
    pub fn in_schedule(self, schedule: impl ScheduleLabel) -> Self {
        let schedule = schedule.intern();
        Self {
            growth: self.growth.in_schedule(schedule),
            deformation: plugin::DeformationPlugin::in_schedule(schedule),
            surgery: plugin::SurgeryPlugin::in_schedule(schedule),
            circulation: plugin::CirculationPlugin::in_schedule(schedule),
            surface: plugin::SurfacePlugin::in_schedule(schedule),
            texture: plugin::TexturePlugin::in_schedule(schedule),
            scene: plugin::ScenePlugin::in_schedule(schedule),
            ..self
        }
    }
}

#[cfg(feature = "plugin")]
impl Plugin for VesselPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((
            self.growth.clone(),
            self.deformation.clone(),
            self.surgery.clone(),
            self.circulation.clone(),
            self.surface.clone(),
            self.texture.clone(),
            self.scene.clone(),
        ));
        #[cfg(feature = "render")]
        app.add_plugins(self.segments.clone());
    }
}

/// The code of the README, compiled.
#[cfg(all(doctest, feature = "render"))]
#[doc = include_str!("../README.md")]
struct Readme;
