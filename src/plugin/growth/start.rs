//! The start of a growth: paint is laid over its tissue, its settings are fitted, and its roots are placed.
//!
//! In: a tissue and settings. Out: a growth that has done no step. Most of the time goes into roots that the seed
//! chooses, so that a frame must not wait for it: see [`StartOrder::work`].

use crate::plugin::{
    growth::{messages::OrganGrowthError, tissue::PaintedTissue},
    job::catch_panic,
};
use crate::synthesis::{
    generator::Generator, growth::Growth, pace::Pace, preset::Preset, roots::RootPlacement, tissue::TissuePaint,
    tree::VesselKind,
};
use std::sync::Arc;

/// Everything that a growth starts from.
#[derive(Debug)]
pub(crate) struct StartOrder {
    pub(crate) tissue: PaintedTissue,
    /// The paint to be laid over the tissue, if that has other paint.
    pub(crate) paint: Arc<TissuePaint>,
    pub(crate) settings: Preset,
    pub(crate) seed: u64,
}

/// A growth that has done no step, or the reason why there is none, with its tissue.
pub(crate) struct StartedGrowth {
    pub(crate) tissue: PaintedTissue,
    pub(crate) growth: Result<Box<dyn Growth>, OrganGrowthError>,
}

/// The outcome of a start. An error means that there is no tissue with this paint.
pub(crate) type Start = Result<StartedGrowth, OrganGrowthError>;

impl StartOrder {
    /// Work that a frame does without noticing, in items.
    pub(crate) const LIGHT: usize = 256;
    /// Items of a root that is searched for.
    const ITEMS_OF_SEARCH: usize = 16;
    /// Items of the samples among which the seed chooses roots, with the ways between them.
    const ITEMS_OF_CHOICE: usize = 1 << 16;

    /// Work of the whole start, in items.
    ///
    /// Space colonization only places its roots. Other generators may do anything at their start.
    pub(crate) fn work(&self) -> usize {
        let starting = match &self.settings.generator {
            Generator::Colonization(_) => {
                VesselKind::ALL.iter().map(|&kind| Self::placing_work(&self.settings.roots[kind])).sum()
            }
            Generator::Cco(_) | Generator::Custom(_) => usize::MAX,
        };
        self.tissue.work(&self.paint).saturating_add(starting)
    }

    fn placing_work(placement: &RootPlacement) -> usize {
        match placement {
            RootPlacement::None => 0,
            RootPlacement::Beside => Self::ITEMS_OF_SEARCH,
            RootPlacement::Nearest(points) | RootPlacement::Exact(points) => {
                Self::ITEMS_OF_SEARCH.saturating_mul(points.len())
            }
            RootPlacement::Spread(_) | RootPlacement::Within(_) | RootPlacement::Hilum => Self::ITEMS_OF_CHOICE,
        }
    }

    /// Whether the tissue has its paint already.
    pub(crate) fn has_its_paint(&self) -> bool {
        *self.tissue.paint == *self.paint
    }

    /// Starts the growth in a job.
    pub(crate) async fn carry_out(self, pace: Pace) -> Start {
        let Self { tissue, paint, settings, seed } = self;
        let tissue = tissue.repainted(paint, &pace.part(0.0..0.5)).await?;
        // The start itself can't be divided: it has a stretch of its own.
        pace.rest(0.5).await;
        let growth = start(&tissue, settings, seed, None);
        pace.rest(1.0).await;
        Ok(StartedGrowth { tissue, growth })
    }

    /// Starts the growth now, in place of another one, whose memory is reused if possible. The tissue must have its
    /// paint.
    pub(crate) fn carry_out_now(self, before: Option<Box<dyn Growth>>) -> StartedGrowth {
        let Self { tissue, settings, seed, .. } = self;
        StartedGrowth { growth: start(&tissue, settings, seed, before), tissue }
    }
}

fn start(
    tissue: &PaintedTissue,
    settings: Preset,
    seed: u64,
    before: Option<Box<dyn Growth>>,
) -> Result<Box<dyn Growth>, OrganGrowthError> {
    let tissue = Arc::clone(&tissue.tissue);
    let generator = settings.generator_for(tissue.extent());
    let roots = settings.roots.into();
    // A generator outside this crate may panic. Its tissue is kept, as after an error.
    let growth = catch_panic(|| match before {
        Some(before) => generator.restart(before, tissue, &roots, seed),
        None => generator.start(tissue, &roots, seed),
    })?;
    Ok(growth?)
}
