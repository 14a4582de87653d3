//! Growing an organ in one call, without waiting for frames.

use crate::plugin::growth::{
    followed::Need,
    grow::{end_growths, run_to_end},
    publish::publish_vessels,
    source::{Organ, StartMessages},
    tissue::OrganAssets,
};
use bevy::{
    ecs::{
        entity::Entity,
        system::{EntityCommands, In, Query, RegisteredSystemError},
        world::{EntityWorldMut, World},
    },
    log::warn,
};

/// Commands for organs.
pub trait EntityCommandsExt {
    /// Grows the organ's vessels to completion when the command is applied: prepares the tissue and does all steps,
    /// however long that takes, even if paused. The vessels are the same as those grown over many frames.
    ///
    /// If the mesh isn't loaded yet, they grow in the frame in which its tissue becomes ready.
    ///
    /// ```
    /// # use bevy_vessels::{plugin::{EntityCommandsExt, Vasculature}, synthesis::preset::PresetName};
    /// # use bevy::prelude::{Assets, Commands, Mesh, Mesh3d, ResMut, Sphere};
    /// fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
    ///     let organ = Mesh3d(meshes.add(Sphere::new(1.0)));
    ///     commands.spawn((organ, Vasculature::new(PresetName::Paper))).grow_now();
    /// }
    /// # bevy::ecs::system::assert_is_system(setup);
    /// ```
    fn grow_now(&mut self) -> &mut Self;
}

impl EntityCommandsExt for EntityCommands<'_> {
    fn grow_now(&mut self) -> &mut Self {
        self.queue(|organ: EntityWorldMut| {
            let entity = organ.id();
            if let Err(error) = grow_organ_now(organ.into_world_mut(), entity) {
                warn!("{entity}: grow_now needs the GrowthPlugin and mesh assets: {error}");
            }
        })
    }
}

fn grow_organ_now(world: &mut World, organ: Entity) -> Result<(), RegisteredSystemError<In<Entity>>> {
    world.run_system_cached_with(finish_organ, organ)?;
    let published = world.run_system_cached(publish_vessels).and_then(|()| world.run_system_cached(end_growths));
    if let Err(error) = published {
        warn!("{organ}: the vessels are published at the next frame: {error}");
    }
    Ok(())
}

/// Prepares an organ synchronously, and does all its steps.
fn finish_organ(
    In(entity): In<Entity>,
    mut assets: OrganAssets,
    mut organs: Query<Organ>,
    mut messages: StartMessages,
) {
    let Ok(mut organ) = organs.get_mut(entity) else {
        warn!("{entity}: grow_now needs an entity with a Vasculature");
        return;
    };
    organ.follow();
    organ.state.request_finish();
    if organ.state.need != Need::Nothing {
        let outcome = organ.begin(&mut assets, None);
        organ.report(outcome, &mut messages);
    }
    if organ.state.rests() {
        warn!(
            "{entity}: grow_now waits until its severed vessels are whole again; set Cuttable::growth to let it grow"
        );
    }
    run_to_end(&mut organ.state, &mut organ.progress);
}
