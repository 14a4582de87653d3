//! File form of the ledger: the wounds of a tree, without the undo history.

use crate::synthesis::wound::{
    Retraction, WoundError, Wounds,
    injury::{ClosureKind, Gap, Injury},
    ledger::Record,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
use std::collections::BTreeMap;

/// [`Wounds`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Wounds", deny_unknown_fields)]
struct SavedWounds {
    retraction: Retraction,
    generation: u32,
    injuries: BTreeMap<u32, Injury>,
    ends: Vec<Record>,
    clamps: Vec<Record>,
}

impl From<Wounds> for SavedWounds {
    fn from(wounds: Wounds) -> Self {
        let Wounds { retraction, generation, injuries, ends, clamps, .. } = wounds;
        Self { retraction, generation, injuries, ends, clamps }
    }
}

impl TryFrom<SavedWounds> for Wounds {
    type Error = WoundError;

    fn try_from(saved: SavedWounds) -> Result<Self, WoundError> {
        for (&node, injury) in &saved.injuries {
            saved.check(node, injury).map_err(|what| WoundError::BrokenLedger { node, what })?;
        }
        let mut wounds = Self::new(saved.retraction)?;
        wounds.generation = saved.generation;
        (wounds.injuries, wounds.ends, wounds.clamps) = (saved.injuries, saved.ends, saved.clamps);
        Ok(wounds)
    }
}

impl Serialize for Wounds {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SavedWounds::from(self.without_history()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Wounds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        SavedWounds::deserialize(deserializer)?.try_into().map_err(D::Error::custom)
    }
}

impl SavedWounds {
    /// Checks that an injury is one that the ledger itself could write.
    fn check(&self, node: u32, injury: &Injury) -> Result<(), &'static str> {
        let is_listed =
            |list: &[Record], index: u32| list.get(index as usize).is_some_and(|record| record.node == node);
        let is_stretch = |from: f32, to: f32| 0.0 <= from && from <= to && to <= 1.0;
        if injury.is_empty() {
            return Err("nothing was done to it");
        }
        if !injury.gaps().iter().all(|gap| is_stretch(gap.from, gap.to)) {
            return Err("a gap does not lie between 0 and 1");
        }
        if !injury.closures().iter().all(|closure| is_stretch(closure.from, closure.to)) {
            return Err("a closure does not lie between 0 and 1");
        }
        if !injury.gaps().is_sorted_by(|a, b| a.to <= b.from) {
            return Err("its gaps overlap, or are out of order");
        }
        if !injury.closures().is_sorted_by(|a, b| a.from <= b.from) {
            return Err("its closures are out of order");
        }
        let tips = |gap: &Gap| gap.proximal.into_iter().chain(gap.distal);
        if !injury.gaps().iter().flat_map(tips).all(|tip| is_listed(&self.ends, tip.end)) {
            return Err("it has an end that is not in the list of ends");
        }
        let is_known = |kind: ClosureKind| match kind {
            ClosureKind::Clamp(clamp) => is_listed(&self.clamps, clamp),
            ClosureKind::Tie | ClosureKind::Seal => true,
        };
        if !injury.closures().iter().all(|closure| is_known(closure.kind)) {
            return Err("it has a clamp that is not in the list of clamps");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::{
        segment_index::Region,
        tree::{NO_PARENT, NodeId, Place, VesselTree},
        wound::{Blade, Wounds},
    };
    use bevy_math::Vec3;

    fn tree() -> VesselTree {
        let positions = vec![Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
        VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1], vec![0.1; 3]).expect("a tree")
    }

    fn wounds(tree: &VesselTree) -> Wounds {
        let mut wounds = Wounds::default();
        let every_segment = |_: &Region, visit: &mut dyn FnMut(NodeId)| (1..3).for_each(|node| visit(NodeId(node)));
        let blade = Blade::disc(0.5 * Vec3::X, Vec3::X, 0.3).expect("a disc");
        wounds.cut(&blade, tree, every_segment);
        wounds.clamp(Place::new(NodeId(2), 0.25), tree).expect("a vessel");
        wounds.ligate(Place::new(NodeId(2), 0.5), tree).expect("a vessel");
        let heat = Blade::ball(1.9 * Vec3::X, 0.2).expect("a ball");
        wounds.cauterise(&heat, f32::INFINITY, tree, every_segment).expect("a ball seals");
        wounds
    }

    #[test]
    fn a_file_keeps_all_but_the_history() {
        let tree = tree();
        let wounds = wounds(&tree);
        let text = ron::to_string(&wounds).expect("a ledger can be written");
        let mut read: Wounds = ron::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert!(wounds.ends(&tree).eq(read.ends(&tree)));
        assert!(wounds.blockages().eq(read.blockages()));
        assert!(wounds.clamps().eq(read.clamps()) && wounds.clamps().count() == 1);
        assert_eq!(read.generation(), wounds.generation());
        assert!(read.fits(&tree) && read.actions() == 0 && read.undo(&tree).is_none());
        let clamp = read.clamps().next().expect("a clamp");
        assert_eq!(read.unclamp(clamp, &tree).map(|report| report.unclamped), Ok(vec![clamp]));
        read.undo(&tree).expect("an action after loading can be undone");
        assert!(!read.undo_all(&tree).is_empty() && read.is_empty());
    }

    #[test]
    fn ledgers_that_no_action_writes_are_refused_by_name() {
        let text = ron::to_string(&wounds(&tree())).expect("a ledger can be written");
        for (there, instead, message) in [
            ("ends:[(node:1,", "ends:[(node:7,", "list of ends"),
            ("clamps:[(node:2,generation:2)]", "clamps:[]", "list of clamps"),
            ("radii:1.5", "radii:-1.5", "radii"),
            ("from:0.25,to:0.25", "from:0.25,to:7.5", "between 0 and 1"),
            ("from:0.25,to:0.25", "from:0.75,to:0.75", "out of order"),
        ] {
            assert!(text.contains(there), "{there} is not in {text}");
            let error = ron::from_str::<Wounds>(&text.replace(there, instead)).expect_err("a broken ledger");
            assert!(error.to_string().contains(message), "{error}");
        }
    }

    #[test]
    fn a_ledger_fits_no_smaller_tree() {
        let wounds = wounds(&tree());
        let shorter = VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![0.1; 2]);
        assert!(!wounds.fits(&shorter.expect("a tree")));
    }
}
