//! One organ in metres, in millimetres and as a toy: its vessels, and their blood loss.

use super::operating_field::*;
use super::*;
use bevy_vessels::{
    plugin::{BloodLoss, Perfusion},
    synthesis::units::Scale,
};

const FRAME: Duration = Duration::from_millis(16);
/// Radius of the organ, in metres.
const SIZE: f64 = 0.05;
/// Number of frames of bleeding.
const FRAMES: u32 = 30;

/// Units of the organ's mesh in a metre: metres, millimetres, and a toy 50 units across.
const UNITS: [f64; 3] = [1.0, 1e3, 50.0 / (2.0 * SIZE)];

fn blood_in(units: f64) -> Perfusion {
    Perfusion { scale: Some(Scale::from_metres(1.0 / units).expect("a scale")), ..Perfusion::default() }
}

/// Cuts an organ through the middle, and returns its loss a while later.
fn bled(app: &mut App, organ: Entity, radius: f32) -> BloodLoss {
    app.update();
    cut(app, square(Vec3::splat(0.1 * radius), Vec3::new(0.2, 1.0, 0.1), 3.0 * radius));
    (0..FRAMES).for_each(|_| app.update());
    *app.world().get::<BloodLoss>(organ).expect("an organ with blood has a loss")
}

#[test]
fn an_organ_grows_and_bleeds_alike_in_any_unit() {
    let found = UNITS.map(|units| {
        let mut app = timed_app(FRAME);
        let radius = (SIZE * units) as f32;
        let mesh = add_mesh(&mut app, Sphere::new(radius).mesh().uv(32, 18));
        let wish = Vasculature { seed: 3, ..Vasculature::default() };
        let organ = app.world_mut().spawn((Mesh3d(mesh), wish, blood_in(units))).id();
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        let nodes = KINDS.map(|kind| progress(app.world(), organ).nodes[kind]);
        let loss = bled(&mut app, organ, radius);
        assert!(loss.bleeding_ends > 50, "{loss:?}");
        (nodes, loss)
    });
    let [(nodes, loss), others @ ..] = found;
    assert!(nodes.iter().all(|&nodes| nodes > 1000), "{nodes:?} are too few to tell");
    for (other_nodes, other_loss) in others {
        for (one, other) in nodes.iter().zip(other_nodes) {
            // Rounding changes the paths of single vessels.
            let ratio = other as f64 / *one as f64;
            assert!((ratio - 1.0).abs() < 0.08, "{other} nodes, {one} in metres");
        }
        let ratio = other_loss.total.ml() / loss.total.ml();
        assert!((ratio - 1.0).abs() < 0.25, "{other_loss:?} against {loss:?} in metres");
    }
}

/// With the same tree, only the unit differs.
#[test]
fn a_tree_bleeds_the_same_in_any_unit() {
    let mut organ_in_metres = timed_app(FRAME);
    let organ = spawn(&mut organ_in_metres, quick());
    run_to_phase(&mut organ_in_metres, organ, GrowthPhase::Finished);
    let trees = trees(organ_in_metres.world(), organ);
    let losses = UNITS.map(|units| {
        let mut app = timed_app(FRAME);
        // The tree is that of a ball of radius 0.5.
        let factor = (2.0 * SIZE * units) as f32;
        let scaled = trees.each_ref().map(|tree| {
            let positions = tree.positions().iter().map(|&at| at * factor).collect();
            let radii = tree.radii().iter().map(|&radius| radius * factor).collect();
            VesselTree::from_arrays(positions, tree.parents().to_vec(), radii).expect("a tree")
        });
        let of_kinds = [(VesselKind::Artery, &scaled[0]), (VesselKind::Vein, &scaled[1])];
        let organ = organ_of(&mut app, &of_kinds, blood_in(units));
        bled(&mut app, organ, 0.5 * factor)
    });
    let [first, others @ ..] = losses;
    assert!(first.total.ml() > 0.0 && first.bleeding_ends > 20, "{first:?}");
    for other in others {
        assert_eq!(other.bleeding_ends, first.bleeding_ends);
        for (other, first) in [(other.total.ml(), first.total.ml()), (other.rate.ml_per_min(), first.rate.ml_per_min())]
        {
            assert!((other / first - 1.0).abs() < 1e-4, "{other} against {first} in metres");
        }
    }
}
