//! A generator outside the crate that does everything at its start.

use super::*;
use bevy_vessels::{
    plugin::{EntityCommandsExt, GrowthFinished, OrganPaint},
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
