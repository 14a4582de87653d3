//! What an organ waits for before its growth can step: a tissue, then the start on it.

use crate::plugin::{
    growth::{messages::OrganGrowthError, shared::SharedTissue, start::Start, tissue::PaintedTissue},
    job::Job,
};
use std::sync::Arc;

/// What an organ waits for. Dropping it stops the work, unless other organs wait for it, too.
#[derive(Debug)]
pub(crate) enum Preparation {
    /// The tissue, without paint.
    Tissue(Arc<SharedTissue>),
    /// The start of the growth, on its painted tissue.
    Start(Job<Start>),
}

impl Preparation {
    /// Share of the progress that belongs to the tissue.
    const SHARE_OF_TISSUE: f32 = 0.9;

    /// Whether it is there, to be taken over.
    pub(crate) fn is_ready(&self) -> bool {
        match self {
            Self::Tissue(tissue) => tissue.is_ready(),
            Self::Start(start) => start.is_done(),
        }
    }

    /// Share that is done, from 0 to 1.
    pub(crate) fn progress(&self) -> f32 {
        match self {
            Self::Tissue(tissue) => Self::SHARE_OF_TISSUE * tissue.progress(),
            Self::Start(start) => Self::SHARE_OF_TISSUE + (1.0 - Self::SHARE_OF_TISSUE) * start.progress(),
        }
    }

    /// Takes over an awaited tissue that is ready.
    pub(crate) fn poll_tissue(awaited: &mut Option<Self>) -> Option<Result<PaintedTissue, OrganGrowthError>> {
        let Some(Self::Tissue(tissue)) = awaited else { return None };
        let blank = PaintedTissue::blank(tissue)?;
        *awaited = None;
        Some(blank)
    }

    /// Takes over an awaited start that is ready.
    pub(crate) fn poll_start(awaited: &mut Option<Self>) -> Option<Start> {
        let Some(Self::Start(job)) = awaited.take_if(|awaited| matches!(awaited, Self::Start(_))) else { return None };
        let mut job = Some(job);
        let outcome = Job::poll(&mut job);
        *awaited = job.map(Self::Start);
        Some(outcome?.unwrap_or_else(|panic| Err(panic.into())))
    }
}
