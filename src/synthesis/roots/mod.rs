//! Where vessels enter the tissue.
//!
//! In come a [`Roots`] description, the tissue and the growth's settings; out come the points at which the arteries and
//! the veins begin. Whatever is chosen automatically follows from the seed ([`Stream::Roots`]).

mod error;
mod spread;
#[cfg(test)]
mod tests;
mod within;

pub use error::RootError;

use crate::synthesis::{
    colonization::{ColonizationSettings, SystemSettings},
    mesh::is_usable,
    rng::Stream,
    tissue::{Tissue, TissuePoint},
    tree::{System, VesselTree},
};
use bevy_math::Vec3;

/// Where the roots of one system are put.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum RootPlacement {
    /// No root: this system does not grow, unless from a given tree.
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
    /// Higher values give fewer roots, whose vessels have further to go; how far they come in the steps they have is up to
    /// step length, steps and growth of the tissue: some 0.7 times the way of a straight vessel on a surface, 0.55 in a
    /// volume. A tissue of stages is measured by the one in force first, in diameters of the last, by which lengths are
    /// fitted.
    ///
    /// Limits: at least [`Roots::LEAST_REACH`]. Usual: [`Roots::DEFAULT_REACH`].
    Within(f32),
    /// One root beside each root of the other system, a step length away, in a direction chosen by the seed. Roots of the
    /// other system's given tree count too.
    #[default]
    Beside,
    /// The tissue's nearest point to each of these.
    Nearest(Vec<Vec3>),
    /// Exactly these points. Each must be within the system's influence distance of the tissue.
    Exact(Vec<Vec3>),
}

/// How both systems begin.
///
/// The default is one artery, chosen by the seed, with a vein beside it; in a long organ several of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Roots {
    /// Roots of the arteries.
    pub arterial: RootPlacement,
    /// Roots of the veins.
    pub venous: RootPlacement,
    /// Trees to go on growing from, besides the roots: arterial, venous. An empty tree is none.
    pub given: [Option<VesselTree>; 2],
}

impl Default for Roots {
    fn default() -> Self {
        Self {
            arterial: RootPlacement::Within(Self::DEFAULT_REACH),
            venous: RootPlacement::Beside,
            given: [None, None],
        }
    }
}

impl Roots {
    /// Most roots that are spread automatically.
    pub const MAX_SPREAD: u32 = 4096;

    /// How far from a root, along the tissue, there may be tissue, in equivalent diameters. The furthest points of a disc,
    /// a ball and the surface of a ball are nearer than that, so they have one root.
    pub const DEFAULT_REACH: f32 = 1.15;
    /// The least such way: below it, samples are too few to measure by.
    pub const LEAST_REACH: f32 = 0.1;

    /// Distance, in step lengths, below which two roots coincide.
    const COINCIDENCE: f32 = 1.0e-4;

    /// The points at which arteries and veins begin, given trees aside, on the tissue in force at step 1.
    ///
    /// # Errors
    /// The first root that cannot be put where it was asked for, or given tree that is out of reach.
    pub fn resolve(
        &self,
        tissue: &dyn Tissue,
        settings: &ColonizationSettings,
        seed: u64,
    ) -> Result<[Vec<TissuePoint>; 2], RootError> {
        let diameter = tissue.extent().equivalent_diameter();
        let tissue = tissue.at_step(1);
        for system in System::ALL {
            self.check_given(tissue, system, settings.system(system))?;
        }
        // Those that depend on the other system's roots come second.
        let order = match (&self.arterial, &self.venous) {
            (RootPlacement::Beside, RootPlacement::Beside) => return Err(RootError::BesideEachOther),
            (RootPlacement::Beside, _) => [System::Venous, System::Arterial],
            _ => System::ALL,
        };
        let mut rng = Stream::Roots.rng(seed);
        let mut roots = [Vec::new(), Vec::new()];
        for system in order {
            let own = settings.system(system);
            roots[system.index()] = match self.placement(system) {
                RootPlacement::None => Vec::new(),
                RootPlacement::Spread(count) => spread::spread(tissue, system, *count, &mut rng)?,
                RootPlacement::Within(reach) => {
                    check_reach(system, *reach)?;
                    within::within(tissue, system, reach * diameter, &mut rng)?
                }
                RootPlacement::Beside => {
                    let others = self.neighbours(tissue, system, &roots);
                    others.iter().map(|root| spread::beside(tissue, root, own.step_length, &mut rng)).collect()
                }
                RootPlacement::Nearest(points) => nearest(tissue, system, points)?,
                RootPlacement::Exact(points) => exact(tissue, system, points, own.influence_distance)?,
            };
        }
        check_apart(&roots, settings)?;
        Ok(roots)
    }

    /// How the roots of one system are put.
    pub fn placement(&self, system: System) -> &RootPlacement {
        match system {
            System::Arterial => &self.arterial,
            System::Venous => &self.venous,
        }
    }

    /// The other system's roots, those of its given tree included.
    fn neighbours(&self, tissue: &dyn Tissue, system: System, roots: &[Vec<TissuePoint>; 2]) -> Vec<TissuePoint> {
        let other = 1 - system.index();
        let given = self.given[other].iter().flat_map(|tree| tree.roots().map(|root| tree.positions()[root]));
        roots[other].iter().copied().chain(given.map(|position| tissue.closest_point(position))).collect()
    }

    fn check_given(&self, tissue: &dyn Tissue, system: System, settings: &SystemSettings) -> Result<(), RootError> {
        let Some(tree) = self.given[system.index()].as_ref().filter(|tree| !tree.is_empty()) else { return Ok(()) };
        if let Some(node) = tree.positions().iter().position(|&position| !is_usable(position)) {
            return Err(RootError::GivenNotFinite { system, node, position: tree.positions()[node] });
        }
        let reach = settings.influence_distance;
        let mut least = f32::INFINITY;
        for &position in tree.positions() {
            least = least.min(tissue.closest_point(position).position.distance(position));
            if least <= reach {
                return Ok(());
            }
        }
        Err(RootError::GivenTooFar { system, distance: least, reach })
    }
}

fn nearest(tissue: &dyn Tissue, system: System, points: &[Vec3]) -> Result<Vec<TissuePoint>, RootError> {
    check_finite(system, points)?;
    Ok(points.iter().map(|&position| tissue.closest_point(position)).collect())
}

fn exact(tissue: &dyn Tissue, system: System, points: &[Vec3], reach: f32) -> Result<Vec<TissuePoint>, RootError> {
    check_finite(system, points)?;
    let place = |&position: &Vec3| {
        let closest = tissue.closest_point(position);
        let distance = closest.position.distance(position);
        if distance > reach {
            return Err(RootError::TooFar { system, position, distance, reach });
        }
        Ok(TissuePoint { position, normal: closest.normal })
    };
    points.iter().map(place).collect()
}

fn check_reach(system: System, reach: f32) -> Result<(), RootError> {
    let usable = reach.is_finite() && reach >= Roots::LEAST_REACH;
    if usable { Ok(()) } else { Err(RootError::Reach { system, reach, least: Roots::LEAST_REACH }) }
}

fn check_finite(system: System, points: &[Vec3]) -> Result<(), RootError> {
    match points.iter().find(|point| !is_usable(**point)) {
        Some(&position) => Err(RootError::NotFinite { system, position }),
        None => Ok(()),
    }
}

/// Refuses roots at the same place, in one system or in both.
fn check_apart(roots: &[Vec<TissuePoint>; 2], settings: &ColonizationSettings) -> Result<(), RootError> {
    let step = settings.arterial.step_length.min(settings.venous.step_length);
    let all = System::ALL.map(|system| roots[system.index()].iter().map(move |root| (system, root.position)));
    let mut all: Vec<(System, Vec3)> = all.into_iter().flatten().collect();
    // Sorted along x, only neighbours within the distance need to be compared.
    all.sort_by(|a, b| a.1.x.total_cmp(&b.1.x));
    let limit = Roots::COINCIDENCE * step;
    for (index, &(system, position)) in all.iter().enumerate() {
        let near = all[index + 1..].iter().take_while(|(_, other)| other.x - position.x <= limit);
        for &(other, second) in near {
            if second.distance(position) <= limit {
                return Err(RootError::Coincide { systems: [system, other], position });
            }
        }
    }
    Ok(())
}
