//! What a user asks of the texture of an organ.

use crate::synthesis::{
    texture::{BakeSettings, VesselLook},
    tree::VesselKind,
};
use bevy::{
    asset::Handle,
    ecs::{component::Component, reflect::ReflectComponent},
    image::Image,
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::collections::BTreeMap;

/// Paints an organ's vessels into its texture, as soon as they have grown. Put it beside the organ's
/// [`Vasculature`](crate::plugin::Vasculature), or on an organ with vessels of your own. The organ's mesh needs texture
/// coordinates that lay it out without overlaps, and tangents if the map of normals is to be drawn.
///
/// The maps are in [`VesselMaps`](crate::plugin::VesselMaps). Where there is a renderer, they take the place of those of the organ's
/// `StandardMaterial`, which comes back when the texture is no longer shown. The vessels that were drawn while they grew
/// give way to the texture, and come back if they grow again. A cut does not change the texture.
///
/// An organ without it has no cost from it. Removing it stops what is under way, and brings the vessels back.
///
/// ```
/// # use bevy_vessels::{plugin::{Vasculature, VesselTexture}, synthesis::preset::PresetName};
/// let organ = (Vasculature::new(PresetName::Colon), VesselTexture::default());
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct VesselTexture {
    /// How large the maps are, and which ones are made. Changing it makes new maps; until these are ready, the old ones
    /// are shown.
    pub settings: BakeSettings,
    /// How vessels look, by kind. Kinds that are missing look as [`VesselLook::of`] says.
    pub looks: BTreeMap<VesselKind, VesselLook>,
    /// What is shown once there are maps. Default: [`TextureShown::Texture`].
    pub shows: TextureShown,
}

impl VesselTexture {
    /// How vessels of a kind look.
    pub fn look(&self, kind: VesselKind) -> VesselLook {
        self.looks.get(&kind).cloned().unwrap_or_else(|| VesselLook::of(kind))
    }
}

/// What is shown of an organ whose vessels are in its texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum TextureShown {
    /// The texture alone.
    #[default]
    Texture,
    /// The texture, and the vessels as they grew or as closed meshes.
    Both,
    /// The vessels alone. The maps are made all the same.
    Vessels,
}

/// What lies between the vessels in an organ's texture. Where there is a renderer, an organ that has none gets the
/// picture, colour and roughness of its `StandardMaterial`; elsewhere, the bake's settings say them.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, PartialEq)]
pub struct TextureBase {
    /// A picture, laid out like the organ's texture; `None` for the colour alone.
    pub image: Option<Handle<Image>>,
    /// The colour, in linear sRGB, without a picture. Limits: 0 to 1 in each channel.
    pub color: [f32; 3],
    /// Roughness. Limits: 0 to 1.
    pub roughness: f32,
}
