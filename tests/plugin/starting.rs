//! The start of a growth holds up no frame: roots are placed in jobs, whoever asks.

use super::*;
use bevy_vessels::{
    plugin::GrowthStarted,
    synthesis::{
        generator::{CustomGenerator, Generator, GrowthMaker},
        growth::Growth,
        roots::{RootSpacing, Roots},
        tissue::Tissue,
        tree::ByKind,
    },
};
use std::{
    sync::{Arc, Mutex},
    thread::ThreadId,
};

/// Colonizes, and notes the threads of its starts.
#[derive(Clone, Debug, Default)]
struct Noting {
    threads: Arc<Mutex<Vec<ThreadId>>>,
}

impl Noting {
    fn wish(&self) -> Vasculature {
        quick().with_generator(Generator::Custom(CustomGenerator::new(self.clone())))
    }

    fn threads(&self) -> Vec<ThreadId> {
        self.threads.lock().expect("nobody panics").clone()
    }
}

impl GrowthMaker for Noting {
    fn root_spacing(&self, scale: f32) -> ByKind<Option<RootSpacing>> {
        ColonizationSettings::default().scaled(scale).root_spacing()
    }

    fn start(&self, tissue: Arc<dyn Tissue>, roots: &Roots, scale: f32, seed: u64) -> Result<Box<dyn Growth>, String> {
        self.threads.lock().expect("nobody panics").push(thread::current().id());
        let settings = ColonizationSettings { steps: 3, ..ColonizationSettings::default() }.scaled(scale);
        Generator::from(settings).start(tissue, roots, seed).map_err(|error| error.to_string())
    }
}

#[test]
fn fifty_organs_start_beside_the_frames_or_one_in_each() {
    let mut app = headless(GrowthBudget::default());
    app.insert_resource(JobSettings { slice_time: Duration::ZERO, ..jobs() });
    let noting = Noting::default();
    let wish = noting.wish();
    let organs: Vec<Entity> = (0..50).map(|seed| spawn(&mut app, wish.clone().with_seed(seed))).collect();
    let mut before = 0;
    run_until(&mut app, "all starts", |world| {
        let now = noting.threads().len();
        assert!(!IN_SLICES || now <= before + 1, "{} starts in a frame", now - before);
        before = now;
        organs.iter().all(|&organ| progress(world, organ).step > 0)
    });
    let threads = noting.threads();
    assert_eq!(threads.len(), organs.len(), "each organ starts once");
    let is_own = |thread: &ThreadId| *thread == thread::current().id();
    assert!(IN_SLICES || !threads.iter().any(is_own), "a start held up the frames");
}

/// The vessels of a seed whose roots the seed chooses.
fn rooted_by_seed(seed: u64) -> Vasculature {
    quick().with_roots(RootPlacements::default()).with_seed(seed)
}

#[test]
fn vessels_stay_until_the_roots_of_another_seed_are_placed() {
    let mut app = headless(GrowthBudget::Steps(100));
    let organ = spawn(&mut app, rooted_by_seed(1));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let first = trees(app.world(), organ);
    let mut started = MessageCursor::default();
    drain::<GrowthStarted>(app.world(), &mut started);
    // A slider that is dragged: what it passes is not waited for.
    for seed in [2, 3] {
        app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes").seed = seed;
        app.update();
    }
    let mut starts = drain::<GrowthStarted>(app.world(), &mut started).len();
    while starts == 0 {
        assert_eq!(trees(app.world(), organ), first, "what is drawn stays");
        thread::sleep(Duration::from_millis(1));
        app.update();
        starts += drain::<GrowthStarted>(app.world(), &mut started).len();
    }
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let mut fresh = headless(GrowthBudget::Steps(100));
    let same = spawn(&mut fresh, rooted_by_seed(3));
    run_to_phase(&mut fresh, same, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), trees(fresh.world(), same));
    assert_ne!(trees(app.world(), organ), first);
}

#[test]
fn a_start_that_fails_keeps_the_tissue_for_the_next() {
    let mut app = headless(GrowthBudget::Steps(100));
    let mut wish = rooted_by_seed(1);
    settings_of(&mut wish).arterial.kill_distance = -1.0;
    let organ = spawn(&mut app, wish);
    super::errors::failure(&mut app, organ);
    let has_tissue = app.world().get::<GrowthState>(organ).is_some_and(|state| state.tissue().is_some());
    assert!(has_tissue);
    *app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes") = rooted_by_seed(1);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
}
