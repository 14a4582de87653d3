//! The user's placements of roots, and the generator's spacing.

use crate::synthesis::organ::RootSites;
use crate::synthesis::tree::{ByKind, VesselKind, VesselTree};
use bevy_math::Vec3;
use std::ops::{Index, IndexMut};

/// Placement of the roots of one kind of vessels.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum RootPlacement {
    /// No root: vessels of this kind grow only from a given tree.
    #[default]
    None,
    /// This many roots, spread over the tissue, chosen by the seed. The first is at the tissue's [entrance], if it has
    /// one.
    ///
    /// Limits: at most [`Roots::MAX_SPREAD`].
    ///
    /// [entrance]: crate::synthesis::tissue::Tissue::entrance
    Spread(u32),
    /// As many roots as needed for all tissue to be within this many [equivalent diameters] of one, measured along the
    /// tissue, chosen by the seed. A tissue with an [entrance] has its only root there.
    ///
    /// Higher values give fewer roots, whose vessels must grow further. Step length, number of steps and growth of the
    /// tissue limit how far a vessel grows: about 0.7 times as far as a straight one on a surface, 0.55 times in a
    /// volume. A staged tissue is measured in its first stage, in diameters of its last, to which lengths are fitted.
    ///
    /// Limits: at least [`Roots::LEAST_REACH`]. Usual: [`Roots::DEFAULT_REACH`].
    ///
    /// [equivalent diameters]: crate::synthesis::tissue::Extent::equivalent_diameter
    /// [entrance]: crate::synthesis::tissue::Tissue::entrance
    Within(f32),
    /// One root at the floor of the tissue's deepest hollow, as vessels enter a kidney or a liver at its hilum; in a
    /// tissue without a hollow, one chosen by the seed, as with [`Spread`](Self::Spread). The place is found with random
    /// samples of the tissue, which are the same for all seeds.
    Hilum,
    /// One root beside each root of the [companion](VesselKind::companion), a step length away, in a direction chosen by the
    /// seed. Roots of the companion's given tree count too.
    Beside,
    /// The tissue's nearest point to each of these.
    Nearest(Vec<Vec3>),
    /// Exactly these points. Each must be within [`RootSpacing::reach`] of the tissue.
    Exact(Vec<Vec3>),
}

/// Placements of the roots of each kind of vessels.
///
/// The default is one artery, chosen by the seed, with a vein beside it; in a long organ several of them.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct RootPlacements {
    /// Roots of the arteries.
    ///
    /// Default: one, chosen by the seed; in a long organ several.
    pub artery: RootPlacement,
    /// Roots of the veins.
    ///
    /// Default: beside the arteries'.
    pub vein: RootPlacement,
    /// Roots of the portal veins.
    ///
    /// Default: none.
    pub portal_vein: RootPlacement,
    /// Roots of the ducts.
    ///
    /// Default: none.
    pub duct: RootPlacement,
}

impl Default for RootPlacements {
    fn default() -> Self {
        Self {
            artery: RootPlacement::Within(Roots::DEFAULT_REACH),
            vein: RootPlacement::Beside,
            portal_vein: RootPlacement::None,
            duct: RootPlacement::None,
        }
    }
}

impl From<&RootSites> for RootPlacements {
    /// Roots at the places of an organ, at the tissue's nearest points; none of the kinds that have no place.
    fn from(sites: &RootSites) -> Self {
        let [artery, vein, portal_vein, duct] =
            [&sites.arterial, &sites.venous, &sites.portal, &sites.ductal].map(|points| match points.is_empty() {
                true => RootPlacement::None,
                false => RootPlacement::Nearest(points.clone()),
            });
        Self { artery, vein, portal_vein, duct }
    }
}

impl Index<VesselKind> for RootPlacements {
    type Output = RootPlacement;

    fn index(&self, kind: VesselKind) -> &RootPlacement {
        match kind {
            VesselKind::Artery => &self.artery,
            VesselKind::Vein => &self.vein,
            VesselKind::PortalVein => &self.portal_vein,
            VesselKind::Duct => &self.duct,
        }
    }
}

impl IndexMut<VesselKind> for RootPlacements {
    fn index_mut(&mut self, kind: VesselKind) -> &mut RootPlacement {
        match kind {
            VesselKind::Artery => &mut self.artery,
            VesselKind::Vein => &mut self.vein,
            VesselKind::PortalVein => &mut self.portal_vein,
            VesselKind::Duct => &mut self.duct,
        }
    }
}

/// The roots and given trees of all kinds of vessels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Roots {
    /// Where roots are put.
    pub placed: RootPlacements,
    /// Trees from which growth continues, besides the roots. An empty tree counts as none.
    pub given: ByKind<Option<VesselTree>>,
}

impl Roots {
    /// Most roots that are spread automatically.
    pub const MAX_SPREAD: u32 = 4096;

    /// Largest distance of tissue from a root, measured along the tissue, in equivalent diameters. Discs, balls and
    /// surfaces of balls have no points further apart, so one root is enough.
    pub const DEFAULT_REACH: f32 = 1.15;
    /// Least value of that distance. Below it there are too few samples to measure it.
    pub const LEAST_REACH: f32 = 0.1;
}

impl From<RootPlacements> for Roots {
    fn from(placed: RootPlacements) -> Self {
        Self { placed, given: ByKind::default() }
    }
}

/// The two lengths of a generator that the placement of its roots needs, in tissue lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RootSpacing {
    /// Distance of a root from the root beside which it is placed: the length of a segment. Two roots much nearer than
    /// this coincide.
    pub step: f32,
    /// Largest distance from the tissue of a root with an exact place.
    pub reach: f32,
}
