//! What lives on entities: the user's wishes on the organ, the progress of its growth, and the vessels themselves.
//!
//! An organ is an entity with a mesh and a [`Vasculature`]. Everything else is added by the plugin. Each system that has
//! roots gets one vessel entity, a child of the organ, that carries a whole tree in [`Vessels`].

use crate::plugin::{growth_state::GrowthState, segment_changes::SegmentChanges};
use crate::synthesis::{
    colonization::ColonizationSettings,
    preset::{Preset, PresetName},
    roots::{RootPlacement, Roots},
    tissue::TissueSettings,
    tree::System,
};
use bevy::{
    camera::visibility::Visibility,
    color::Color,
    ecs::{component::Component, entity::Entity, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
    transform::components::Transform,
};
use std::time::Duration;

/// Vessels that an organ is to have: put it beside the organ's `Mesh3d`, and they grow.
///
/// Changing any field of it starts the growth again at the next frame. What is slow, preparing the tissue, is done again
/// only where [`tissue`](Self::tissue) or the mesh changed. Removing it removes the vessels.
///
/// All lengths are in the local space of the mesh, with [`fit`](Self::fit) off; with `fit` on, they are shares of the
/// organ's size.
///
/// ```
/// # use bevy_vessels::{plugin::Vasculature, synthesis::preset::PresetName};
/// let vasculature = Vasculature::new(PresetName::Colon).with_seed(7);
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(GrowthState, GrowthProgress, GrowthControl, VesselAppearance, Transform, Visibility)]
pub struct Vasculature {
    /// Chooses one of the countless networks that the same settings give. The same seed gives the same network, on any
    /// machine and at any frame rate.
    ///
    /// Default: 0.
    pub seed: u64,
    /// How the vessels grow. Default: that of [`PresetName::Paper`].
    pub settings: ColonizationSettings,
    /// Where arteries enter the organ, in the local space of its mesh.
    pub arterial_roots: RootPlacement,
    /// Where veins leave the organ, in the local space of its mesh.
    pub venous_roots: RootPlacement,
    /// Which part of the organ is to be supplied: its surface, its inside or both.
    pub tissue: TissueSettings,
    /// Whether the lengths in [`settings`](Self::settings) are made for a tissue of equivalent diameter 1, as those of
    /// all presets are, and are to be fitted to this organ ([`ColonizationSettings::fit`]).
    ///
    /// Off, they are taken as lengths in the mesh's local space. Default: true.
    pub fit: bool,
}

impl Vasculature {
    /// The vessels of a named preset, with seed 0, fitted to the organ.
    pub fn new(preset: PresetName) -> Self {
        Self::from_preset(preset.load())
    }

    /// The vessels of a preset, such as one read from a file, with seed 0, fitted to the organ.
    pub fn from_preset(preset: Preset) -> Self {
        Self {
            seed: 0,
            settings: preset.settings,
            arterial_roots: preset.arterial_roots,
            venous_roots: preset.venous_roots,
            tissue: preset.tissue,
            fit: preset.fit,
        }
    }

    /// Chooses another network.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Grows by other settings, with the same tissue and roots.
    #[must_use]
    pub fn with_settings(mut self, settings: ColonizationSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Puts the roots elsewhere.
    #[must_use]
    pub fn with_roots(mut self, arterial: RootPlacement, venous: RootPlacement) -> Self {
        self.arterial_roots = arterial;
        self.venous_roots = venous;
        self
    }

    /// Both root placements, in the form that a growth starts from.
    pub(crate) fn roots(&self) -> Roots {
        Roots { arterial: self.arterial_roots.clone(), venous: self.venous_roots.clone(), given: [None, None] }
    }
}

impl Default for Vasculature {
    fn default() -> Self {
        Self::new(PresetName::Paper)
    }
}

/// What the growth of an organ is at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, PartialEq)]
pub enum GrowthPhase {
    /// The organ has no mesh yet, or its mesh is still being loaded.
    #[default]
    WaitingForMesh,
    /// The mesh is made into a tissue, beside the frames.
    PreparingTissue,
    /// Steps are done, as the [budget](crate::plugin::GrowthBudget) allows. A paused growth is in this phase, too.
    Growing,
    /// All steps are done.
    Finished,
    /// Something is wrong with the mesh or the settings: [`GrowthState::error`] says what. Changing the culprit starts
    /// the growth again.
    Failed,
}

/// How far the growth of an organ is. For reading: the plugin writes it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct GrowthProgress {
    /// What is going on.
    pub phase: GrowthPhase,
    /// Steps done.
    pub step: u32,
    /// Steps that there are.
    pub steps: u32,
    /// Nodes grown so far: arterial, venous.
    pub nodes: [usize; 2],
    /// Drains that wait for a vessel: arterial, venous.
    pub drains: [usize; 2],
    /// Time spent in the steps alone, on this machine.
    pub grow_time: Duration,
}

impl GrowthProgress {
    /// Share of the steps that are done, from 0 to 1.
    pub fn fraction(&self) -> f32 {
        if self.steps == 0 { 0.0 } else { self.step as f32 / self.steps as f32 }
    }

    /// Nodes that a system has grown so far.
    pub fn nodes(&self, system: System) -> usize {
        self.nodes[system.index()]
    }

    /// Drains of a system that wait for a vessel.
    pub fn drains(&self, system: System) -> usize {
        self.drains[system.index()]
    }

    /// Whether all steps are done.
    pub fn is_finished(&self) -> bool {
        self.phase == GrowthPhase::Finished
    }
}

/// Whether an organ's growth goes on by itself. Set it at will, or send a
/// [`GrowthCommand`](crate::plugin::GrowthCommand).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub enum GrowthControl {
    /// Steps follow one another as the budget allows.
    #[default]
    Running,
    /// No step is done but those that are asked for. The tissue is prepared all the same.
    Paused,
}

impl GrowthControl {
    /// Pauses what runs, and lets run what is paused.
    pub fn toggle(&mut self) {
        *self = match self {
            Self::Running => Self::Paused,
            Self::Paused => Self::Running,
        };
    }
}

/// What the colour of a segment tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Default, Clone, PartialEq)]
pub enum SegmentColoring {
    /// Artery or vein.
    #[default]
    System,
    /// How thick it is.
    Radius,
    /// In which step it was born.
    Age,
    /// Its Strahler order: 1 for terminals, rising towards the root.
    StrahlerOrder,
    /// How much of its blood it still carries: the system's colour where that is all, pale where it is none. Of use once
    /// vessels are cut or clamped.
    Supply,
}

/// How an organ's vessels look.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct VesselAppearance {
    /// Colour of arteries. Default: a deep red.
    pub arterial: Color,
    /// Colour of veins. Default: a blue violet.
    pub venous: Color,
    /// What the colours tell. Default: the system.
    pub coloring: SegmentColoring,
    /// Whether the arteries are shown. Default: true.
    pub show_arterial: bool,
    /// Whether the veins are shown. Default: true.
    pub show_venous: bool,
}

impl VesselAppearance {
    /// Default colour of arteries: blood full of oxygen, seen through a wall.
    pub const DEFAULT_ARTERIAL: Color = Color::srgb(0.62, 0.05, 0.06);
    /// Default colour of veins: the blue violet in which textbooks and thin walls show them.
    pub const DEFAULT_VENOUS: Color = Color::srgb(0.25, 0.16, 0.47);

    /// The colour of a system.
    pub fn color(&self, system: System) -> Color {
        match system {
            System::Arterial => self.arterial,
            System::Venous => self.venous,
        }
    }

    /// Whether a system is shown.
    pub fn shows(&self, system: System) -> bool {
        match system {
            System::Arterial => self.show_arterial,
            System::Venous => self.show_venous,
        }
    }

    /// Shows a system, or hides it.
    pub fn set_shown(&mut self, system: System, shown: bool) {
        match system {
            System::Arterial => self.show_arterial = shown,
            System::Venous => self.show_venous = shown,
        }
    }
}

impl Default for VesselAppearance {
    fn default() -> Self {
        Self {
            arterial: Self::DEFAULT_ARTERIAL,
            venous: Self::DEFAULT_VENOUS,
            coloring: SegmentColoring::default(),
            show_arterial: true,
            show_venous: true,
        }
    }
}

/// The organ that the vessels on this entity belong to.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone, PartialEq)]
#[relationship(relationship_target = OrganVessels)]
pub struct VesselsOf(pub Entity);

/// The vessel entities of an organ, one per system. They are despawned with it.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[relationship_target(relationship = VesselsOf, linked_spawn)]
pub struct OrganVessels(Vec<Entity>);

impl OrganVessels {
    /// The vessel entities.
    pub fn entities(&self) -> &[Entity] {
        &self.0
    }
}

/// The system that a vessel entity's tree belongs to.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Clone, PartialEq)]
#[require(SegmentChanges, Transform, Visibility)]
pub struct VesselSystem(pub System);
