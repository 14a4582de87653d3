//! The appearance of vessels, set on their organ.

use crate::{
    plugin::vessels::{relations::OrganVessels, tree::Vessels},
    synthesis::tree::{ByKind, VesselKind},
};
use bevy::{
    camera::visibility::Visibility,
    color::Color,
    ecs::{
        change_detection::DetectChangesMut, component::Component, query::Changed, reflect::ReflectComponent,
        system::Query,
    },
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// The meaning of a segment's colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum SegmentColoring {
    /// Its kind of vessel.
    #[default]
    Kind,
    /// Its radius.
    Radius,
    /// The step in which it was born.
    Age,
    /// Its Strahler order: 1 for terminals, rising towards the root.
    StrahlerOrder,
    /// Share of its blood flow that is left: the kind's colour for all, pale for none. Useful once vessels are cut or
    /// clamped.
    Supply,
}

/// The appearance of an organ's vessels.
#[derive(Component, Clone, Debug, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct VesselAppearance {
    /// Colour of each kind of vessels. An alpha below 1 makes them translucent, whatever their colours mean.
    ///
    /// Segments overlap at their joints, which shows where they are translucent. Closed meshes, of a
    /// [`VesselSurface`](crate::plugin::VesselSurface), don't.
    ///
    /// Default: [`Self::DEFAULT_COLORS`].
    pub colors: ByKind<Color>,
    /// The meaning of the colours. Default: the kind.
    pub coloring: SegmentColoring,
    /// Which kinds are shown. Default: all.
    pub shown: ByKind<bool>,
}

impl VesselAppearance {
    /// Default colours. Arteries: oxygenated blood, seen through a wall. Veins: the blue violet of textbooks and thin
    /// walls. Portal veins: the same, darker. Ducts: the green of bile.
    pub const DEFAULT_COLORS: ByKind<Color> = ByKind {
        artery: Color::srgb(0.62, 0.05, 0.06),
        vein: Color::srgb(0.25, 0.16, 0.47),
        portal_vein: Color::srgb(0.17, 0.13, 0.40),
        duct: Color::srgb(0.30, 0.42, 0.14),
    };

    /// The visibility of the vessel entity of a kind.
    pub(crate) fn visibility(&self, kind: VesselKind) -> Visibility {
        if self.shown[kind] { Visibility::Inherited } else { Visibility::Hidden }
    }
}

impl Default for VesselAppearance {
    fn default() -> Self {
        Self { colors: Self::DEFAULT_COLORS, coloring: SegmentColoring::default(), shown: ByKind::from_fn(|_| true) }
    }
}

/// Publish: shows or hides kinds of vessels as the organ's appearance says.
pub(crate) fn show_kinds(
    organs: Query<(&VesselAppearance, &OrganVessels), Changed<VesselAppearance>>,
    mut vessels: Query<(&Vessels, &mut Visibility)>,
) {
    for (appearance, entities) in &organs {
        let mut vessels = vessels.iter_many_mut(entities.entities());
        while let Some((vessels, mut visibility)) = vessels.fetch_next() {
            visibility.set_if_neq(appearance.visibility(vessels.kind()));
        }
    }
}
