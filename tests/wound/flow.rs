//! The flow follows the ledger, action by action.

use crate::common::{all, forest, random_point, rng};
use bevy_vessels::synthesis::haemodynamics::{EndSide, FlowSettings, Network};
use bevy_vessels::synthesis::tree::NodeId;
use bevy_vessels::synthesis::wound::{Blade, EndId, Retraction, Wounds};

#[test]
fn the_open_ends_of_the_flow_are_the_outermost_of_the_ledger() {
    let mut rng = rng(71);
    let tree = forest(9, 300);
    let mut wounds = Wounds::new(Retraction::default()).unwrap();
    let mut network = Network::new(&tree, FlowSettings::default()).unwrap();
    for step in 0..60 {
        let [a, b, c] = std::array::from_fn(|_| random_point(&mut rng));
        match step % 4 {
            0 => _ = wounds.cut(&Blade::triangles(vec![[a, b, c]]).unwrap(), &tree, all(&tree)),
            1 => _ = wounds.cut(&Blade::ball(a, 0.2).unwrap(), &tree, all(&tree)),
            2 => _ = wounds.cauterise(&Blade::ball(b, 0.3).unwrap(), 0.03, &tree, all(&tree)).unwrap(),
            _ => _ = wounds.undo(&tree),
        }
        let interruptions: Vec<_> = wounds.interruptions(&tree).collect();
        network.set_interruptions(&interruptions).unwrap();
        let of_flow: Vec<(NodeId, EndSide, f32)> =
            network.open_ends().iter().map(|end| (end.node, end.side, end.along)).collect();
        let outermost: Vec<EndId> =
            wounds.blockages().flat_map(|blockage| [blockage.proximal, blockage.distal]).flatten().collect();
        let of_ledger: Vec<_> = outermost
            .iter()
            .map(|&id| wounds.end(id, &tree).expect("an end that is there"))
            .map(|end| (end.place.node, end.side, end.place.along))
            .collect();
        assert_eq!(of_flow, of_ledger, "step {step}");
    }
    wounds.undo_all(&tree);
    assert_eq!(wounds.interruptions(&tree).count(), 0);
}
