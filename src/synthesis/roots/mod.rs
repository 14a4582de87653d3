//! Where vessels enter the tissue.
//!
//! In: a [`Roots`] description, the tissue and the generator's [`RootSpacing`]. Out: the points at which each kind of
//! vessels begins. The seed decides everything that is chosen automatically ([`Stream::Roots`]).

mod error;
mod spread;
#[cfg(test)]
mod tests;
mod within;

pub use error::RootError;

use crate::synthesis::{
    mesh::is_usable,
    random::Stream,
    tissue::{Tissue, TissuePoint},
    tree::{ByKind, VesselKind, VesselTree},
};
use bevy_math::Vec3;
use std::ops::Index;

/// Where the roots of one kind of vessels are put.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum RootPlacement {
    /// No root: vessels of this kind don't grow, unless from a given tree.
    #[default]
    None,
    /// This many roots, spread over the tissue, chosen by the seed. The first is where the tissue has an
    /// [entrance](Tissue::entrance), if it has one.
    ///
    /// Limits: at most [`Roots::MAX_SPREAD`].
    Spread(u32),
    /// As many roots as it takes for all tissue to be within this many [equivalent diameters](crate::synthesis::tissue::Extent::equivalent_diameter)
    /// of one, measured along the tissue, chosen by the seed. A tissue with an [entrance](Tissue::entrance) has its only
    /// root there.
    ///
    /// Higher values give fewer roots, whose vessels have further to go. Step length, number of steps and growth of the
    /// tissue decide how far a vessel comes: about 0.7 times as far as a straight one on a surface, 0.55 times in a volume.
    /// A tissue of stages is measured in its first stage, in diameters of its last, to which lengths are fitted.
    ///
    /// Limits: at least [`Roots::LEAST_REACH`]. Usual: [`Roots::DEFAULT_REACH`].
    Within(f32),
    /// One root beside each root of the [companion](VesselKind::companion), a step length away, in a direction chosen by the
    /// seed. Roots of the companion's given tree count too.
    Beside,
    /// The tissue's nearest point to each of these.
    Nearest(Vec<Vec3>),
    /// Exactly these points. Each must be within [`RootSpacing::reach`] of the tissue.
    Exact(Vec<Vec3>),
}

/// Where the roots of each kind of vessels are put.
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

/// How all kinds of vessels begin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Roots {
    /// Where roots are put.
    pub placed: RootPlacements,
    /// Trees to go on growing from, besides the roots. An empty tree is none.
    pub given: ByKind<Option<VesselTree>>,
}

impl From<RootPlacements> for Roots {
    fn from(placed: RootPlacements) -> Self {
        Self { placed, given: ByKind::default() }
    }
}

/// The two lengths of a generator that the placement of its roots needs, in tissue lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RootSpacing {
    /// Distance of a root from the root that it is put beside: the length of a segment. Two roots much nearer than this
    /// coincide.
    pub step: f32,
    /// Largest distance from the tissue of a root whose place is given exactly.
    pub reach: f32,
}

impl Roots {
    /// Most roots that are spread automatically.
    pub const MAX_SPREAD: u32 = 4096;

    /// Largest distance of tissue from a root, measured along the tissue, in equivalent diameters. Discs, balls and surfaces
    /// of balls have no point further from any other, so that one root is enough.
    pub const DEFAULT_REACH: f32 = 1.15;
    /// Least value of that distance. Below it there are too few samples to measure by.
    pub const LEAST_REACH: f32 = 0.1;

    /// Distance, in step lengths, below which two roots coincide.
    const COINCIDENCE: f32 = 1.0e-4;

    /// The points at which each kind of vessels begins, without its given tree, on the tissue in force at step 1.
    ///
    /// # Errors
    /// The first root that cannot be put where it was asked for, or given tree that is out of reach.
    pub fn resolve(
        &self,
        tissue: &dyn Tissue,
        spacing: &ByKind<Option<RootSpacing>>,
        seed: u64,
    ) -> Result<ByKind<Vec<TissuePoint>>, RootError> {
        let diameter = tissue.extent().equivalent_diameter();
        let tissue = tissue.at_step(1);
        for (kind, spacing) in spacing.iter() {
            self.check_given(tissue, kind, spacing.as_ref())?;
        }
        let mut rng = Stream::Roots.rng(seed);
        let mut roots = ByKind::<Vec<TissuePoint>>::default();
        for kind in self.order()? {
            let placement = &self.placed[kind];
            let own = match spacing[kind] {
                Some(own) => own,
                None if *placement == RootPlacement::None => continue,
                None => return Err(RootError::NotGrown { kind }),
            };
            roots[kind] = match placement {
                RootPlacement::None => Vec::new(),
                RootPlacement::Spread(count) => spread::spread(tissue, kind, *count, &mut rng)?,
                RootPlacement::Within(reach) => {
                    check_reach(kind, *reach)?;
                    within::within(tissue, kind, reach * diameter, &mut rng)?
                }
                RootPlacement::Beside => {
                    let others = self.neighbours(tissue, kind.companion(), &roots);
                    others.iter().map(|root| spread::beside(tissue, root, own.step, &mut rng)).collect()
                }
                RootPlacement::Nearest(points) => nearest(tissue, kind, points)?,
                RootPlacement::Exact(points) => exact(tissue, kind, points, own.reach)?,
            };
        }
        check_allowed(&roots, tissue)?;
        check_apart(&roots, spacing)?;
        Ok(roots)
    }

    /// The kinds in an order in which a kind comes before those that are put beside it.
    fn order(&self) -> Result<impl Iterator<Item = VesselKind>, RootError> {
        let is_beside = |kind: VesselKind| self.placed[kind] == RootPlacement::Beside;
        if is_beside(VesselKind::Artery) && is_beside(VesselKind::Artery.companion()) {
            return Err(RootError::BesideEachOther);
        }
        let mut order = VesselKind::ALL;
        order.sort_by_key(|&kind| is_beside(kind));
        Ok(order.into_iter())
    }

    /// The roots of a kind, those of its given tree included.
    fn neighbours(&self, tissue: &dyn Tissue, kind: VesselKind, roots: &ByKind<Vec<TissuePoint>>) -> Vec<TissuePoint> {
        let given = self.given[kind].iter().flat_map(|tree| tree.roots().map(|root| tree.positions()[root]));
        roots[kind].iter().copied().chain(given.map(|position| tissue.closest_point(position))).collect()
    }

    fn check_given(
        &self,
        tissue: &dyn Tissue,
        kind: VesselKind,
        spacing: Option<&RootSpacing>,
    ) -> Result<(), RootError> {
        let Some(tree) = self.given[kind].as_ref().filter(|tree| !tree.is_empty()) else { return Ok(()) };
        let reach = spacing.ok_or(RootError::NotGrown { kind })?.reach;
        if let Some(node) = tree.positions().iter().position(|&position| !is_usable(position)) {
            return Err(RootError::GivenNotFinite { kind, node, position: tree.positions()[node] });
        }
        let mut least = f32::INFINITY;
        for &position in tree.positions() {
            least = least.min(tissue.closest_point(position).position.distance(position));
            if least <= reach {
                return Ok(());
            }
        }
        Err(RootError::GivenTooFar { kind, distance: least, reach })
    }
}

fn nearest(tissue: &dyn Tissue, kind: VesselKind, points: &[Vec3]) -> Result<Vec<TissuePoint>, RootError> {
    check_finite(kind, points)?;
    Ok(points.iter().map(|&position| tissue.closest_point(position)).collect())
}

fn exact(tissue: &dyn Tissue, kind: VesselKind, points: &[Vec3], reach: f32) -> Result<Vec<TissuePoint>, RootError> {
    check_finite(kind, points)?;
    let place = |&position: &Vec3| {
        let closest = tissue.closest_point(position);
        let distance = closest.position.distance(position);
        if distance > reach {
            return Err(RootError::TooFar { kind, position, distance, reach });
        }
        Ok(TissuePoint { position, normal: closest.normal })
    };
    points.iter().map(place).collect()
}

fn check_reach(kind: VesselKind, reach: f32) -> Result<(), RootError> {
    let usable = reach.is_finite() && reach >= Roots::LEAST_REACH;
    if usable { Ok(()) } else { Err(RootError::Reach { kind, reach, least: Roots::LEAST_REACH }) }
}

fn check_finite(kind: VesselKind, points: &[Vec3]) -> Result<(), RootError> {
    match points.iter().find(|point| !is_usable(**point)) {
        Some(&position) => Err(RootError::NotFinite { kind, position }),
        None => Ok(()),
    }
}

/// Refuses roots where no vessel may be.
fn check_allowed(roots: &ByKind<Vec<TissuePoint>>, tissue: &dyn Tissue) -> Result<(), RootError> {
    let Some(no_go) = tissue.no_go() else { return Ok(()) };
    for (kind, roots) in roots.iter() {
        if let Some(root) = roots.iter().find(|root| no_go.forbids(root.position)) {
            return Err(RootError::Forbidden { kind, position: root.position });
        }
    }
    Ok(())
}

/// Refuses roots at the same place, of one kind or of two.
fn check_apart(roots: &ByKind<Vec<TissuePoint>>, spacing: &ByKind<Option<RootSpacing>>) -> Result<(), RootError> {
    let step = spacing.values().flatten().map(|spacing| spacing.step).fold(f32::INFINITY, f32::min);
    let of_kind = |(kind, roots): (VesselKind, &Vec<TissuePoint>)| -> Vec<_> {
        roots.iter().map(|root| (kind, root.position)).collect()
    };
    let mut all: Vec<(VesselKind, Vec3)> = roots.iter().flat_map(of_kind).collect();
    // Sorted along x, only neighbours within the distance need to be compared.
    all.sort_by(|a, b| a.1.x.total_cmp(&b.1.x));
    let limit = Roots::COINCIDENCE * step;
    for (index, &(kind, position)) in all.iter().enumerate() {
        let near = all[index + 1..].iter().take_while(|(_, other)| other.x - position.x <= limit);
        for &(other, second) in near {
            if second.distance(position) <= limit {
                return Err(RootError::Coincide { kinds: [kind, other], position });
            }
        }
    }
    Ok(())
}
