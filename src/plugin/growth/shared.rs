//! Tissues that organs share: those with the same mesh or image, and the same [`TissueSource`].
//!
//! In: what a tissue is made from. Out: one [`SharedTissue`] for all organs that ask for the same, which is prepared
//! once. It lives as long as one of them needs it.

use crate::plugin::{
    growth::{followed::SourceAssets, messages::OrganGrowthError},
    job::Job,
};
use crate::synthesis::tissue::{PreparedTissue, TissueSource};
use bevy::{asset::AssetId, ecs::resource::Resource, image::Image, mesh::Mesh};
use std::{
    collections::BTreeMap,
    fmt,
    sync::{Arc, Mutex, OnceLock, PoisonError, Weak},
};

/// A prepared tissue, or the reason why there is none.
pub(crate) type Prepared = Result<PreparedTissue, OrganGrowthError>;

/// A tissue that any number of organs wait for or grow on. Dropping the last handle stops its preparation.
pub(crate) struct SharedTissue {
    outcome: OnceLock<Prepared>,
    /// The preparation, until its outcome is taken over.
    job: Mutex<Option<Job<Prepared>>>,
}

impl SharedTissue {
    /// The outcome of the preparation, once it is ready.
    pub(crate) fn outcome(&self) -> Option<&Prepared> {
        if self.outcome.get().is_none() {
            // No code panics while it holds the lock.
            let mut job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(outcome) = Job::poll(&mut job) {
                self.outcome.get_or_init(|| outcome.unwrap_or_else(|panic| Err(panic.into())));
            }
        }
        self.outcome.get()
    }

    /// Whether the outcome is there, to be taken over.
    pub(crate) fn is_ready(&self) -> bool {
        let is_done = || self.job.lock().unwrap_or_else(PoisonError::into_inner).as_ref().is_some_and(Job::is_done);
        self.outcome.get().is_some() || is_done()
    }

    /// Share of the preparation that is done, from 0 to 1.
    pub(crate) fn progress(&self) -> f32 {
        let job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
        job.as_ref().map_or(1.0, Job::progress)
    }

    /// Begins the preparation.
    pub(crate) fn await_job(&self, job: Job<Prepared>) {
        *self.job.lock().unwrap_or_else(PoisonError::into_inner) = Some(job);
    }

    /// Gives the outcome to all organs that wait, and stops a preparation under way.
    pub(crate) fn fill(&self, outcome: Prepared) {
        self.outcome.get_or_init(|| outcome);
        *self.job.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Whether nobody prepares it yet.
    pub(crate) fn is_new(&self) -> bool {
        let job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
        self.outcome.get().is_none() && job.is_none()
    }
}

impl fmt::Debug for SharedTissue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SharedTissue").field("outcome", &self.outcome).finish_non_exhaustive()
    }
}

/// All tissues that organs share at present.
#[derive(Resource, Debug, Default)]
pub(crate) struct SharedTissues {
    of_assets: BTreeMap<SourceAssets, Vec<(TissueSource, Weak<SharedTissue>)>>,
}

impl SharedTissues {
    /// The tissue of a source, which is [new](SharedTissue::is_new) if no organ has it.
    pub(crate) fn get(&mut self, source: &TissueSource, assets: SourceAssets) -> Arc<SharedTissue> {
        let assets = assets.needed_by(source);
        let known = self.of_assets.get(&assets).into_iter().flatten().find(|(other, _)| other == source);
        if let Some(tissue) = known.and_then(|(_, tissue)| tissue.upgrade()) {
            return tissue;
        }
        self.drop_unused();
        let tissue = Arc::new(SharedTissue { outcome: OnceLock::new(), job: Mutex::default() });
        self.of_assets.entry(assets).or_default().push((source.clone(), Arc::downgrade(&tissue)));
        tissue
    }

    /// Number of tissues that are in use.
    pub(crate) fn count(&self) -> usize {
        let in_use = |tissue: &Weak<SharedTissue>| tissue.strong_count() > 0;
        self.of_assets.values().flatten().filter(|(_, tissue)| in_use(tissue)).count()
    }

    /// Hands out the tissues of a mesh no longer, because it has other content. Organs that grow on one keep it.
    pub(crate) fn forget_mesh(&mut self, mesh: AssetId<Mesh>) {
        self.of_assets.retain(|assets, _| assets.mesh != Some(mesh));
    }

    /// The same for an image.
    pub(crate) fn forget_image(&mut self, image: AssetId<Image>) {
        self.of_assets.retain(|assets, _| assets.image != Some(image));
    }

    fn drop_unused(&mut self) {
        self.of_assets.retain(|_, tissues| {
            tissues.retain(|(_, tissue)| tissue.strong_count() > 0);
            !tissues.is_empty()
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::tissue::{TissueMode, TissueShape};

    const ASSETS: SourceAssets = SourceAssets { mesh: Some(AssetId::invalid()), image: None };

    #[test]
    fn equal_sources_of_the_same_assets_share_while_somebody_uses_them() {
        let mut tissues = SharedTissues::default();
        let surface = TissueSource::from(TissueMode::Surface);
        let first = tissues.get(&surface, ASSETS);
        assert!(Arc::ptr_eq(&first, &tissues.get(&surface, ASSETS)));
        assert!(!Arc::ptr_eq(&first, &tissues.get(&surface, SourceAssets::default())), "another mesh");
        let volume = tissues.get(&TissueMode::Volume.into(), ASSETS);
        assert!(!Arc::ptr_eq(&first, &volume));
        assert_eq!(tissues.count(), 2, "the one without a user is gone");
        drop(volume);
        assert_eq!(tissues.count(), 1);
        tissues.forget_mesh(AssetId::invalid());
        assert!(!Arc::ptr_eq(&first, &tissues.get(&surface, ASSETS)), "the mesh has other content");
    }

    #[test]
    fn assets_that_a_source_does_not_need_make_no_difference() {
        let (mut tissues, ball) = (SharedTissues::default(), TissueShape::ball(1.0).into());
        let first = tissues.get(&ball, ASSETS);
        assert!(Arc::ptr_eq(&first, &tissues.get(&ball, SourceAssets::default())));
    }

    #[test]
    fn the_first_outcome_stays() {
        let tissue = SharedTissues::default().get(&TissueSource::default(), ASSETS);
        assert!(tissue.is_new() && !tissue.is_ready());
        tissue.fill(Err(crate::synthesis::tissue::TissueError::NoMesh.into()));
        assert!(!tissue.is_new() && tissue.is_ready() && tissue.outcome().is_some_and(Result::is_err));
    }
}
