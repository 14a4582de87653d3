//! Carries out an action on vessels: on the organs that it meets, in the space of each, with an entry in the undo
//! history.

use crate::plugin::{
    surgery::{
        cuttable::Cuttable,
        messages::{OperationError, OperationKind, VesselAction, VesselCommand, VesselOperation, VesselSite},
        undo::UndoHistory,
    },
    vessels::{
        change_log::ChangeLog,
        index::{IndexedVessels, VesselIndex},
        pick::{Near, Touch, mean_scale, nearest_place},
        relations::OrganVessels,
        tree::Vessels,
        wounds::VesselWounds,
    },
};
use crate::synthesis::{
    segment_index::Region,
    tree::Place,
    wound::{Blade, ClampId, WoundError, WoundReport, Wounds},
};
use bevy::{
    ecs::{
        change_detection::DetectChangesMut,
        entity::Entity,
        query::{QueryData, With},
        system::{Query, SystemParam},
    },
    math::{Affine3A, Vec3},
    transform::helper::TransformHelper,
};

/// Vessels to be operated on.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Operated {
    vessels: &'static Vessels,
    wounds: &'static mut VesselWounds,
    index: &'static VesselIndex,
    changes: &'static mut ChangeLog,
}

/// Everything that an action may change or read.
#[derive(SystemParam)]
pub(crate) struct OperatingField<'w, 's> {
    organs: Query<'w, 's, (Entity, &'static OrganVessels), With<Cuttable>>,
    vessels: Query<'w, 's, Operated>,
    transforms: TransformHelper<'w, 's>,
}

/// A vessel entity and its organ.
#[derive(Clone, Copy, Debug)]
struct Target {
    organ: Entity,
    vessels: Entity,
}

/// The result of a command.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) done: Vec<VesselOperation>,
    pub(crate) errors: Vec<OperationError>,
}

impl From<Operations> for Outcome {
    fn from(operations: Operations) -> Self {
        match operations {
            Ok(done) => Self { done, errors: Vec::new() },
            Err(error) => Self { done: Vec::new(), errors: vec![error] },
        }
    }
}

type Operations = Result<Vec<VesselOperation>, OperationError>;

type Report = Result<WoundReport, OperationError>;

impl OperatingField<'_, '_> {
    /// Carries out a command, and enters it in the history.
    pub(crate) fn carry_out(&mut self, command: &VesselCommand, history: &mut UndoHistory) -> Outcome {
        let targets = match self.targets(command.organ) {
            Ok(targets) => targets,
            Err(error) => return Err(error).into(),
        };
        match &command.action {
            VesselAction::Undo => return Ok(self.undo(&targets, history)).into(),
            VesselAction::UndoAll => return Ok(self.undo_all(&targets, history)).into(),
            _ => {}
        }
        let mut outcome = self.act(&targets, &command.action);
        if !outcome.done.is_empty() {
            outcome.done.iter_mut().for_each(|operation| operation.stroke = command.stroke);
            history.note(command.stroke, outcome.done.iter().map(|operation| operation.vessels));
        }
        outcome
    }

    /// Makes the oldest actions permanent, so that as many entries as `most` can be undone.
    pub(crate) fn limit(&mut self, history: &mut UndoHistory, most: usize) {
        for (vessels, actions) in history.take_oldest(most) {
            if let Ok(mut found) = self.vessels.get_mut(vessels) {
                found.wounds.bypass_change_detection().ledger_mut().make_permanent(actions);
            }
        }
    }

    fn act(&mut self, targets: &[Target], action: &VesselAction) -> Outcome {
        match action {
            VesselAction::Cut(blade) => self.cut(targets, blade),
            VesselAction::Cauterise { volume, max_calibre } => self.cauterise(targets, volume, *max_calibre),
            VesselAction::Clamp(site) => self.clamp(targets, *site).into(),
            VesselAction::Ligate(site) => self.ligate(targets, *site).into(),
            VesselAction::Unclamp { vessels, clamp } => {
                target_of(targets, *vessels).and_then(|target| self.unclamp(target, *clamp)).into()
            }
            VesselAction::UnclampNear { point, reach } => self
                .nearest_clamp(targets, *point, *reach)
                .and_then(|(target, clamp)| self.unclamp(target, clamp))
                .into(),
            VesselAction::Undo | VesselAction::UndoAll => Outcome::default(),
        }
    }

    /// The vessel entities that a command is for, in the order of their organs.
    fn targets(&self, organ: Option<Entity>) -> Result<Vec<Target>, OperationError> {
        let of_organ = |(organ, entities): (Entity, &OrganVessels)| -> Vec<Target> {
            let cuttable = entities.entities().iter().filter(|&&vessels| self.vessels.contains(vessels));
            cuttable.map(|&vessels| Target { organ, vessels }).collect()
        };
        match organ {
            Some(organ) => self.organs.get(organ).map(of_organ).map_err(|_| OperationError::NotCuttable { organ }),
            None => {
                let mut organs: Vec<_> = self.organs.iter().collect();
                organs.sort_unstable_by_key(|&(organ, _)| organ);
                Ok(organs.into_iter().flat_map(of_organ).collect())
            }
        }
    }

    /// From the space of a vessel entity to the world. `None` if a parent has no transform: the entity is not in the
    /// world then.
    fn to_world(&self, target: Target) -> Option<Affine3A> {
        self.transforms.compute_global_transform(target.vessels).ok().map(|global| global.affine())
    }

    /// Applies an operation to the ledger of a vessel entity, and reports it if it changed anything.
    fn operate(
        &mut self,
        target: Target,
        operation: OperationKind,
        operate: impl FnOnce(&mut Wounds, &IndexedVessels) -> Report,
    ) -> Result<Option<VesselOperation>, OperationError> {
        let Target { organ, vessels: entity } = target;
        let mut found = self.vessels.get_mut(entity).map_err(|_| OperationError::NoVessels { vessels: entity })?;
        let indexed = found.index.search(found.vessels, &found.changes);
        let report = operate(found.wounds.bypass_change_detection().ledger_mut(), &indexed)?;
        if report.is_empty() {
            return Ok(None);
        }
        found.wounds.note(&report, &mut found.changes);
        let kind = found.vessels.kind();
        Ok(Some(VesselOperation { organ, vessels: entity, kind, operation, stroke: None, report }))
    }

    fn cut(&mut self, targets: &[Target], blade: &Blade) -> Outcome {
        self.sweep(targets, blade, OperationKind::Cut, |wounds, indexed, blade, _| {
            Ok(wounds.cut(blade, indexed.tree(), indexed))
        })
    }

    fn cauterise(&mut self, targets: &[Target], volume: &Blade, max_calibre: f32) -> Outcome {
        self.sweep(targets, volume, OperationKind::Cauterised, |wounds, indexed, volume, scale| {
            let candidates = |region: &Region, visit: &mut dyn FnMut(_)| indexed.candidates(region, visit);
            Ok(wounds.cauterise(volume, max_calibre / scale, indexed.tree(), candidates)?)
        })
    }

    /// Applies a blade to each target, in that target's space and with its mean scale. If it fails for one target, it
    /// goes on with the others. Equal errors are reported once.
    fn sweep(
        &mut self,
        targets: &[Target],
        blade: &Blade,
        kind: OperationKind,
        operation: impl Fn(&mut Wounds, &IndexedVessels, &Blade, f32) -> Report,
    ) -> Outcome {
        let mut outcome = Outcome::default();
        for &target in targets {
            let Some(to_world) = self.to_world(target) else { continue };
            let local = blade.to_local(&to_world);
            let local = local.map_err(|error| OperationError::Blade { organ: target.organ, error });
            let done = local.and_then(|local| {
                let scale = mean_scale(&to_world);
                self.operate(target, kind, |wounds, indexed| operation(wounds, indexed, &local, scale))
            });
            match done {
                Ok(done) => outcome.done.extend(done),
                Err(error) if outcome.errors.contains(&error) => {}
                Err(error) => outcome.errors.push(error),
            }
        }
        outcome
    }

    fn clamp(&mut self, targets: &[Target], site: VesselSite) -> Operations {
        let (target, place) = self.site(targets, site)?;
        self.close(target, OperationKind::Clamped, |wounds, vessels| Ok(wounds.clamp(place, vessels.tree())?.1))
    }

    fn ligate(&mut self, targets: &[Target], site: VesselSite) -> Operations {
        let (target, place) = self.site(targets, site)?;
        self.close(target, OperationKind::Ligated, |wounds, vessels| wounds.ligate(place, vessels.tree()))
    }

    fn close(
        &mut self,
        target: Target,
        kind: OperationKind,
        close: impl FnOnce(&mut Wounds, &Vessels) -> Result<WoundReport, WoundError>,
    ) -> Operations {
        let done = self.operate(target, kind, |wounds, indexed| Ok(close(wounds, indexed.vessels)?))?;
        Ok(done.into_iter().collect())
    }

    fn unclamp(&mut self, target: Target, clamp: ClampId) -> Operations {
        self.close(target, OperationKind::Unclamped, |wounds, vessels| wounds.unclamp(clamp, vessels.tree()))
    }

    fn site(&self, targets: &[Target], site: VesselSite) -> Result<(Target, Place), OperationError> {
        match site {
            VesselSite::At { vessels, place } => Ok((target_of(targets, vessels)?, place)),
            VesselSite::Near { point, reach } => {
                let near = self.nearest(targets, point, reach);
                near.ok_or(OperationError::NothingNear { what: "vessel", point, reach })
            }
        }
    }

    fn nearest(&self, targets: &[Target], point: Vec3, reach: f32) -> Option<(Target, Place)> {
        let mut best: Option<(Target, Near)> = None;
        for &target in targets {
            let Some(to_world) = self.to_world(target) else { continue };
            let Ok(found) = self.vessels.get(target.vessels) else { continue };
            let reach = best.map_or(reach, |(_, near)| near.distance);
            let touch = Touch { point, reach, to_world };
            let indexed = found.index.search(found.vessels, found.changes);
            let near = nearest_place(&touch, &indexed, Some(found.wounds));
            if let Some(near) = near.filter(|near| best.is_none_or(|(_, best)| near.distance < best.distance)) {
                best = Some((target, near));
            }
        }
        best.map(|(target, near)| (target, near.place))
    }

    fn nearest_clamp(&self, targets: &[Target], point: Vec3, reach: f32) -> Result<(Target, ClampId), OperationError> {
        let mut best = None;
        let mut least = reach;
        for &target in targets {
            let (Some(to_world), Ok(found)) = (self.to_world(target), self.vessels.get(target.vessels)) else {
                continue;
            };
            for (clamp, place) in found.wounds.clamps() {
                let distance = to_world.transform_point3(found.vessels.tree().position_at(place)).distance(point);
                if distance < least || (best.is_none() && distance == least) {
                    least = distance;
                    best = Some((target, clamp));
                }
            }
        }
        best.ok_or(OperationError::NothingNear { what: "clamp", point, reach })
    }

    /// Undoes the last action or stroke that changed one of the targets, on all of them that it changed.
    fn undo(&mut self, targets: &[Target], history: &mut UndoHistory) -> Vec<VesselOperation> {
        let is_target = |vessels: Entity| targets.iter().any(|target| target.vessels == vessels);
        while let Some(changed) = history.take_last(is_target) {
            let mut done = Vec::new();
            for target in targets {
                let Some(&(_, actions)) = changed.iter().find(|(vessels, _)| *vessels == target.vessels) else {
                    continue;
                };
                let undo =
                    |wounds: &mut Wounds, indexed: &IndexedVessels| Ok(wounds.undo_last(actions, indexed.tree()));
                done.extend(self.operate(*target, OperationKind::Undone, undo).ok().flatten());
            }
            // An entry that a regrowth has cleared has nothing to undo, so the one before it is undone.
            if !done.is_empty() {
                return done;
            }
        }
        Vec::new()
    }

    fn undo_all(&mut self, targets: &[Target], history: &mut UndoHistory) -> Vec<VesselOperation> {
        history.forget(|vessels| targets.iter().any(|target| target.vessels == vessels));
        let undo = |wounds: &mut Wounds, indexed: &IndexedVessels| Ok(wounds.undo_all(indexed.tree()));
        targets.iter().filter_map(|&target| self.operate(target, OperationKind::Undone, undo).ok().flatten()).collect()
    }
}

fn target_of(targets: &[Target], vessels: Entity) -> Result<Target, OperationError> {
    targets.iter().find(|target| target.vessels == vessels).copied().ok_or(OperationError::NoVessels { vessels })
}
