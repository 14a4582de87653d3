//! A generator outside the crate that does everything at its start.

use super::errors::failure;
use super::*;
use bevy_vessels::{
    plugin::{EntityCommandsExt, GrowthFinished, OrganGrowthError, OrganPaint},
    synthesis::{
        generator::{CustomGenerator, Generator, GrowthMaker},
        growth::{GrownTree, Growth, StepCount, TreeUpdate},
        roots::{RootSpacing, Roots},
        tissue::{NoGoRegion, Tissue},
        tree::{ByKind, NO_PARENT},
    },
};
use std::sync::Arc;

/// Makes one artery of one segment: along x in a plain tissue, along y where something is forbidden.
#[derive(Debug)]
struct OneSegment;

impl GrowthMaker for OneSegment {
    fn root_spacing(&self, _: f32) -> ByKind<Option<RootSpacing>> {
        ByKind::default()
    }

    fn start(&self, tissue: Arc<dyn Tissue>, _: &Roots, _: f32, _: u64) -> Result<Box<dyn Growth>, String> {
        let tip = if tissue.no_go().is_some() { Vec3::Y } else { Vec3::X };
        let tree = VesselTree::from_arrays(vec![Vec3::ZERO, tip], vec![NO_PARENT, 0], vec![0.01; 2]);
        Ok(Box::new(Made(tree.expect("a segment is a tree"))))
    }
}

#[derive(Debug)]
struct Made(VesselTree);

impl Growth for Made {
    fn advance(&mut self) {}

    fn settle(&mut self) {}

    fn is_finished(&self) -> bool {
        true
    }

    fn progress(&self) -> StepCount {
        StepCount::default()
    }

    fn trees(&self) -> ByKind<Option<GrownTree<'_>>> {
        ByKind::from_fn(|kind| (kind == VesselKind::Artery).then(|| GrownTree::of(&self.0)))
    }

    fn update(&self, _: VesselKind) -> TreeUpdate<'_> {
        TreeUpdate::Grown { changed: &[] }
    }
}

/// Starts growths that panic: at their start with seed 0, else in a step.
#[derive(Debug)]
struct Bomb;

impl GrowthMaker for Bomb {
    fn root_spacing(&self, _: f32) -> ByKind<Option<RootSpacing>> {
        ByKind::default()
    }

    fn start(&self, _: Arc<dyn Tissue>, _: &Roots, _: f32, seed: u64) -> Result<Box<dyn Growth>, String> {
        assert!(seed != 0, "no start with seed {seed}");
        Ok(Box::new(Ticking(Made(VesselTree::new()))))
    }
}

#[derive(Debug)]
struct Ticking(Made);

impl Growth for Ticking {
    fn advance(&mut self) {
        panic!("no step {}", 1);
    }

    fn settle(&mut self) {}

    fn is_finished(&self) -> bool {
        false
    }

    fn progress(&self) -> StepCount {
        StepCount { done: 0, all: 2 }
    }

    fn trees(&self) -> ByKind<Option<GrownTree<'_>>> {
        self.0.trees()
    }

    fn update(&self, kind: VesselKind) -> TreeUpdate<'_> {
        self.0.update(kind)
    }
}

#[test]
fn a_generator_that_panics_fails_its_organ_alone() {
    for (seed, told) in [(0, "no start with seed 0"), (1, "no step 1")] {
        let mut app = headless(GrowthBudget::Steps(4));
        let healthy = spawn(&mut app, quick());
        let bomb =
            |seed| Vasculature::default().with_generator(Generator::Custom(CustomGenerator::new(Bomb))).with_seed(seed);
        let organ = spawn(&mut app, bomb(seed));
        let error = failure(&mut app, organ).error;
        assert!(matches!(&error, OrganGrowthError::Panicked(_)) && error.to_string().contains(told), "{error}");
        run_to_phase(&mut app, healthy, GrowthPhase::Finished);
        send(&mut app, organ, GrowthAction::Restart);
        assert_eq!(failure(&mut app, organ).error, error, "it tries again");
        let now = spawn(&mut app, bomb(seed));
        app.world_mut().commands().entity(now).grow_now();
        assert_eq!(failure(&mut app, now).error, error, "whoever asks");
        *app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes") = quick();
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_eq!(trees(app.world(), organ), trees(app.world(), healthy));
    }
}

fn tip(world: &World, organ: Entity) -> Vec3 {
    published(world, organ, VesselKind::Artery).tree().positions()[1]
}

#[test]
fn vessels_that_need_no_step_come_at_once_and_again_after_a_stroke() {
    for is_asked_now in [false, true] {
        let mut app = headless(GrowthBudget::default());
        let generator = Generator::Custom(CustomGenerator::new(OneSegment));
        let organ = spawn(&mut app, Vasculature::default().with_generator(generator));
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_eq!(tip(app.world(), organ), Vec3::X);
        let mut finished = MessageCursor::default();
        drain::<GrowthFinished>(app.world(), &mut finished);
        let mut paint = OrganPaint::default();
        paint.no_go.regions.push(NoGoRegion::Ball { center: 0.5 * Vec3::Y, radius: 0.1 });
        app.world_mut().entity_mut(organ).insert(paint);
        if is_asked_now {
            app.world_mut().commands().entity(organ).grow_now();
            app.world_mut().flush();
            assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
        }
        run_until(&mut app, "the end", |world| !drain::<GrowthFinished>(world, &mut finished).is_empty());
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
        assert_eq!(tip(app.world(), organ), Vec3::Y);
    }
}
