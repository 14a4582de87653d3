//! Work on many items, on all threads if that pays, with the same result on any number of threads.

/// Fewest items worth handing to another thread that is awake, if each takes some tenths of a microsecond.
const WORTH_SHARING: usize = 256;
/// Fewest items worth waking another thread for.
const WORTH_WAKING: usize = 2048;

#[cfg(feature = "parallel")]
mod threads {
    use std::cell::Cell;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Mutex, PoisonError};

    /// Shares of the work for each thread: enough to balance shares that take longer than others.
    const SHARES: usize = 8;
    /// Number of times that a thread checks whether the others are done before it sleeps: some tenths of a millisecond.
    /// Waking takes nearly as long.
    const PATIENCE: usize = 16_384;

    thread_local! {
        /// Whether this thread shares no work for now.
        static ALONE: Cell<bool> = const { Cell::new(false) };
    }

    /// Number of threads to share work with, this one included.
    pub fn count() -> usize {
        if ALONE.get() { 1 } else { rayon::current_num_threads() }
    }

    /// Does some work without sharing it.
    pub fn alone<R>(act: impl FnOnce() -> R) -> R {
        struct Before(bool);
        impl Drop for Before {
            fn drop(&mut self) {
                ALONE.set(self.0);
            }
        }
        let _before = Before(ALONE.replace(true));
        act()
    }

    /// Number of items that a thread takes at a time; `None` if they are not worth sharing.
    pub fn share_of(items: usize, least: usize) -> Option<usize> {
        let threads = count();
        (threads > 1 && items >= 2 * least).then(|| items.div_ceil(SHARES * threads).max(least.div_ceil(4)))
    }

    /// Does `own` work, and `count` shares of other work. Threads take the next share in turn. Returns whether none was
    /// so late that this one had to wait.
    pub fn take_turns<S: Send>(
        count: usize,
        shares: impl Iterator<Item = S> + Send,
        act: impl Fn(S) + Sync,
        own: impl FnOnce() + Send,
    ) -> bool {
        let (shares, inside) = (Mutex::new(shares), AtomicUsize::new(0));
        // The lock is held only while the next share is taken.
        let next = || shares.lock().unwrap_or_else(PoisonError::into_inner).next();
        let work = || {
            while let Some(share) = next() {
                act(share);
            }
        };
        let help = || {
            inside.fetch_add(1, Ordering::AcqRel);
            work();
            inside.fetch_sub(1, Ordering::AcqRel);
        };
        let lead = || {
            own();
            work();
            // All shares are taken, so whoever is inside does the last ones.
            let are_done = |_: &usize| {
                std::hint::spin_loop();
                inside.load(Ordering::Acquire) == 0
            };
            (0..PATIENCE).find(are_done).is_some()
        };
        rayon::join(lead, || on_threads(count.min(rayon::current_num_threads()) - 1, &help)).0
    }

    /// Does the same work on several threads at once.
    fn on_threads(count: usize, work: &(impl Fn() + Sync)) {
        if count > 1 {
            rayon::join(work, || on_threads(count - 1, work));
        } else {
            work();
        }
    }
}

/// Calls `act` for every item and its index. Each item is worth a thread of its own.
pub(crate) fn for_each<T: Send>(items: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    #[cfg(feature = "parallel")]
    if items.len() > 1 && threads::count() > 1 {
        threads::take_turns(items.len(), items.iter_mut().enumerate(), |(index, item)| act(index, item), || ());
        return;
    }
    items.iter_mut().enumerate().for_each(|(index, item)| act(index, item));
}

/// Help by other threads with small parts of long work.
///
/// A thread beside other programs may lose its turn in the middle of an item, and then all wait for it. So after a part
/// with a late thread, some parts are done without any, twice as many each time that this happens. Where threads are
/// hardly ever late, that is soon forgotten.
#[derive(Clone, Debug, Default)]
pub(crate) struct Help {
    /// Parts still to be done without.
    without: u32,
    /// Parts that were done without, after the last time that a thread was late.
    pause: u32,
}

#[cfg_attr(not(feature = "parallel"), expect(dead_code, reason = "there is no other thread"))]
impl Help {
    /// Fewest and most parts that are done without help after a thread was late.
    const PAUSES: [u32; 2] = [64, 4096];
    /// A part in time takes this share off the pause. So pauses become longer if more than one part in fifty is late,
    /// which costs as much as help gains.
    const FORGOTTEN: u32 = 64;

    /// Does `own`, and calls `act` for every item and its index: at the same time, if there is help.
    pub fn for_each<T: Send>(
        &mut self,
        items: &mut [T],
        act: impl Fn(usize, &mut T) + Sync,
        own: impl FnOnce() + Send,
    ) {
        #[cfg(feature = "parallel")]
        if items.len() > 1 && threads::count() > 1 && self.is_due() {
            let shares = items.iter_mut().enumerate();
            let in_time = threads::take_turns(shares.len(), shares, |(index, item)| act(index, item), own);
            return self.learn(in_time);
        }
        own();
        items.iter_mut().enumerate().for_each(|(index, item)| act(index, item));
    }

    /// Whether the next part may be shared.
    fn is_due(&mut self) -> bool {
        let is_due = self.without == 0;
        self.without = self.without.saturating_sub(1);
        is_due
    }

    fn learn(&mut self, in_time: bool) {
        if in_time {
            self.pause -= self.pause.div_ceil(Self::FORGOTTEN);
        } else {
            self.pause = (2 * self.pause).clamp(Self::PAUSES[0], Self::PAUSES[1]);
            self.without = self.pause;
        }
    }
}

/// Starts work on another thread, if there is one, and tells whether there is. Nobody waits for it. A panic ends it.
#[cfg_attr(not(feature = "parallel"), expect(unused_variables, reason = "there is no other thread"))]
pub(crate) fn beside(act: impl FnOnce() + Send + 'static) -> bool {
    #[cfg(feature = "parallel")]
    if threads::count() > 1 {
        use std::panic::{AssertUnwindSafe, catch_unwind};
        rayon::spawn(|| _ = catch_unwind(AssertUnwindSafe(act)));
        return true;
    }
    false
}

/// Does work that shares nothing, such as while it holds a lock: a thread that waits for others may take up any other
/// work, and that may wait for the same lock.
pub(crate) fn alone<R>(act: impl FnOnce() -> R) -> R {
    #[cfg(feature = "parallel")]
    let act = || threads::alone(act);
    act()
}

/// Does work on a thread that shares with others at once, if there are others.
pub(crate) fn within_pool<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if threads::count() > 1 && rayon::current_thread_index().is_none() {
        return rayon::join(act, || ()).0;
    }
    act()
}

/// Fills `outputs` with `map` of each input, in order. `blank` only sizes the buffer.
pub(crate) fn map_into<I, O>(inputs: &[I], outputs: &mut Vec<O>, blank: O, map: impl Fn(&I) -> O + Sync)
where
    I: Sync,
    O: Clone + Send,
{
    refill(inputs, outputs, blank, WORTH_SHARING, map);
}

/// As [`map_into`], for work whose threads sleep between.
pub(crate) fn map_many_into<I, O>(inputs: &[I], outputs: &mut Vec<O>, blank: O, map: impl Fn(&I) -> O + Sync)
where
    I: Sync,
    O: Clone + Send,
{
    refill(inputs, outputs, blank, WORTH_WAKING, map);
}

fn refill<I, O>(inputs: &[I], outputs: &mut Vec<O>, blank: O, least: usize, map: impl Fn(&I) -> O + Sync)
where
    I: Sync,
    O: Clone + Send,
{
    outputs.clear();
    outputs.resize(inputs.len(), blank);
    map_all(inputs, outputs, least, |_, input| map(input));
}

/// Fills `outputs` with `map` of each index and input. Fewer than twice `least` of them are not worth sharing.
pub(crate) fn map_all<I, O>(inputs: &[I], outputs: &mut [O], least: usize, map: impl Fn(usize, &I) -> O + Sync)
where
    I: Sync,
    O: Send,
{
    zip_shares(inputs, outputs, least, |first, inputs, outputs| {
        for (index, (output, input)) in (first..).zip(outputs.iter_mut().zip(inputs)) {
            *output = map(index, input);
        }
    });
}

/// Lets `act` fill the outputs of the inputs, some at a time, for work whose threads sleep between.
pub(crate) fn zip_chunks<I: Sync, O: Send>(inputs: &[I], outputs: &mut [O], act: impl Fn(&[I], &mut [O]) + Sync) {
    zip_shares(inputs, outputs, WORTH_WAKING, |_, inputs, outputs| act(inputs, outputs));
}

/// As [`zip_chunks`], but `act` also gets the index of a chunk's first item.
#[cfg_attr(not(feature = "parallel"), expect(unused_variables, reason = "one thread shares with no other"))]
fn zip_shares<I, O>(inputs: &[I], outputs: &mut [O], least: usize, act: impl Fn(usize, &[I], &mut [O]) + Sync)
where
    I: Sync,
    O: Send,
{
    #[cfg(feature = "parallel")]
    if let Some(share) = threads::share_of(inputs.len(), least) {
        let shares = inputs.chunks(share).zip(outputs.chunks_mut(share)).enumerate();
        threads::take_turns(
            shares.len(),
            shares,
            |(number, (inputs, outputs))| act(number * share, inputs, outputs),
            || (),
        );
        return;
    }
    act(0, inputs, outputs);
}

#[cfg(all(test, feature = "parallel"))]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    fn on(threads: usize, act: impl FnOnce() + Send) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(act);
    }

    #[test]
    fn every_item_is_met_once_on_any_number_of_threads() {
        let inputs: Vec<u32> = (0..10_000).collect();
        for threads in [1, 2, 3, 8] {
            on(threads, || {
                let (mut outputs, mut counts) = (Vec::new(), vec![0u32; 37]);
                let (mut help, mut own) = (Help::default(), 0);
                for _ in 0..20 {
                    map_into(&inputs, &mut outputs, 0, |&input| input * 2);
                    for_each(&mut counts, |index, count| *count += index as u32);
                    help.for_each(&mut counts, |index, count| *count += index as u32, || own += 1);
                }
                assert!(outputs.iter().zip(&inputs).all(|(&output, &input)| output == 2 * input));
                assert!(counts.iter().enumerate().all(|(index, &count)| count == 40 * index as u32));
                assert_eq!(own, 20);
                assert_eq!(within_pool(|| 1), 1);
                assert!(!alone(|| beside(|| ())));
            });
        }
    }

    #[test]
    fn nobody_waits_for_what_has_panicked() {
        let panics = |act: &(dyn Fn() + Sync)| catch_unwind(AssertUnwindSafe(act)).is_err();
        for threads in [1, 2] {
            on(threads, || {
                assert_eq!(beside(|| panic!("expected by the test")), threads > 1);
                assert!(panics(&|| within_pool(|| panic!("expected by the test"))));
                let fails = |index: usize, _: &mut u32| assert!(index != 20, "expected by the test");
                assert!(panics(&|| for_each(&mut [0; 40], fails)));
                assert!(panics(&|| Help::default().for_each(&mut [0; 40], fails, || ())));
                let leaves = || panic!("expected by the test");
                assert!(panics(&|| Help::default().for_each(&mut [0; 40], |_, _| (), leaves)));
            });
        }
    }
    #[test]
    fn parts_are_done_alone_after_a_late_one_until_that_is_forgotten() {
        let mut help = Help::default();
        let alone = |help: &mut Help| (0..).take_while(|_| !help.is_due()).count();
        assert_eq!(alone(&mut help), 0);
        // Twice as many each time, up to a limit.
        for pause in [64, 128, 256, 512] {
            help.learn(false);
            assert_eq!(alone(&mut help), pause);
        }
        (0..20).for_each(|_| help.learn(false));
        assert_eq!(alone(&mut help), 4096);
        // Forgotten after some hundred parts in time.
        (0..600).for_each(|_| help.learn(true));
        assert_eq!((alone(&mut help), help.pause), (0, 0));
        // With one late part in twenty, help is hardly ever asked for.
        for part in 0..400 {
            alone(&mut help);
            help.learn(part % 20 > 0);
        }
        assert!(help.pause > 2048, "{}", help.pause);
    }
}
