//! How the vessels of a network look in a texture.

use super::error::BakeError;
use crate::synthesis::tree::VesselKind;

/// How the vessels of a network look in a texture.
///
/// Lengths are in radii of the vessel where they are said to be, so that the same look serves organs of any size.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct VesselLook {
    /// Colour of the thinnest vessels of the network, linear sRGB.
    ///
    /// Limits: 0 to 1. Default: that of the kind of vessels.
    pub thin_color: [f32; 3],
    /// Colour of the widest ones. In between, colours change with the logarithm of the radius.
    ///
    /// Limits: 0 to 1. Default: that of the kind of vessels.
    pub wide_color: [f32; 3],
    /// Colour that vessels take on with depth: bluer, as red light is what tissue lets through to them and back.
    ///
    /// Limits: 0 to 1. Default: that of the kind of vessels.
    pub deep_color: [f32; 3],
    /// Opacity of a vessel at the surface. Lower values let more of the tissue show.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_STRENGTH`].
    pub strength: f32,
    /// Depth of a vessel's axis below the place where it was grown.
    ///
    /// Higher values make wide vessels bluer, paler and softer than thin ones. Vessels that grew in a volume have a
    /// depth of their own, to which this is added.
    ///
    /// Units: radii. Limits: 0 to 20. Default: [`Self::DEFAULT_DEPTH`].
    pub depth: f32,
    /// Standard deviation of the blur of a vessel at the surface. 0 leaves edges as sharp as the texels allow.
    ///
    /// Units: radii. Limits: 0 to 4. Default: [`Self::DEFAULT_BLUR`].
    pub blur: f32,
    /// How much the standard deviation of the blur grows with depth, as tissue scatters light; up to
    /// [`Self::MOST_SPREAD`] radii, where a vessel has lost half of its contrast.
    ///
    /// Units: lengths per length of depth. Limits: 0 to 4. Default: [`Self::DEFAULT_SCATTER`].
    pub scatter: f32,
    /// Depth at which vessels are no longer seen. They fade on the way there. As far above the surface they are not
    /// taken as belonging to it. A distance within [`Self::CHORD_DEPTH`] of a segment's length counts as none.
    ///
    /// Units: tissue lengths. Limits: at least 0; 0 stands for [`Self::AUTOMATIC_DEPTH`] radii of each segment.
    /// Default: 0.
    pub max_depth: f32,
    /// Height to which a vessel at the surface raises it. It falls with depth, as the strength does.
    ///
    /// Units: radii. Limits: −4 to 4; below 0 vessels lie in grooves. Default: [`Self::DEFAULT_BUMP`].
    pub bump: f32,
    /// Perceptual roughness of the surface over a vessel.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_ROUGHNESS`].
    pub roughness: f32,
    /// Length over which vessels fade out towards tips and roots, so that they don't end bluntly.
    ///
    /// Units: radii of the end. Limits: 0 to 1000; at 0 ends are round. Default: [`Self::DEFAULT_FADE`].
    pub fade: f32,
}

impl VesselLook {
    /// Opacity that gives vessels 10 to 25 % contrast with a mucosa.
    pub const DEFAULT_STRENGTH: f32 = 0.6;
    /// Just below the surface.
    pub const DEFAULT_DEPTH: f32 = 1.0;
    /// Edges as sharp as those of superficial vessels in endoscopy.
    pub const DEFAULT_BLUR: f32 = 0.25;
    /// A third of the depth: the order of a path length of red light in tissue.
    pub const DEFAULT_SCATTER: f32 = 0.35;
    /// Radii in the depth at which a segment is no longer seen, if [`max_depth`](Self::max_depth) is 0.
    pub const AUTOMATIC_DEPTH: f32 = 4.0;
    /// Share of a segment's length by which it may lie off the surface that it was grown on: the height of an arc over a
    /// chord as long as 1.4 radii of the arc.
    pub const CHORD_DEPTH: f32 = 0.2;
    /// Radii at which scatter ends to blur.
    pub const MOST_SPREAD: f32 = 1.5;
    /// A slight relief: vessels lie in the wall, not on it.
    pub const DEFAULT_BUMP: f32 = 0.15;
    /// A wet surface.
    pub const DEFAULT_ROUGHNESS: f32 = 0.35;
    /// Twelve radii of a tip.
    pub const DEFAULT_FADE: f32 = 12.0;

    /// The look of a kind of vessels: arteries red, veins bluish and softer, portal veins violet, ducts greenish.
    pub fn of(kind: VesselKind) -> Self {
        let base = Self {
            thin_color: [0.45, 0.03, 0.02],
            wide_color: [0.30, 0.015, 0.015],
            deep_color: [0.16, 0.03, 0.08],
            strength: Self::DEFAULT_STRENGTH,
            depth: Self::DEFAULT_DEPTH,
            blur: Self::DEFAULT_BLUR,
            scatter: Self::DEFAULT_SCATTER,
            max_depth: 0.0,
            bump: Self::DEFAULT_BUMP,
            roughness: Self::DEFAULT_ROUGHNESS,
            fade: Self::DEFAULT_FADE,
        };
        match kind {
            VesselKind::Artery => base,
            VesselKind::Vein => Self {
                thin_color: [0.26, 0.04, 0.07],
                wide_color: [0.10, 0.03, 0.09],
                deep_color: [0.07, 0.05, 0.14],
                depth: 2.0,
                blur: 0.4,
                ..base
            },
            VesselKind::PortalVein => Self {
                thin_color: [0.22, 0.03, 0.09],
                wide_color: [0.09, 0.02, 0.10],
                deep_color: [0.07, 0.04, 0.14],
                depth: 2.0,
                blur: 0.4,
                ..base
            },
            VesselKind::Duct => Self {
                thin_color: [0.30, 0.26, 0.05],
                wide_color: [0.18, 0.17, 0.03],
                deep_color: [0.10, 0.12, 0.06],
                ..base
            },
        }
    }

    /// Standard deviation of the blur of a vessel of some radius at some depth.
    pub(super) fn blur_at(&self, radius: f32, depth: f32) -> f32 {
        let spread = self.scatter * depth;
        self.blur * radius + spread.min((Self::MOST_SPREAD - self.blur).max(0.0) * radius)
    }

    /// Blur of the height in radii, besides that of the vessel: it makes a mound of a plateau.
    pub(super) const MOUND: f32 = 0.5;

    /// Standard deviation of the wider one of colour and height, for that of the colour.
    pub(super) fn with_mound(&self, sigma: f32, radius: f32) -> f32 {
        if self.bump == 0.0 {
            return sigma;
        }
        let mound = Self::MOUND * radius;
        (sigma * sigma + mound * mound).sqrt()
    }

    /// Checks all settings.
    ///
    /// # Errors
    /// The first value out of its limits.
    pub fn validate(&self) -> Result<(), BakeError> {
        let check = |name, value: f32, low: f32, high: f32, limits| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(BakeError::Setting { name, value, limits }),
        };
        for (name, color) in
            [("thin_color", self.thin_color), ("wide_color", self.wide_color), ("deep_color", self.deep_color)]
        {
            color.into_iter().try_for_each(|channel| check(name, channel, 0.0, 1.0, "0 to 1 in each channel"))?;
        }
        check("strength", self.strength, 0.0, 1.0, "0 to 1")?;
        check("depth", self.depth, 0.0, 20.0, "0 to 20 radii")?;
        check("blur", self.blur, 0.0, 4.0, "0 to 4 radii")?;
        check("scatter", self.scatter, 0.0, 4.0, "0 to 4 lengths per length of depth")?;
        check("max_depth", self.max_depth, 0.0, f32::MAX, "finite and at least 0 tissue lengths; 0 chooses a depth")?;
        check("bump", self.bump, -4.0, 4.0, "−4 to 4 radii")?;
        check("roughness", self.roughness, 0.0, 1.0, "0 to 1")?;
        check("fade", self.fade, 0.0, 1000.0, "0 to 1000 radii")
    }
}

impl Default for VesselLook {
    fn default() -> Self {
        Self::of(VesselKind::Artery)
    }
}
