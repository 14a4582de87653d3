//! From placements of roots to points of the tissue.

use super::{
    RootError, RootPlacement, RootSpacing, Roots,
    hollow::hilum,
    spread::{beside, spread},
    within::within,
};
use crate::synthesis::{
    mesh::is_usable,
    random::Stream,
    tissue::{Derived, Tissue, TissuePoint, web::web},
    tree::{ByKind, VesselKind},
};
use bevy_math::Vec3;

impl Roots {
    /// Distance, in step lengths, below which two roots coincide.
    const COINCIDENCE: f32 = 1.0e-4;

    /// The points at which each kind of vessels begins, without its given tree, on the tissue in force at step 1.
    ///
    /// # Errors
    /// The first root that cannot be placed as requested, or given tree that is out of reach.
    pub fn resolve(
        &self,
        tissue: &dyn Tissue,
        spacing: &ByKind<Option<RootSpacing>>,
        seed: u64,
    ) -> Result<ByKind<Vec<TissuePoint>>, RootError> {
        self.resolve_with(tissue, spacing, seed, &Derived::default())
    }

    /// The same with what was derived from the tissue before, unless the tissue keeps its own.
    pub(crate) fn resolve_with(
        &self,
        tissue: &dyn Tissue,
        spacing: &ByKind<Option<RootSpacing>>,
        seed: u64,
        derived: &Derived,
    ) -> Result<ByKind<Vec<TissuePoint>>, RootError> {
        let diameter = tissue.extent().equivalent_diameter();
        let tissue = tissue.at_step(1);
        let derived = tissue.derived().unwrap_or(derived);
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
                RootPlacement::Spread(count) => spread(tissue, kind, *count, &mut rng)?,
                RootPlacement::Hilum => {
                    let find = || hilum(tissue, &web(tissue, derived).positions, diameter);
                    match derived.hilum(diameter, find) {
                        Some(floor) => vec![tissue.closest_point(floor)],
                        None => spread(tissue, kind, 1, &mut rng)?,
                    }
                }
                RootPlacement::Within(reach) => {
                    check_reach(kind, *reach)?;
                    match tissue.entrance() {
                        Some(position) => vec![TissuePoint { position, ..tissue.closest_point(position) }],
                        None => within((tissue, web(tissue, derived)), kind, reach * diameter, own.reach, &mut rng)?,
                    }
                }
                RootPlacement::Beside => {
                    let others = self.neighbours(tissue, kind.companion(), &roots);
                    others.iter().map(|root| beside(tissue, root, own.step, &mut rng)).collect()
                }
                RootPlacement::Nearest(points) => nearest(tissue, kind, points)?,
                RootPlacement::Exact(points) => exact(tissue, kind, points, own.reach)?,
            };
        }
        check_allowed(&roots, tissue)?;
        check_apart(&roots, spacing)?;
        Ok(roots)
    }

    /// The kinds, in an order with each kind before those placed beside it.
    fn order(&self) -> Result<impl Iterator<Item = VesselKind>, RootError> {
        let is_beside = |kind: VesselKind| self.placed[kind] == RootPlacement::Beside;
        if is_beside(VesselKind::Artery) && is_beside(VesselKind::Artery.companion()) {
            return Err(RootError::BesideEachOther);
        }
        let mut order = VesselKind::ALL;
        order.sort_by_key(|&kind| is_beside(kind));
        Ok(order.into_iter())
    }

    /// The roots of a kind, including those of its given tree.
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
        Ok(tissue.point_at(position))
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
