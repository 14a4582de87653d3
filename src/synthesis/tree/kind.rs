//! Kinds of vessels, and one value for each kind.

use std::ops::{Index, IndexMut};

/// The kind of vessels in a tree.
///
/// An organ has at most one tree, or forest, of each kind. The generator of its vessels decides which: space
/// colonization grows arteries and veins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum VesselKind {
    /// Brings oxygen.
    Artery,
    /// Takes carbon dioxide away.
    Vein,
    /// Brings blood from another organ's bed, for example from the gut to the liver.
    PortalVein,
    /// Carries a product of the organ, such as bile, instead of blood.
    Duct,
}

impl VesselKind {
    /// Number of kinds.
    pub const COUNT: usize = 4;
    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; Self::COUNT] = [Self::Artery, Self::Vein, Self::PortalVein, Self::Duct];

    /// Number of the kind, from 0, as in [`ALL`](Self::ALL).
    pub fn index(self) -> usize {
        self as usize
    }

    /// Adjective in lower case, as in file names and messages: `arterial`, `venous`, `portal`, `ductal`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Artery => "arterial",
            Self::Vein => "venous",
            Self::PortalVein => "portal",
            Self::Duct => "ductal",
        }
    }

    /// The vessels of this kind, as a title: `Arteries`.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Artery => "Arteries",
            Self::Vein => "Veins",
            Self::PortalVein => "Portal veins",
            Self::Duct => "Ducts",
        }
    }

    /// Whether vessels of this kind carry blood.
    pub fn carries_blood(self) -> bool {
        self != Self::Duct
    }

    /// The kind that accompanies this kind: arteries and veins run beside each other, the others beside arteries.
    pub fn companion(self) -> Self {
        if self == Self::Artery { Self::Vein } else { Self::Artery }
    }
}

/// One value for each [`VesselKind`].
///
/// ```
/// use bevy_vessels::synthesis::tree::{ByKind, VesselKind};
///
/// let mut nodes = ByKind::<usize>::default();
/// nodes[VesselKind::Artery] = 12;
/// assert_eq!(nodes.values().sum::<usize>(), 12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ByKind<T> {
    /// The value for arteries.
    pub artery: T,
    /// The value for veins.
    pub vein: T,
    /// The value for portal veins.
    pub portal_vein: T,
    /// The value for ducts.
    pub duct: T,
}

impl<T> ByKind<T> {
    /// Values from a function of the kind.
    pub fn from_fn(mut value: impl FnMut(VesselKind) -> T) -> Self {
        Self {
            artery: value(VesselKind::Artery),
            vein: value(VesselKind::Vein),
            portal_vein: value(VesselKind::PortalVein),
            duct: value(VesselKind::Duct),
        }
    }

    /// The values in the order of [`VesselKind::ALL`].
    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.iter().map(|(_, value)| value)
    }

    /// The values in the order of [`VesselKind::ALL`], to be changed.
    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut T> {
        let Self { artery, vein, portal_vein, duct } = self;
        [artery, vein, portal_vein, duct].into_iter()
    }

    /// Every kind with its value.
    pub fn iter(&self) -> impl Iterator<Item = (VesselKind, &T)> {
        VesselKind::ALL.into_iter().map(|kind| (kind, &self[kind]))
    }

    /// References to the values.
    pub fn as_ref(&self) -> ByKind<&T> {
        ByKind { artery: &self.artery, vein: &self.vein, portal_vein: &self.portal_vein, duct: &self.duct }
    }

    /// References to the values, to be changed.
    pub fn as_mut(&mut self) -> ByKind<&mut T> {
        let Self { artery, vein, portal_vein, duct } = self;
        ByKind { artery, vein, portal_vein, duct }
    }

    /// Maps each value by a function.
    pub fn map<U>(self, mut change: impl FnMut(VesselKind, T) -> U) -> ByKind<U> {
        ByKind {
            artery: change(VesselKind::Artery, self.artery),
            vein: change(VesselKind::Vein, self.vein),
            portal_vein: change(VesselKind::PortalVein, self.portal_vein),
            duct: change(VesselKind::Duct, self.duct),
        }
    }
}

impl<T> Index<VesselKind> for ByKind<T> {
    type Output = T;

    fn index(&self, kind: VesselKind) -> &T {
        match kind {
            VesselKind::Artery => &self.artery,
            VesselKind::Vein => &self.vein,
            VesselKind::PortalVein => &self.portal_vein,
            VesselKind::Duct => &self.duct,
        }
    }
}

impl<T> IndexMut<VesselKind> for ByKind<T> {
    fn index_mut(&mut self, kind: VesselKind) -> &mut T {
        match kind {
            VesselKind::Artery => &mut self.artery,
            VesselKind::Vein => &mut self.vein,
            VesselKind::PortalVein => &mut self.portal_vein,
            VesselKind::Duct => &mut self.duct,
        }
    }
}
