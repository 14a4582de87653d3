//! What a user asks of the surface of an organ's vessels.

use crate::synthesis::surface::SurfaceSettings;
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// Gives an organ's vessels a closed mesh, as soon as they have grown. Put it beside the organ's
/// [`Vasculature`](crate::plugin::Vasculature), or on an organ with vessels of your own.
///
/// Each of its vessel entities gets a [`VesselMesh`](crate::plugin::VesselMesh). The segments that were drawn while the
/// vessels grew give way to the mesh, and come back at once if the vessels change: until a new mesh is ready, after a
/// cut, say, they show the change. The mesh follows a deformed organ, and needs no storage buffers, so that it is drawn
/// in WebGL 2, too.
///
/// An organ without it has no cost from it. Removing it stops what is under way, and brings the segments back.
///
/// ```
/// # use bevy_vessels::{plugin::{Vasculature, VesselSurface}, synthesis::preset::PresetName};
/// let organ = (Vasculature::new(PresetName::Liver), VesselSurface::default());
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct VesselSurface {
    /// How fine the mesh is. Changing it makes a new mesh; until that is ready, the old one is shown.
    pub settings: SurfaceSettings,
    /// When the mesh is made. Default: [`SurfaceMoment::WhenGrown`].
    pub when: SurfaceMoment,
    /// What is shown once there is a mesh. Default: [`SurfaceShown::Mesh`].
    pub shows: SurfaceShown,
    /// Coarser meshes for distant views; `None` for one mesh at all distances.
    ///
    /// Default: [`SurfaceDetail::default`].
    pub detail: Option<SurfaceDetail>,
}

impl Default for VesselSurface {
    fn default() -> Self {
        let (when, shows) = (SurfaceMoment::default(), SurfaceShown::default());
        Self { settings: SurfaceSettings::default(), when, shows, detail: Some(SurfaceDetail::default()) }
    }
}

/// When the surface of an organ's vessels is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum SurfaceMoment {
    /// When the vessels have grown, and again after a cut or another change.
    #[default]
    WhenGrown,
    /// When asked for, by [`SurfaceCommand`](crate::plugin::SurfaceCommand) or
    /// [`SurfaceCommandsExt`](crate::plugin::SurfaceCommandsExt), and again when these vessels are cut. Vessels that
    /// grew again have to be asked for again.
    OnDemand,
}

/// What is shown of vessels that have a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum SurfaceShown {
    /// The mesh. If the [colours](crate::plugin::VesselAppearance::coloring) mean something other than the kind of the
    /// vessels, the segments, which alone have such colours.
    #[default]
    Mesh,
    /// The segments, as during growth. The mesh is made all the same, and can be saved.
    Preview,
}

/// The distances at which coarser meshes take over.
///
/// There are three meshes, made of the same tree: the one that was asked for, a closed one without subdivisions
/// ([`Surface::coarse`](crate::synthesis::surface::Surface::coarse)), and a prism for each branch
/// ([`Surface::sketch`](crate::synthesis::surface::Surface::sketch)). Around each distance both are drawn in a pattern of
/// pixels, so that nothing pops.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Default, Clone, PartialEq)]
pub struct SurfaceDetail {
    /// Distance from the middle of the vessels at which the second mesh takes over, and then the third.
    ///
    /// Higher values draw distant vessels finer and slower.
    ///
    /// Units: the vessels' size, the diagonal of the box around them. Limits: > 0, rising. Default:
    /// [`Self::DEFAULT_DISTANCES`].
    pub distances: [f32; 2],
    /// Length of the way along which one mesh gives way to the next, as a share of the distance at which that begins.
    ///
    /// Higher values are smoother, and draw both meshes for longer. 0 switches at once.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_FADE`].
    pub fade: f32,
}

impl SurfaceDetail {
    /// Default of [`distances`](Self::distances): in a picture of a thousand lines, the outline changes by less than a
    /// pixel.
    pub const DEFAULT_DISTANCES: [f32; 2] = [2.0, 6.0];
    /// Default of [`fade`](Self::fade).
    pub const DEFAULT_FADE: f32 = 0.25;
    /// Number of meshes.
    pub const LEVELS: usize = 3;

    /// The range of distances of each level, in sizes: where it begins to appear, is whole, begins to vanish, is gone.
    /// Values outside their limits are clamped.
    pub fn ranges(&self) -> [[f32; 4]; Self::LEVELS] {
        let usable = |value: f32, least: f32| if value.is_nan() { least } else { value.clamp(least, f32::MAX) };
        let fade = 1.0 + if self.fade.is_nan() { 0.0 } else { self.fade.clamp(0.0, 1.0) };
        let end = |begin: f32| (begin * fade).min(f32::MAX);
        let first = usable(self.distances[0], 0.0);
        let second = usable(self.distances[1], end(first));
        let [a, b, c, d] = [first, end(first), second, end(second)];
        [[0.0, 0.0, a, b], [a, b, c, d], [c, d, f32::MAX, f32::MAX]]
    }
}

impl Default for SurfaceDetail {
    fn default() -> Self {
        Self { distances: Self::DEFAULT_DISTANCES, fade: Self::DEFAULT_FADE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_level_begins_where_the_one_before_ends_whatever_is_asked_for() {
        let wild = [0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX, 3.0];
        for first in wild {
            for second in wild {
                for fade in wild {
                    let ranges = SurfaceDetail { distances: [first, second], fade }.ranges();
                    assert!(ranges.windows(2).all(|pair| pair[0][2..] == pair[1][..2]), "{ranges:?}");
                    let rises = |range: &[f32; 4]| range.windows(2).all(|pair| pair[0] <= pair[1]);
                    assert!(ranges.iter().all(rises), "{ranges:?}");
                }
            }
        }
    }
}
