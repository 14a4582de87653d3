//! The parts of a step, in their order: candidates, arteries, veins.

use super::candidates::{Ahead, Candidates, Draws, Sampling};
use super::report::SystemReport;
use super::settings::ColonizationSettings;
use super::system_growth::{Ground, Supplied, SystemGrowth};
use super::vacancy::Vacancy;
use crate::synthesis::tissue::{Extent, Tissue};
use crate::synthesis::tree::BedLink;

/// A step, which may be done part by part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step<'a> {
    pub tissue: &'a dyn Tissue,
    pub settings: &'a ColonizationSettings,
    /// Number of the step, from 1.
    pub number: u32,
}

impl<'a> Step<'a> {
    /// Draws candidates, unless that has been done ahead, and finds those in tissue that the arteries supply. They are
    /// drawn from vacant tissue if that is known.
    pub fn choose_candidates(
        self,
        (draws, ahead): (&mut Draws, Option<&Ahead>),
        candidates: &mut Candidates,
        vacancy: &mut Vacancy,
        arteries: &SystemGrowth,
    ) {
        // A staged tissue changes from stage to stage, and has no pieces of its own.
        if self.tissue.stage(1).is_none() {
            let (forest, drains) = (&arteries.forest, arteries.drains.living());
            let nodes = (forest.tree.positions(), |node, side| forest.supplies(node, side));
            vacancy.prepare(self.tissue, arteries.length_scale(), nodes, drains);
        }
        draws.draw(self.sampling(), vacancy.chosen(), ahead);
        let ground = self.ground();
        candidates.take(draws, &self.tissue.bounds(), |some, refused| arteries.refuse(some, ground, refused));
    }

    /// Where its candidates are drawn from.
    pub fn sampling(self) -> Sampling<'a> {
        let Self { tissue, settings, number } = self;
        Sampling { tissue: tissue.at_step(number), step: number, last: settings.steps, count: settings.samples }
    }

    /// Makes candidates in unsupplied tissue drains, and grows the arteries towards them. Returns the number of drains
    /// born.
    pub fn grow_arteries(
        self,
        arteries: &mut SystemGrowth,
        candidates: &Candidates,
        vacancy: &mut Vacancy,
    ) -> (u32, SystemReport) {
        self.enter_stage(arteries);
        let mut born = 0;
        for candidate in candidates.iter() {
            if let Some(drain) = arteries.offer_drain(candidate, self.ground()) {
                vacancy.add_drain(drain, candidate);
                born += 1;
            }
        }
        let report = arteries.grow(self.ground(), self.number);
        arteries.supplied().iter().for_each(|supplied| vacancy.remove_drain(supplied.drain, supplied.at.position));
        arteries.advance_tissue(self.number);
        (born, report)
    }

    /// Hands over the drains that the arteries `supplied` in this step, and grows the veins towards them.
    pub fn grow_veins(self, veins: &mut SystemGrowth, supplied: &[Supplied], links: &mut Vec<BedLink>) -> SystemReport {
        let mut report = SystemReport::default();
        if !veins.forest.tree.is_empty() {
            self.enter_stage(veins);
            veins.receive(supplied);
            report = veins.grow(self.ground(), self.number);
            links.extend(veins.links());
        }
        veins.advance_tissue(self.number);
        report
    }

    /// If another tissue is in force from this step on, lets a system take it up.
    fn enter_stage(self, system: &mut SystemGrowth) {
        let before = self.tissue.at_step(self.number.saturating_sub(1).max(1));
        if !std::ptr::addr_eq(before, self.tissue.at_step(self.number)) {
            system.stand_on(self.ground());
        }
    }

    /// The tissue and rules for placing new nodes.
    pub fn ground(self) -> Ground<'a> {
        let tissue = self.tissue.at_step(self.number);
        let surface = matches!(tissue.extent(), Extent::Area(_));
        let (confine, normals) = (self.settings.confine, self.settings.stand_off && surface);
        Ground { tissue, no_go: tissue.no_go(), confine, normals }
    }

    /// Number of steps in a row without growth, given the number before this step and whether this one `acted`. Steps
    /// do not count while tissue that grows or changes may need more vessels.
    pub fn idle_after(self, idle: u32, acted: bool) -> u32 {
        let settled = self.settings.systems().iter().all(|(_, system)| system.tissue_growth.is_over(self.number));
        if acted || !settled || self.tissue.stage(self.number).is_some() { 0 } else { idle + 1 }
    }
}
