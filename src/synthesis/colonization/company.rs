//! What another thread can do while the arteries grow: the veins, which follow at their own pace, and draws ahead.
//!
//! The arteries never wait for it. Arteries don't depend on veins, so the veins may lag any number of steps behind. Draws
//! that are not ready when they are needed are done again. The other thread works in short bursts and never spins, since a
//! thread that spins beside other programs loses its turn, and then all that waits for it stands still. Only a burst under
//! way when the arteries are done must end first.

use super::candidates::{Ahead, Draws};
use super::settings::ColonizationSettings;
use super::step::Step;
use super::system_growth::{Supplied, SystemGrowth};
use crate::synthesis::parallel;
use crate::synthesis::tissue::Tissue;
use crate::synthesis::tree::BedLink;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Candidates that are drawn ahead, if a step doesn't have more.
const DRAWN_AHEAD: u32 = 16_384;
/// Most steps for which candidates are drawn ahead.
const MOST_STEPS_AHEAD: u32 = 16;

/// The veins while they follow the arteries.
#[derive(Debug, Default)]
pub(super) struct Veins {
    pub growth: SystemGrowth,
    pub links: Vec<BedLink>,
    /// Whether they grew in the last step.
    pub grew: bool,
    /// The drains of the present step.
    taken: Vec<Supplied>,
}

impl Veins {
    /// Veins and their links, before a step of which they don't know.
    pub fn new(growth: SystemGrowth, links: Vec<BedLink>) -> Self {
        Self { growth, links, ..Self::default() }
    }
}

/// Drains that the arteries supplied, step by step, until the veins take them.
#[derive(Debug, Default)]
struct Handed {
    /// Each step, with its number of drains.
    steps: VecDeque<(u32, usize)>,
    supplied: VecDeque<Supplied>,
}

/// What both threads know.
#[derive(Debug)]
pub(super) struct Company {
    tissue: Arc<dyn Tissue>,
    settings: ColonizationSettings,
    handed: Mutex<Handed>,
    veins: Mutex<Veins>,
    ahead: Ahead,
    /// Whether a burst is under way or on its way.
    is_called: AtomicBool,
    is_over: AtomicBool,
}

impl Company {
    /// Company for arteries with these veins.
    pub fn new(tissue: Arc<dyn Tissue>, settings: ColonizationSettings, draws: &Draws, veins: Veins) -> Arc<Self> {
        let (handed, veins) = (Mutex::default(), Mutex::new(veins));
        let ahead = draws.ahead((DRAWN_AHEAD / settings.samples.max(1)).clamp(1, MOST_STEPS_AHEAD));
        Arc::new(Self {
            tissue,
            settings,
            handed,
            veins,
            ahead,
            is_called: AtomicBool::new(false),
            is_over: AtomicBool::new(false),
        })
    }

    /// Candidates that may have been drawn ahead.
    pub fn ahead(&self) -> &Ahead {
        &self.ahead
    }

    /// Hands the drains that the arteries supplied in a step over to the veins.
    pub fn hand(&self, step: u32, supplied: &[Supplied]) {
        let mut handed = lock(&self.handed);
        handed.steps.push_back((step, supplied.len()));
        handed.supplied.extend(supplied);
    }

    /// Calls another thread, if there is one, for a burst of work, once there is some.
    pub fn call(self: &Arc<Self>) {
        let burst = self.ahead.steps().div_ceil(2) as usize;
        let waiting = lock(&self.handed).steps.len();
        if (waiting >= burst || self.ahead.lacks(burst)) && !self.is_called.swap(true, Ordering::AcqRel) {
            let company = Arc::clone(self);
            let comes = parallel::beside(move || company.burst());
            // Without another thread, the veins at least don't fall behind.
            if !comes {
                self.is_called.store(false, Ordering::Release);
                self.catch_up(|_| ());
            }
        }
    }

    fn burst(&self) {
        if let Ok(mut veins) = self.veins.try_lock() {
            self.grow_veins(&mut veins);
        }
        let at = |number: u32| Step { tissue: &*self.tissue, settings: &self.settings, number }.sampling();
        while !self.is_over.load(Ordering::Acquire) {
            if !self.ahead.draw_next(at) {
                break;
            }
        }
        self.is_called.store(false, Ordering::Release);
    }

    fn grow_veins(&self, veins: &mut Veins) {
        loop {
            let number = {
                let mut handed = lock(&self.handed);
                let Some((number, count)) = handed.steps.pop_front() else { return };
                veins.taken.clear();
                veins.taken.extend(handed.supplied.drain(..count));
                number
            };
            let step = Step { tissue: &*self.tissue, settings: &self.settings, number };
            let Veins { growth, links, taken, .. } = veins;
            // The veins are locked.
            let report = parallel::alone(|| step.grow_veins(growth, taken, links));
            veins.grew = report.new_nodes > 0;
        }
    }

    /// Lets the veins do all steps that the arteries have done, and looks at them.
    pub fn catch_up<R>(&self, look: impl FnOnce(&mut Veins) -> R) -> R {
        let mut veins = self.veins.lock().expect("the tissue has panicked on another thread");
        self.grow_veins(&mut veins);
        look(&mut veins)
    }

    /// Ends all work ahead, and returns the veins once they have done all steps.
    pub fn end(&self) -> Veins {
        self.is_over.store(true, Ordering::Release);
        self.catch_up(std::mem::take)
    }
}

/// What a lock protects, even after a panic: it goes on to whoever called.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
