//! Tells the app what happens to vessels, both as messages and as events for observers.

use bevy::ecs::{
    event::{EntityEvent, EntityTrigger, Event},
    message::{Message, MessageWriter},
    system::{Commands, SystemParam},
};

/// Announces something as a message and as an event, so that no caller forgets one of them.
///
/// The message can be read at once. The event is triggered when the announcing system's commands are applied: in the
/// same frame, before the next system that is ordered after it.
#[derive(SystemParam)]
pub(crate) struct Announcer<'w, 's, M: Message> {
    messages: MessageWriter<'w, M>,
    commands: Commands<'w, 's>,
}

impl<M> Announcer<'_, '_, M>
where
    M: Message + Clone + EntityEvent + for<'a> Event<Trigger<'a> = EntityTrigger>,
{
    pub(crate) fn announce(&mut self, news: M) {
        self.commands.trigger(news.clone());
        self.messages.write(news);
    }
}
