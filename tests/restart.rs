//! What a start derives from the tissue is kept: another start on it asks the tissue next to nothing.

use bevy_math::{Vec3, bounding::Aabb3d};
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings},
    colonization::{Colonization, ColonizationSettings},
    random::VesselRng,
    roots::{RootPlacement, RootPlacements, Roots},
    tissue::{Derived, Disc, Extent, Tissue, TissuePoint},
    tree::VesselKind,
};
use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

/// A disc that counts the questions to it but for samples and depths, for which growth asks, and may keep what is
/// derived from it.
#[derive(Debug)]
struct Counting {
    disc: Disc,
    questions: AtomicUsize,
    derived: Option<Derived>,
}

impl Counting {
    fn new(derived: Option<Derived>) -> Arc<Self> {
        Arc::new(Self { disc: Disc::flat(0.5).expect("a disc"), questions: AtomicUsize::new(0), derived })
    }

    fn count(&self) {
        self.questions.fetch_add(1, Ordering::Relaxed);
    }

    /// Questions since the last time.
    fn asked(&self) -> usize {
        self.questions.swap(0, Ordering::Relaxed)
    }
}

impl Tissue for Counting {
    fn bounds(&self) -> Aabb3d {
        self.disc.bounds()
    }

    fn extent(&self) -> Extent {
        self.disc.extent()
    }

    fn contains(&self, point: Vec3) -> bool {
        self.count();
        self.disc.contains(point)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        self.count();
        self.disc.closest_point(point)
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        self.disc.sample(rng)
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        self.disc.depth(point)
    }

    fn derived(&self) -> Option<&Derived> {
        self.derived.as_ref()
    }
}

/// More questions than this would be the work of placing roots again.
const FEW: usize = 100;

fn roots(artery: RootPlacement) -> Roots {
    RootPlacements { artery, ..RootPlacements::default() }.into()
}

fn placements() -> [Roots; 2] {
    [RootPlacement::Within(Roots::DEFAULT_REACH), RootPlacement::Within(0.3)].map(roots)
}

fn root(growth: &Colonization) -> Vec3 {
    growth.tree(VesselKind::Artery).positions()[0]
}

#[test]
fn a_restart_asks_the_tissue_next_to_nothing() {
    let settings = ColonizationSettings::default();
    for roots in placements() {
        let tissue = Counting::new(None);
        let mut growth = Colonization::new(tissue.clone(), settings.clone(), &roots, 1).expect("valid settings");
        assert!(tissue.asked() > FEW);
        let first = root(&growth);
        growth.restart(settings.clone().scaled(0.9), &roots, 2).expect("valid settings");
        assert!(tissue.asked() < FEW);
        assert_ne!(root(&growth), first);
        growth.restart(settings.clone(), &roots, 1).expect("valid settings");
        assert_eq!(root(&growth), first);
    }
}

#[test]
fn another_growth_on_a_tissue_that_keeps_what_is_derived_asks_it_next_to_nothing() {
    let settings = ColonizationSettings::default();
    for roots in placements() {
        let tissue = Counting::new(Some(Derived::default()));
        let start = |seed| Colonization::new(tissue.clone(), settings.clone(), &roots, seed).expect("valid settings");
        let first = start(1);
        assert!(tissue.asked() > FEW);
        assert_ne!(root(&first), root(&start(2)));
        assert!(tissue.asked() < FEW);
        // What is kept doesn't show in the result.
        let alone = Colonization::new(Counting::new(None), settings.clone(), &roots, 1).expect("valid settings");
        assert_eq!(root(&alone), root(&first));
    }
}

#[test]
fn optimisation_starts_again_without_asking_either() {
    let settings = CcoSettings { terminals: 20, ..CcoSettings::default() };
    let roots = |reach| {
        let artery = RootPlacement::Within(reach);
        RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() }.into()
    };
    let root = |growth: &Cco| growth.tree(VesselKind::Artery).positions()[0];
    let tissue = Counting::new(None);
    let mut growth = Cco::new(tissue.clone(), settings.clone(), &roots(0.8), 1).expect("a growth");
    assert!(tissue.asked() > FEW);
    let first = root(&growth);
    growth.restart(settings.clone(), &roots(0.8), 2).expect("a growth");
    assert!(tissue.asked() < FEW);
    assert_ne!(root(&growth), first);
    // A tissue that keeps what is derived serves another growth, too.
    let tissue = Counting::new(Some(Derived::default()));
    let start = |seed| Cco::new(tissue.clone(), settings.clone(), &roots(0.8), seed).expect("a growth");
    assert_eq!(root(&start(1)), first);
    assert!(tissue.asked() > FEW);
    assert_ne!(root(&start(2)), first);
    assert!(tissue.asked() < FEW);
}
