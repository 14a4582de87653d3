//! Where vessels enter the tissue.
//!
//! In come a [`Roots`] description, the tissue and the growth's settings; out come the points at which the arteries and
//! the veins begin. Whatever is chosen automatically follows from the seed ([`Stream::Roots`]).

use crate::synthesis::{
    colonization::{ColonizationSettings, SystemSettings},
    mesh::MAX_COORDINATE,
    rng::{Stream, VesselRng},
    tissue::{Tissue, TissuePoint},
    tree::{System, VesselTree},
};
use bevy_math::Vec3;
use rand::RngExt;

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
/// The default is one artery, chosen by the seed, with a vein beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Roots {
    /// Roots of the arteries.
    pub arterial: RootPlacement,
    /// Roots of the veins.
    pub venous: RootPlacement,
    /// Trees to go on growing from, besides the roots: arterial, venous. An empty tree is none.
    pub given: [Option<VesselTree>; 2],
}

/// Why roots cannot be put where they were asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RootError {
    /// A coordinate that is NaN, infinite or beyond [`MAX_COORDINATE`].
    #[error("the {} root at {position} has a coordinate that is not finite and within ±{MAX_COORDINATE}", system.name())]
    NotFinite {
        /// The system whose root it is.
        system: System,
        /// The position asked for.
        position: Vec3,
    },
    /// A root out of reach of the tissue.
    #[error(
        "the {} root at {position} is {distance} from the tissue, further than its influence distance {reach}; move it closer or ask for the tissue's nearest point",
        system.name()
    )]
    TooFar {
        /// The system whose root it is.
        system: System,
        /// The position asked for.
        position: Vec3,
        /// Its distance from the tissue.
        distance: f32,
        /// The system's influence distance.
        reach: f32,
    },
    /// Two roots at the same place.
    #[error("two roots, {} and {}, coincide at {position}; move one of them", systems[0].name(), systems[1].name())]
    Coincide {
        /// The systems of the two roots.
        systems: [System; 2],
        /// Where they are.
        position: Vec3,
    },
    /// More roots to be spread than [`Roots::MAX_SPREAD`].
    #[error("{count} {} roots are more than {limit}", system.name())]
    TooMany {
        /// The system in question.
        system: System,
        /// The number asked for.
        count: u32,
        /// The largest number.
        limit: u32,
    },
    /// A tissue that gave fewer places than roots are to be spread.
    #[error("the tissue has room for {found} of {wanted} {} roots; ask for fewer", system.name())]
    NoRoom {
        /// The system in question.
        system: System,
        /// The number asked for.
        wanted: u32,
        /// The number of places found.
        found: u32,
    },
    /// Both systems put their roots beside those of the other.
    #[error("arterial and venous roots are both to be put beside the other's; place one of them otherwise")]
    BesideEachOther,
    /// A given tree with such a coordinate.
    #[error("node {node} of the given {} tree is at {position}, which is not finite and within ±{MAX_COORDINATE}", system.name())]
    GivenNotFinite {
        /// The system whose tree it is.
        system: System,
        /// The node.
        node: usize,
        /// Where it is.
        position: Vec3,
    },
    /// A given tree out of reach of the tissue.
    #[error(
        "the given {} tree comes no closer to the tissue than {distance}, further than its influence distance {reach}; is it in the organ's local space?",
        system.name()
    )]
    GivenTooFar {
        /// The system whose tree it is.
        system: System,
        /// The smallest distance of a node from the tissue.
        distance: f32,
        /// The system's influence distance.
        reach: f32,
    },
}

impl Default for Roots {
    fn default() -> Self {
        Self { arterial: RootPlacement::Spread(1), venous: RootPlacement::Beside, given: [None, None] }
    }
}

impl Roots {
    /// Most roots that are spread automatically.
    pub const MAX_SPREAD: u32 = 4096;

    /// Samples of the tissue among which spread roots are chosen, at least.
    const SPREAD_SAMPLES: u32 = 1024;
    /// Samples per spread root, at least.
    const SAMPLES_PER_ROOT: u32 = 16;
    /// Draws per sample before a tissue counts as having no more.
    const DRAWS_PER_SAMPLE: u32 = 64;
    /// Directions tried for a root beside another.
    const DIRECTIONS: u32 = 16;
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
                RootPlacement::Spread(count) => spread(tissue, system, *count, &mut rng)?,
                RootPlacement::Beside => {
                    let others = self.neighbours(tissue, system, &roots);
                    others.iter().map(|root| beside(tissue, root, own.step_length, &mut rng)).collect()
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

/// Roots far from each other: of many samples, again and again the one furthest from those chosen (Gonzalez,
/// "Clustering to minimize the maximum intercluster distance", 1985).
fn spread(tissue: &dyn Tissue, system: System, count: u32, rng: &mut VesselRng) -> Result<Vec<TissuePoint>, RootError> {
    if count > Roots::MAX_SPREAD {
        return Err(RootError::TooMany { system, count, limit: Roots::MAX_SPREAD });
    }
    let wanted = Roots::SPREAD_SAMPLES.max(count * Roots::SAMPLES_PER_ROOT);
    let samples: Vec<Vec3> = tissue
        .entrance()
        .into_iter()
        .chain((0..wanted * Roots::DRAWS_PER_SAMPLE).filter_map(|_| tissue.sample(rng)))
        .take(wanted as usize)
        .collect();
    let mut distances = vec![f32::INFINITY; samples.len()];
    let mut chosen: Vec<TissuePoint> = Vec::with_capacity(count as usize);
    // The first sample is as good as any; of equal distances the earliest counts.
    let mut next = 0;
    while chosen.len() < count as usize {
        if distances.get(next).is_none_or(|&distance| distance == 0.0) {
            return Err(RootError::NoRoom { system, wanted: count, found: chosen.len() as u32 });
        }
        let root = TissuePoint { position: samples[next], ..tissue.closest_point(samples[next]) };
        chosen.push(root);
        let mut furthest = 0.0;
        for (index, (distance, sample)) in distances.iter_mut().zip(&samples).enumerate() {
            *distance = distance.min(sample.distance_squared(root.position));
            if *distance > furthest {
                (next, furthest) = (index, *distance);
            }
        }
    }
    Ok(chosen)
}

/// A point of the tissue one step length from a root: of several directions the one whose point comes out best.
fn beside(tissue: &dyn Tissue, root: &TissuePoint, step: f32, rng: &mut VesselRng) -> TissuePoint {
    let mut best: Option<(f32, TissuePoint)> = None;
    for _ in 0..Roots::DIRECTIONS {
        let direction = tangent(root.normal, rng);
        let point = tissue.closest_point(root.position + direction * step);
        let error = (point.position.distance(root.position) - step).abs();
        if best.is_none_or(|(least, _)| error < least) {
            best = Some((error, point));
        }
        // Close enough to take, so that the direction is the seed's and not that of least rounding.
        if error < 0.1 * step {
            break;
        }
    }
    best.map_or(*root, |(_, point)| point)
}

/// A unit vector drawn evenly from the plane across `normal`, or from all directions where that is zero.
fn tangent(normal: Vec3, rng: &mut VesselRng) -> Vec3 {
    let random = |rng: &mut VesselRng| 2.0 * rng.random::<f32>() - 1.0;
    for _ in 0..64 {
        let point = Vec3::new(random(rng), random(rng), random(rng));
        // Within the unit ball, directions are even; too near its centre they are rounding. Their shadows on a plane
        // through the centre are even too.
        let flat = point - normal * point.dot(normal);
        if point.length_squared() <= 1.0 && flat.length_squared() > 1.0e-4 {
            return flat.normalize();
        }
    }
    Vec3::X
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

fn check_finite(system: System, points: &[Vec3]) -> Result<(), RootError> {
    match points.iter().find(|point| !is_usable(**point)) {
        Some(&position) => Err(RootError::NotFinite { system, position }),
        None => Ok(()),
    }
}

fn is_usable(position: Vec3) -> bool {
    // The greatest of NaN and a number may be the number, so both are asked.
    position.is_finite() && position.abs().max_element() <= MAX_COORDINATE
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::tissue::{Ball, Disc, TissueError};

    const SETTINGS: fn() -> ColonizationSettings = ColonizationSettings::default;

    fn at(x: f32, y: f32) -> Vec3 {
        Vec3::new(x, y, 0.0)
    }

    #[test]
    fn the_default_is_an_artery_and_a_vein_beside_it() -> Result<(), TissueError> {
        let settings = SETTINGS();
        for tissue in [Box::new(Disc::flat(0.5)?) as Box<dyn Tissue>, Box::new(Ball::new(Vec3::ONE, 0.5)?)] {
            for seed in 0..50 {
                let Ok([arteries, veins]) = Roots::default().resolve(&*tissue, &settings, seed) else {
                    panic!("no roots with seed {seed}")
                };
                assert_eq!((arteries.len(), veins.len()), (1, 1));
                let distance = arteries[0].position.distance(veins[0].position);
                assert!((distance - settings.venous.step_length).abs() < 0.2 * settings.venous.step_length);
                assert!(tissue.contains(arteries[0].position) && tissue.contains(veins[0].position));
                assert_eq!(arteries[0].normal, tissue.closest_point(arteries[0].position).normal);
                let again = Roots::default().resolve(&*tissue, &settings, seed);
                assert_eq!(again, Ok([arteries, veins]));
            }
        }
        let tissue = Disc::flat(0.5)?;
        let with_seed = |seed| Roots::default().resolve(&tissue, &settings, seed);
        assert_ne!(with_seed(1), with_seed(2));
        Ok(())
    }

    #[test]
    fn spread_roots_are_far_apart() -> Result<(), TissueError> {
        let tissue = Disc::flat(0.5)?;
        let roots = Roots { arterial: RootPlacement::Spread(12), ..Roots::default() };
        let Ok([arteries, veins]) = roots.resolve(&tissue, &SETTINGS(), 3) else { panic!("no roots") };
        assert_eq!((arteries.len(), veins.len()), (12, 12));
        for (index, root) in arteries.iter().enumerate() {
            let least = arteries[..index].iter().map(|other| other.position.distance(root.position));
            assert!(least.fold(f32::INFINITY, f32::min) > 0.2);
        }
        let many = Roots { arterial: RootPlacement::Spread(u32::MAX), ..Roots::default() };
        assert!(matches!(many.resolve(&tissue, &SETTINGS(), 3), Err(RootError::TooMany { .. })));
        let none = Roots { arterial: RootPlacement::Spread(0), ..Roots::default() };
        assert_eq!(none.resolve(&tissue, &SETTINGS(), 3), Ok([vec![], vec![]]));
        Ok(())
    }

    #[test]
    fn given_points_are_taken_or_brought_to_the_tissue() -> Result<(), TissueError> {
        let tissue = Disc::flat(0.5)?;
        let far = vec![at(-2.0, 0.0)];
        let roots = Roots {
            arterial: RootPlacement::Nearest(far.clone()),
            venous: RootPlacement::Exact(vec![Vec3::new(-0.4, 0.0, 0.01)]),
            given: [None, None],
        };
        let Ok([arteries, veins]) = roots.resolve(&tissue, &SETTINGS(), 0) else { panic!("no roots") };
        assert!(arteries[0].position.distance(at(-0.5, 0.0)) < 1e-6);
        assert_eq!(veins[0], TissuePoint { position: Vec3::new(-0.4, 0.0, 0.01), normal: Vec3::Z });

        let with = |arterial| Roots { arterial, ..Roots::default() }.resolve(&tissue, &SETTINGS(), 0);
        let error = with(RootPlacement::Exact(far));
        assert!(matches!(error, Err(RootError::TooFar { distance, .. }) if (distance - 1.5).abs() < 1e-6));
        let error = with(RootPlacement::Nearest(vec![Vec3::NAN]));
        assert!(matches!(error, Err(RootError::NotFinite { .. })));
        let error = with(RootPlacement::Nearest(vec![at(1e38, 0.0)]));
        assert!(matches!(error, Err(RootError::NotFinite { .. })));
        let error = with(RootPlacement::Exact(vec![at(0.1, 0.0), at(0.0, 0.2), at(0.1, 0.0)]));
        assert!(matches!(error, Err(RootError::Coincide { .. })));
        assert_eq!(with(RootPlacement::Beside), Err(RootError::BesideEachOther));
        assert_eq!(with(RootPlacement::None), Ok([vec![], vec![]]));
        Ok(())
    }

    #[test]
    fn given_trees_must_be_within_reach() -> Result<(), TissueError> {
        let tissue = Disc::flat(0.5)?;
        let with = |position: Vec3| {
            let mut tree = VesselTree::new();
            tree.push_root(position, 0.01);
            let given = [Some(tree), Some(VesselTree::new())];
            Roots { arterial: RootPlacement::None, given, ..Roots::default() }.resolve(&tissue, &SETTINGS(), 0)
        };
        let Ok([arteries, veins]) = with(at(0.3, 0.0)) else { panic!("no roots") };
        assert_eq!((arteries.len(), veins.len()), (0, 1));
        assert!(matches!(with(at(30.0, 0.0)), Err(RootError::GivenTooFar { .. })));
        assert!(matches!(with(at(f32::NAN, 0.0)), Err(RootError::GivenNotFinite { node: 0, .. })));
        Ok(())
    }
}
