//! Thousands of random actions on a forest: after each, the reports add up to the state, and undo leads all the way back.

use crate::common::{all, forest, random_point, rng};
use bevy_vessels::synthesis::random::VesselRng;
use bevy_vessels::synthesis::tree::{NodeId, Place, VesselTree};
use bevy_vessels::synthesis::wound::{
    Blade, Blockage, ClampId, EndId, Retraction, SegmentPiece, SeveredEnd, WoundReport, Wounds, severed,
};
use rand::RngExt;
use std::collections::BTreeSet;

/// The state that a caller knows from reports alone.
#[derive(Clone, Default, PartialEq, Debug)]
struct Heard {
    open: BTreeSet<EndId>,
    clamps: BTreeSet<ClampId>,
}

impl Heard {
    fn hear(&mut self, report: &WoundReport) {
        for end in &report.opened {
            assert!(end.is_open && self.open.insert(end.id), "{:?} was open already", end.id);
        }
        for id in &report.closed {
            assert!(self.open.remove(id), "{id:?} was not open");
        }
        for &clamp in &report.clamped {
            assert!(self.clamps.insert(clamp), "{clamp:?} was on already");
        }
        for clamp in &report.unclamped {
            assert!(self.clamps.remove(clamp), "{clamp:?} was not on");
        }
    }
}

type State = (Vec<SeveredEnd>, Vec<Blockage>, Vec<SegmentPiece>);

fn state(wounds: &Wounds, tree: &VesselTree) -> State {
    let pieces = wounds.severed_segments().flat_map(|node| wounds.pieces(node)).collect();
    (wounds.ends(tree).collect(), wounds.blockages().collect(), pieces)
}

fn surface(rng: &mut VesselRng) -> Blade {
    let mut point = || random_point(rng);
    let [a, b, c, d] = [point(), point(), point(), point()];
    Blade::triangles(vec![[a, b, c], [b, c, d], [a, 0.5 * (b + c), d]]).expect("a blade")
}

fn volume(rng: &mut VesselRng, largest: f32) -> Blade {
    let (from, to) = (random_point(rng), random_point(rng));
    Blade::capsule(from, from.lerp(to, rng.random_range(0.0..0.3)), rng.random_range(0.01..largest)).expect("a blade")
}

fn random_place(rng: &mut VesselRng, tree: &VesselTree) -> Place {
    Place::new(NodeId(rng.random_range(0..tree.len() as u32)), rng.random_range(0.0..=1.0))
}

/// Crossings of a surface with remaining vessels: neither in a gap nor on its tips.
fn expected_crossings(wounds: &Wounds, tree: &VesselTree, blade: &Blade) -> usize {
    let mut hits = Vec::new();
    severed(blade, tree, all(tree), &mut hits);
    let meets = |hit: &&_| {
        let &&bevy_vessels::synthesis::wound::Severed { node, from: share, .. } = hit;
        !wounds.is_severed(node) || wounds.pieces(node).any(|piece| piece.from < share && share < piece.to)
    };
    hits.iter().filter(meets).count()
}

/// One random action other than undo; `None` if it was refused.
fn act(rng: &mut VesselRng, wounds: &mut Wounds, tree: &VesselTree, heard: &Heard) -> Option<WoundReport> {
    let report = match rng.random_range(0..10) {
        0..5 => {
            let blade = surface(rng);
            let expected = expected_crossings(wounds, tree, &blade);
            let report = wounds.cut(&blade, tree, all(tree));
            assert_eq!(report.severed, expected);
            report
        }
        5 => wounds.cut(&volume(rng, 0.2), tree, all(tree)),
        6 => wounds.cauterise(&volume(rng, 0.3), rng.random_range(0.005..0.05), tree, all(tree)).expect("a volume"),
        7 => wounds.clamp(random_place(rng, tree), tree).ok()?.1,
        8 => wounds.ligate(random_place(rng, tree), tree).ok()?,
        _ => {
            let clamps: Vec<_> = heard.clamps.iter().collect();
            let clamp = **clamps.get(rng.random_range(0..clamps.len().max(1)))?;
            wounds.unclamp(clamp, tree).expect("a clamp that is on")
        }
    };
    Some(report)
}

fn assert_consistent(wounds: &Wounds, tree: &VesselTree, heard: &Heard) {
    let ends: Vec<SeveredEnd> = wounds.ends(tree).collect();
    let ids: BTreeSet<EndId> = ends.iter().map(|end| end.id).collect();
    assert_eq!(ids.len(), ends.len(), "every end has an id of its own");
    let open: BTreeSet<EndId> = ends.iter().filter(|end| end.is_open).map(|end| end.id).collect();
    assert_eq!(open, heard.open);
    assert!(heard.clamps.iter().all(|&clamp| wounds.clamp_place(clamp).is_some()));
    for node in wounds.severed_segments() {
        let pieces: Vec<SegmentPiece> = wounds.pieces(node).collect();
        assert!(pieces.iter().all(|piece| 0.0 <= piece.from && piece.from < piece.to && piece.to <= 1.0));
        assert!(pieces.windows(2).all(|pair| pair[0].to <= pair[1].from), "{pieces:?}");
    }
    for blockage in wounds.blockages() {
        assert!(0.0 <= blockage.first && blockage.first <= blockage.last && blockage.last <= 1.0, "{blockage:?}");
        for (id, share) in [(blockage.proximal, blockage.first), (blockage.distal, blockage.last)] {
            let Some(id) = id else { continue };
            let end = wounds.end(id, tree).expect("an end that is there");
            assert!(end.is_open && end.place == Place::new(blockage.node, share), "{end:?} {blockage:?}");
        }
    }
}

#[test]
fn reports_add_up_and_undo_leads_back() {
    for seed in 0..3 {
        let mut rng = rng(31 + seed);
        let tree = forest(seed, 300);
        let retraction = Retraction { radii: [0.0, 1.5, 30.0][seed as usize], length: 0.0 };
        let mut wounds = Wounds::new(retraction).unwrap();
        let mut heard = Heard::default();
        let mut states = vec![(state(&wounds, &tree), heard.clone())];
        let mut severed = 0;
        for _ in 0..1000 {
            if rng.random_range(0..12) == 0 {
                let actions = rng.random_range(1..5);
                let report = wounds.undo_last(actions, &tree);
                assert_eq!(report.is_empty(), states.len() == 1);
                assert!(report.changed.is_sorted_by(|a, b| a < b), "each once, in their order: {:?}", report.changed);
                heard.hear(&report);
                states.truncate(states.len().saturating_sub(actions).max(1));
                assert_eq!((state(&wounds, &tree), heard.clone()), *states.last().unwrap(), "seed {seed}");
            } else if let Some(report) = act(&mut rng, &mut wounds, &tree, &heard) {
                severed += report.severed;
                heard.hear(&report);
                if !report.is_empty() {
                    states.push((state(&wounds, &tree), heard.clone()));
                }
            }
            assert_consistent(&wounds, &tree, &heard);
            assert_eq!(wounds.actions() + 1, states.len());
        }
        assert!(severed > 400, "seed {seed}: only {severed} severed");
        while let Some(report) = wounds.undo(&tree) {
            heard.hear(&report);
            states.pop();
            assert_eq!((state(&wounds, &tree), heard.clone()), *states.last().unwrap(), "seed {seed}");
        }
        assert!(wounds.is_empty() && heard == Heard::default());
    }
}

/// What was done before stays, whatever is undone, and everything after it can be undone as before.
#[test]
fn permanent_actions_stay_and_later_ones_can_be_undone() {
    for seed in 0..3 {
        let mut rng = rng(61 + seed);
        let tree = forest(seed, 300);
        let mut wounds = Wounds::new(Retraction { radii: 1.5, length: 0.0 }).unwrap();
        let mut heard = Heard::default();
        let mut states = vec![state(&wounds, &tree)];
        for _ in 0..200 {
            if let Some(report) = act(&mut rng, &mut wounds, &tree, &heard) {
                heard.hear(&report);
                if !report.is_empty() {
                    states.push(state(&wounds, &tree));
                }
            }
            if rng.random_range(0..8) == 0 {
                let permanent = rng.random_range(0..5).min(wounds.actions());
                wounds.make_permanent(permanent);
                states.drain(..permanent);
            }
            assert_eq!(wounds.actions() + 1, states.len());
            assert_eq!(state(&wounds, &tree), states[states.len() - 1], "what is permanent looks the same");
            if rng.random_range(0..10) == 0 {
                let actions = rng.random_range(1..9);
                heard.hear(&wounds.undo_last(actions, &tree));
                states.truncate(states.len().saturating_sub(actions).max(1));
                assert_eq!(state(&wounds, &tree), states[states.len() - 1], "seed {seed}");
            }
        }
        heard.hear(&wounds.undo_last(usize::MAX, &tree));
        assert_eq!(state(&wounds, &tree), states[0], "the permanent ones are left");
        assert!(!wounds.is_empty() && wounds.are_lasting());
        heard.hear(&wounds.undo_all(&tree));
        assert!(wounds.is_empty() && heard == Heard::default(), "all heals");
    }
}

#[test]
fn thousands_of_cuts_into_one_vessel_leave_one_more_piece_each() {
    let tree = crate::common::straight(1);
    let mut wounds = Wounds::new(Retraction { radii: 0.001, length: 0.0 }).unwrap();
    let mut rng = rng(41);
    let mut severed = 0;
    for _ in 0..3_000 {
        let x = rng.random_range(0.0..1.0);
        let blade = Blade::rectangle(
            bevy_math::Vec3::X * x,
            bevy_math::vec3(rng.random_range(-0.1..0.1), 1.0, 0.0),
            bevy_math::Vec3::Z,
        );
        severed += wounds.cut(&blade.unwrap(), &tree, all(&tree)).severed;
        assert_eq!(wounds.pieces(NodeId(1)).count(), severed + 1);
    }
    assert!(severed > 2_000, "{severed}");
    assert_eq!(wounds.undo_all(&tree).closed.len(), 2 * severed);
}
