//! The changes in the vessels of an entity, for any number of readers, each at its own pace.
//!
//! In: nodes that a writer marks. Out: for each reader, the segments that changed since it last read. A writer doesn't
//! know its readers: each node has a stamp, the revision of its last change, and a reader remembers a revision.

use crate::plugin::{lineage::Lineage, vessels::changes::Changes};
use bevy::ecs::component::Component;

/// The last change of each segment of a vessel entity.
///
/// A segment has changed if either of its ends moved or changed its radius, or if it was cut, clamped, sealed or
/// healed. While an organ grows, a step changes a tenth of all segments, scattered over the whole tree along the paths
/// from the new tips to the roots. Therefore each segment has a stamp of its own.
///
/// Code that keeps data derived from segments, such as a buffer on the graphics card, a file or a texture, reads with
/// its own [`ChangeCursor`], as often as it likes. Reading changes nothing for other readers.
///
/// The plugin marks what it changes, and marks everything when [`Vessels`](crate::plugin::Vessels) are replaced. An app
/// that changes vessels itself calls [`Vessels::update_from_tree`](crate::plugin::Vessels::update_from_tree), which
/// marks the differences.
///
/// Memory: 4 bytes a node, once nodes are marked one by one.
///
/// ```
/// # use bevy_vessels::plugin::{ChangeCursor, ChangeLog, Vessels};
/// # use bevy::prelude::{Entity, Local, Query};
/// # use std::collections::BTreeMap;
/// /// Once a second, say: how many segments changed since the last time.
/// fn count(vessels: Query<(Entity, &Vessels, &ChangeLog)>, mut cursors: Local<BTreeMap<Entity, ChangeCursor>>) {
///     for (entity, vessels, log) in &vessels {
///         let changes = cursors.entry(entity).or_default().read(log);
///         println!("{} segments changed", changes.count(vessels.tree().len()));
///     }
/// }
/// # bevy::ecs::system::assert_is_system(count);
/// ```
#[derive(Component, Debug)]
pub struct ChangeLog {
    /// Identity of this log and its count of revisions.
    id: Lineage,
    /// The logged tree.
    tree: Lineage,
    /// Revision of the last change.
    revision: u32,
    /// Revision at which everything changed; 0 for never.
    all: u32,
    /// Revision of each node's last change, 0 for none.
    stamps: Vec<[u32; 64]>,
    /// Summaries of the stamps, which are enough for most readers.
    words: Vec<Word>,
}

/// Summary of the stamps of 64 nodes.
#[derive(Clone, Copy, Debug, Default)]
struct Word {
    /// The largest stamp.
    latest: u32,
    /// At least as large as all others.
    before: u32,
    /// The nodes that have the largest stamp.
    newest: u64,
}

impl Word {
    fn mark(&mut self, place: usize, revision: u32) {
        if self.latest != revision {
            *self = Self { latest: revision, before: self.latest, newest: 0 };
        }
        self.newest |= 1 << place;
    }

    /// The nodes whose stamps are above a revision. A reader that has seen all but the last change needs no stamps.
    fn newer(&self, stamps: &[u32; 64], seen: u32) -> u64 {
        if self.latest <= seen {
            0
        } else if self.before <= seen {
            self.newest
        } else {
            newer(stamps, seen)
        }
    }
}

/// A reader's position in a [`ChangeLog`]. The default has seen nothing, so everything counts as changed.
///
/// It belongs to the log that it last read. In any other log, such as that of a replacing entity, it has seen nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChangeCursor {
    log: Lineage,
    revision: u32,
}

impl ChangeCursor {
    /// Returns the changes since this cursor last read, and moves the cursor to the present.
    ///
    /// The cost is one check for every 64 nodes, and a comparison of each of the 64 if they have more than one change
    /// to read.
    #[must_use = "the cursor has moved on: what changed is told once"]
    pub fn read(&mut self, log: &ChangeLog) -> Changes {
        let seen = std::mem::replace(self, log.now());
        log.since(&seen)
    }

    /// Whether there is nothing to read. Costs nothing.
    pub fn is_current(&self, log: &ChangeLog) -> bool {
        *self == log.now()
    }
}

impl ChangeLog {
    /// Marks the segments that end in some nodes, as one change.
    pub fn mark(&mut self, nodes: impl IntoIterator<Item = usize>) {
        let mut nodes = nodes.into_iter().peekable();
        if nodes.peek().is_none() {
            return;
        }
        self.begin_revision();
        for node in nodes {
            let (word, place) = (node / 64, node % 64);
            if word >= self.words.len() {
                self.stamps.resize(word + 1, [0; 64]);
                self.words.resize(word + 1, Word::default());
            }
            self.stamps[word][place] = self.revision;
            self.words[word].mark(place, self.revision);
        }
    }

    /// Marks every segment, however many there are.
    pub fn mark_all(&mut self) {
        self.begin_revision();
        self.all = self.revision;
    }

    /// A cursor that has seen all changes so far.
    pub fn now(&self) -> ChangeCursor {
        ChangeCursor { log: self.id, revision: self.revision }
    }

    /// Whether the log is that of this tree.
    pub(crate) fn is_of(&self, tree: Lineage) -> bool {
        self.tree == tree
    }

    /// Begins with another tree, in which everything is new.
    pub(crate) fn begin_tree(&mut self, tree: Lineage) {
        self.tree = tree;
        self.mark_all();
    }

    /// Counts up. After the last revision the log starts over with another identity, so that no reader misses anything.
    fn begin_revision(&mut self) {
        self.revision = self.revision.checked_add(1).unwrap_or_else(|| {
            *self = Self { tree: self.tree, ..Self::default() };
            1
        });
    }

    fn since(&self, seen: &ChangeCursor) -> Changes {
        if seen.log != self.id || seen.revision < self.all {
            return Changes::ALL;
        }
        let end = self.words.iter().rposition(|word| word.latest > seen.revision).map_or(0, |last| last + 1);
        let words = self.words[..end].iter().zip(&self.stamps);
        Changes::of_words(words.map(|(word, stamps)| word.newer(stamps, seen.revision)).collect())
    }
}

impl Default for ChangeLog {
    fn default() -> Self {
        Self {
            id: Lineage::new_one(),
            tree: Lineage::default(),
            revision: 0,
            all: 0,
            stamps: Vec::new(),
            words: Vec::new(),
        }
    }
}

/// A bit for each stamp above a revision. Without branches, so that the comparisons are vectorised.
fn newer(stamps: &[u32; 64], revision: u32) -> u64 {
    /// Moves the lowest bit of each byte, the first byte's first, into the highest byte.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let flags = stamps.map(|stamp| u8::from(stamp > revision));
    let (eights, _) = flags.as_chunks::<8>();
    let bits = eights.iter().enumerate().map(|(eight, flags)| {
        let bits = u64::from_le_bytes(*flags).wrapping_mul(GATHER) >> 56;
        bits << (8 * eight)
    });
    bits.fold(0, |all, bits| all | bits)
}

#[cfg(test)]
mod tests {
    use crate::plugin::vessels::change_log::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;
    use std::collections::BTreeSet;

    const NODES: usize = 1000;

    /// A reader, and the nodes that it has not seen yet according to a slow reference log.
    #[derive(Default)]
    struct Reader {
        cursor: ChangeCursor,
        unseen: BTreeSet<usize>,
        period: usize,
    }

    impl Reader {
        fn check(&mut self, log: &ChangeLog, what: &str) {
            let unseen: Vec<usize> = std::mem::take(&mut self.unseen).into_iter().collect();
            let was_current = self.cursor.is_current(log);
            let changes = self.cursor.read(log);
            assert_eq!(changes.dirty_nodes(0..NODES).collect::<Vec<_>>(), unseen, "{what}");
            assert_eq!(changes.count(NODES), unseen.len(), "{what}");
            assert_eq!(changes.is_empty(), unseen.is_empty(), "{what}");
            assert_eq!(was_current, unseen.is_empty(), "{what}");
            assert!(self.cursor.is_current(log), "{what}");
        }
    }

    /// Random marks, with readers that read every frame, every few frames, and very seldom.
    fn read_at_different_rates(mut log: ChangeLog, seed: u64) {
        let mut rng = Stream::Statistics.rng(seed);
        let new = |period| Reader { period, unseen: (0..NODES).collect(), ..Reader::default() };
        let mut readers = [1, 3, 7, 50].map(new);
        for frame in 1..=400 {
            for _ in 0..rng.random_range(0..4) {
                let marked: Vec<usize> = match rng.random_range(0..40) {
                    0 => {
                        log.mark_all();
                        (0..NODES).collect()
                    }
                    kind => {
                        let most = if kind < 30 { 6 } else { NODES };
                        (0..rng.random_range(0..most)).map(|_| rng.random_range(0..NODES)).collect()
                    }
                };
                if marked.len() < NODES {
                    log.mark(marked.iter().copied());
                }
                readers.iter_mut().for_each(|reader| reader.unseen.extend(&marked));
            }
            for reader in readers.iter_mut().filter(|reader| frame % reader.period == 0) {
                reader.check(&log, &format!("seed {seed}, frame {frame}, every {}", reader.period));
            }
        }
    }

    #[test]
    fn each_reader_sees_what_it_has_not_seen_at_any_rate() {
        (0..20).for_each(|seed| read_at_different_rates(ChangeLog::default(), seed));
    }

    #[test]
    fn a_new_reader_sees_everything_and_then_only_what_changes() {
        let mut log = ChangeLog::default();
        let mut cursor = ChangeCursor::default();
        assert!(!cursor.is_current(&log));
        assert!(cursor.read(&log).is_all());
        assert!(cursor.is_current(&log) && cursor.read(&log).is_empty());
        log.mark([]);
        assert!(cursor.is_current(&log), "no nodes are no change");
        log.mark([700, 3, 3]);
        assert!(!cursor.is_current(&log));
        assert_eq!(cursor.read(&log).dirty_ranges(NODES).collect::<Vec<_>>(), [3..4, 700..701]);
        log.mark_all();
        log.mark([5]);
        assert!(cursor.read(&log).is_all());
        assert!(cursor.read(&log).is_empty());
    }

    #[test]
    fn a_cursor_of_another_log_has_seen_nothing() {
        let [mut one, mut other] = [(); 2].map(|()| ChangeLog::default());
        one.mark([1]);
        other.mark([2]);
        let mut cursor = one.now();
        assert!(cursor.read(&one).is_empty());
        assert!(cursor.read(&other).is_all(), "whatever its revision");
        assert!(cursor.read(&other).is_empty());
        assert!(cursor.read(&one).is_all(), "and back");
    }

    #[test]
    fn another_tree_is_changed_throughout() {
        let mut log = ChangeLog::default();
        let tree = Lineage::new_one();
        log.begin_tree(tree);
        let mut cursor = log.now();
        assert!(log.is_of(tree) && cursor.read(&log).is_empty());
        log.begin_tree(Lineage::new_one());
        assert!(!log.is_of(tree) && cursor.read(&log).is_all());
    }

    #[test]
    fn no_reader_misses_anything_when_revisions_run_out() {
        let mut log = ChangeLog { revision: u32::MAX - 1, ..ChangeLog::default() };
        let (mut current, stale) = (log.now(), ChangeCursor { log: log.id, revision: 7 });
        log.mark([1]);
        assert_eq!(current.read(&log).dirty_nodes(0..NODES).collect::<Vec<_>>(), [1]);
        log.mark([2]);
        for mut cursor in [current, stale, ChangeCursor::default()] {
            assert!(cursor.read(&log).is_all());
            log.mark([3]);
            assert_eq!(cursor.read(&log).dirty_nodes(0..NODES).collect::<Vec<_>>(), [3], "and goes on");
        }
    }

    #[test]
    fn stamps_compare_as_one_by_one() {
        let mut rng = Stream::Statistics.rng(1);
        for revision in [0, 1, 5, u32::MAX / 2, u32::MAX - 1, u32::MAX] {
            for _ in 0..200 {
                let stamps: [u32; 64] = std::array::from_fn(|_| match rng.random_range(0..3) {
                    0 => rng.random(),
                    1 => revision.wrapping_add(rng.random_range(0..3)).wrapping_sub(1),
                    _ => 0,
                });
                let bit = |place: usize| u64::from(stamps[place] > revision) << place;
                assert_eq!(newer(&stamps, revision), (0..64).map(bit).sum::<u64>(), "{stamps:?} above {revision}");
            }
        }
    }
}
