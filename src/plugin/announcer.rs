//! How the app hears of what happens to vessels: as messages, and as events that observers hear.

use bevy::ecs::{
    event::{EntityEvent, EntityTrigger, Event},
    message::{Message, MessageWriter},
    system::{Commands, SystemParam},
};

/// Says what happened, in both ways at once, so that no place forgets one of them.
///
/// The message can be read at once. The event is triggered when the commands of the system that announces it are applied:
/// in the same frame, before the next system that is ordered after it.
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
