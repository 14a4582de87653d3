//! Cut: carries out actions on the vessels of all organs that they meet.
//!
//! In: actions in world space, from [`CuttableVessels`] or as [`VesselCommand`] messages. Out: the ledgers in
//! [`VesselWounds`](crate::plugin::VesselWounds), changed segments marked in
//! [`ChangeLog`](crate::plugin::ChangeLog), and a [`VesselOperation`] for each vessel entity that an action
//! changed.

use crate::plugin::announcer::Announcer;
use crate::plugin::surgery::{
    messages::{
        OperationError, StrokeId, VesselAction, VesselCommand, VesselOperation, VesselOperationFailed, VesselSite,
    },
    operate::OperatingField,
    undo::UndoHistory,
};
use crate::synthesis::{
    tree::Place,
    wound::{Blade, ClampId},
};
use bevy::{
    ecs::{
        change_detection::{Res, ResMut},
        entity::Entity,
        message::{MessageReader, MessageWriter},
        resource::Resource,
    },
    log::{debug, warn},
    math::Vec3,
};

/// Cuts, clamps, seals and heals vessels. A request is carried out in the same frame, in
/// [`VesselSystems::Cut`](crate::plugin::VesselSystems::Cut), or in the next if that set has already run.
///
/// All shapes and points are in world space. The transforms of organs and their parents are respected, with scale,
/// mirrors and shear, as they are when the action is carried out. An action goes to all
/// [`Cuttable`](crate::plugin::Cuttable) organs unless it names one. Results come as [`VesselOperation`] messages; the
/// state of vessels is in their [`VesselWounds`](crate::plugin::VesselWounds) and [`OpenEnd`](crate::plugin::OpenEnd)
/// entities.
///
/// ```
/// # use bevy_vessels::{plugin::CuttableVessels, synthesis::wound::{Blade, BladeError}};
/// # use bevy::prelude::{ResMut, Vec3};
/// fn slash(mut vessels: ResMut<CuttableVessels>) -> bevy::ecs::error::Result {
///     let [handle, tip] = [Vec3::new(0.0, 1.0, 0.5), Vec3::new(0.0, 0.0, 0.5)];
///     vessels.cut(Blade::sweep([handle, tip], [handle + 0.1 * Vec3::X, tip + 0.1 * Vec3::X])?);
///     Ok(())
/// }
/// # let _ = slash;
/// ```
#[derive(Resource, Debug)]
pub struct CuttableVessels {
    /// How many actions or strokes [`undo`](Self::undo) can take back. When there are more, the oldest become
    /// permanent.
    ///
    /// Higher values take more memory: about a hundred bytes for each segment that an action changed.
    /// [`undo_all`](Self::undo_all) needs no memory, and heals permanent ones, too.
    ///
    /// Limits: none; with 0 nothing can be undone, but all at once. Default: [`Self::DEFAULT_UNDO_LIMIT`].
    pub undo_limit: usize,
    queue: Vec<VesselCommand>,
    /// Operations of this frame, still to be announced.
    done: Vec<VesselOperation>,
    history: UndoHistory,
    /// Organs whose transform has been warned of.
    warned: Vec<Entity>,
}

impl Default for CuttableVessels {
    fn default() -> Self {
        Self {
            undo_limit: Self::DEFAULT_UNDO_LIMIT,
            queue: Vec::new(),
            done: Vec::new(),
            history: UndoHistory::default(),
            warned: Vec::new(),
        }
    }
}

impl CuttableVessels {
    /// Default of [`undo_limit`](Self::undo_limit).
    pub const DEFAULT_UNDO_LIMIT: usize = 256;

    /// Severs every vessel that a blade crosses; a ball or capsule also removes what lies within it.
    pub fn cut(&mut self, blade: Blade) {
        self.request(VesselCommand::new(VesselAction::Cut(blade)));
    }

    /// Puts a clamp on the vessel that is nearest to a point: no blood passes there until it is taken off.
    ///
    /// `reach` is how far the point may be from the vessel's wall, in world units.
    pub fn clamp(&mut self, point: Vec3, reach: f32) {
        self.request(VesselCommand::new(VesselAction::Clamp(VesselSite::Near { point, reach })));
    }

    /// Puts a clamp on a place of a vessel entity.
    pub fn clamp_at(&mut self, vessels: Entity, place: Place) {
        self.request(VesselCommand::new(VesselAction::Clamp(VesselSite::At { vessels, place })));
    }

    /// Takes off a clamp that a [`VesselOperation`] reported.
    pub fn unclamp(&mut self, vessels: Entity, clamp: ClampId) {
        self.request(VesselCommand::new(VesselAction::Unclamp { vessels, clamp }));
    }

    /// Takes off the clamp that is nearest to a point, at most `reach` away, in world units.
    pub fn unclamp_near(&mut self, point: Vec3, reach: f32) {
        self.request(VesselCommand::new(VesselAction::UnclampNear { point, reach }));
    }

    /// Ties off the vessel that is nearest to a point: a clamp that only undo takes off.
    ///
    /// `reach` as for [`clamp`](Self::clamp).
    pub fn ligate(&mut self, point: Vec3, reach: f32) {
        self.request(VesselCommand::new(VesselAction::Ligate(VesselSite::Near { point, reach })));
    }

    /// Ties off the vessel at a place of a vessel entity.
    pub fn ligate_at(&mut self, vessels: Entity, place: Place) {
        self.request(VesselCommand::new(VesselAction::Ligate(VesselSite::At { vessels, place })));
    }

    /// Seals by heat all vessels up to a calibre within a ball or capsule, for good.
    ///
    /// `max_calibre` is the largest diameter that the instrument seals, in world units; infinity for any.
    pub fn cauterise(&mut self, volume: Blade, max_calibre: f32) {
        self.request(VesselCommand::new(VesselAction::Cauterise { volume, max_calibre }));
    }

    /// Makes requests part of a stroke: the sweeps of many frames, which [`undo`](Self::undo) takes back together.
    ///
    /// ```
    /// # use bevy_vessels::{plugin::{CuttableVessels, StrokeId}, synthesis::wound::Blade};
    /// # use bevy::prelude::{ButtonInput, Local, MouseButton, Res, ResMut, Vec3};
    /// # fn edge_now() -> [Vec3; 2] { [Vec3::ZERO, Vec3::Y] }
    /// fn scalpel(
    ///     buttons: Res<ButtonInput<MouseButton>>,
    ///     mut stroke: Local<Option<(StrokeId, [Vec3; 2])>>,
    ///     mut vessels: ResMut<CuttableVessels>,
    /// ) {
    ///     let now = edge_now();
    ///     *stroke = buttons.pressed(MouseButton::Left).then(|| {
    ///         let (id, before) = stroke.unwrap_or_else(|| (StrokeId::begin(), now));
    ///         // an edge that stands still sweeps no area
    ///         if let Ok(blade) = Blade::sweep(before, now) {
    ///             vessels.in_stroke(id).cut(blade);
    ///         }
    ///         (id, now)
    ///     });
    /// }
    /// # bevy::ecs::system::assert_is_system(scalpel);
    /// ```
    pub fn in_stroke(&mut self, stroke: StrokeId) -> Stroke<'_> {
        Stroke { vessels: self, stroke }
    }

    /// Undoes the last action or stroke that changed anything, on all the vessels that it changed. If several
    /// overlapped in time, the one that began last is undone. Actions beyond the [`undo_limit`](Self::undo_limit) stay.
    ///
    /// Blood that was lost stays lost.
    pub fn undo(&mut self) {
        self.request(VesselCommand::new(VesselAction::Undo));
    }

    /// Undoes all actions: every vessel is whole again. Blood that was lost stays lost.
    pub fn undo_all(&mut self) {
        self.request(VesselCommand::new(VesselAction::UndoAll));
    }

    /// Requests an action, on one organ or on all of them, as the other methods and messages do.
    pub fn request(&mut self, command: VesselCommand) {
        self.queue.push(command);
    }

    /// Removes a vessel entity, whose ledger has been cleared, from the undo history.
    pub(crate) fn forget(&mut self, vessels: Entity) {
        self.history.forget(|entity| entity == vessels);
    }

    /// Logs what could not be done, as a warning if the app's author must know it.
    fn report_failure(&mut self, error: &OperationError) {
        match *error {
            // An instrument may miss: that is part of the game.
            OperationError::NothingNear { .. } => debug!("{error}"),
            OperationError::Blade { organ, .. } if self.warned.contains(&organ) => {}
            _ => warn!("a vessel command was not carried out: {error}"),
        }
        if let OperationError::Blade { organ, .. } = *error {
            self.warned.push(organ);
        }
    }

    /// Number of actions that can be undone; a stroke is one.
    pub fn actions(&self) -> usize {
        self.history.len()
    }
}

/// Requests that are part of a stroke: see [`CuttableVessels::in_stroke`]. Other actions go through
/// [`request`](Self::request).
#[derive(Debug)]
pub struct Stroke<'a> {
    vessels: &'a mut CuttableVessels,
    stroke: StrokeId,
}

impl Stroke<'_> {
    /// As [`CuttableVessels::cut`].
    pub fn cut(&mut self, blade: Blade) {
        self.request(VesselCommand::new(VesselAction::Cut(blade)));
    }

    /// As [`CuttableVessels::cauterise`].
    pub fn cauterise(&mut self, volume: Blade, max_calibre: f32) {
        self.request(VesselCommand::new(VesselAction::Cauterise { volume, max_calibre }));
    }

    /// Requests any action as part of the stroke. An undo is never part of a stroke.
    pub fn request(&mut self, command: VesselCommand) {
        self.vessels.request(command.in_stroke(self.stroke));
    }
}

/// Carries out requests: first those of the resource, then messages, each in their order.
pub(crate) fn carry_out(
    mut door: ResMut<CuttableVessels>,
    mut commands: MessageReader<VesselCommand>,
    mut field: OperatingField,
    mut failed: MessageWriter<VesselOperationFailed>,
) {
    if door.queue.is_empty() && commands.is_empty() {
        return;
    }
    let mut queue = std::mem::take(&mut door.queue);
    let most = door.undo_limit;
    for command in queue.drain(..).chain(commands.read().cloned()) {
        let outcome = field.carry_out(&command, &mut door.history);
        field.limit(&mut door.history, most);
        door.done.extend(outcome.done);
        for error in outcome.errors {
            door.report_failure(&error);
            failed.write(VesselOperationFailed { command: command.clone(), error });
        }
    }
    // The queue keeps its memory.
    door.queue = queue;
}

impl CuttableVessels {
    /// Whether operations are to be announced.
    pub(crate) fn has_news(door: Res<Self>) -> bool {
        !door.done.is_empty()
    }
}

/// Cut: announces operations, once the entities of open ends exist.
pub(crate) fn tell_operations(mut door: ResMut<CuttableVessels>, mut operations: Announcer<VesselOperation>) {
    door.done.drain(..).for_each(|operation| operations.announce(operation));
}
