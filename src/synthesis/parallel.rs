//! Work on many items, on all threads if that pays, with the same result on any number of threads.

/// Fewest items worth handing to another thread that is awake, if each takes some tenths of a microsecond.
const WORTH_SHARING: usize = 256;
/// Fewest items worth waking another thread for.
const WORTH_WAKING: usize = 2048;

#[cfg(feature = "parallel")]
mod threads {
    use rayon::Yield;
    use std::cell::Cell;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::sync::{Mutex, PoisonError};

    /// Shares of the work for each thread: enough to balance shares that take longer than others.
    const SHARES: usize = 8;
    /// Number of times that a thread checks whether the others are done before it sleeps: some tenths of a millisecond.
    /// Waking takes nearly as long.
    const PATIENCE: usize = 4096;

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

    /// Does `count` shares of work. Threads take the next share in turn.
    pub fn take_turns<S: Send>(count: usize, shares: impl Iterator<Item = S> + Send, act: impl Fn(S) + Sync) {
        let (shares, unfinished) = (Mutex::new(shares), AtomicUsize::new(count));
        // The lock is held only while the next share is taken.
        let next = || shares.lock().unwrap_or_else(PoisonError::into_inner).next();
        let work = || {
            while let Some(share) = next() {
                act(share);
                unfinished.fetch_sub(1, Ordering::Release);
            }
        };
        let lead = || {
            work();
            let mut tries = 0;
            while unfinished.load(Ordering::Acquire) > 0 && tries < PATIENCE {
                tries += 1;
                std::hint::spin_loop();
            }
        };
        rayon::join(lead, || on_threads(count.min(rayon::current_num_threads()) - 1, &work));
    }

    /// Does the same work on several threads at once.
    fn on_threads(count: usize, work: &(impl Fn() + Sync)) {
        if count > 1 {
            rayon::join(work, || on_threads(count - 1, work));
        } else {
            work();
        }
    }

    /// A flag for the end of some work, also when it ends by a panic, so that no thread waits forever.
    #[derive(Default)]
    pub struct Over(AtomicBool);

    impl Over {
        /// Does some work and sets the flag afterwards.
        pub fn after<R>(&self, act: impl FnOnce() -> R) -> R {
            struct Says<'a>(&'a AtomicBool);
            impl Drop for Says<'_> {
                fn drop(&mut self) {
                    self.0.store(true, Ordering::Release);
                }
            }
            let _says = Says(&self.0);
            act()
        }

        /// Stays awake until the flag is set, and does other work meanwhile.
        pub fn stand_by(&self) {
            while !self.0.load(Ordering::Acquire) {
                if rayon::yield_now() != Some(Yield::Executed) {
                    std::hint::spin_loop();
                }
            }
        }
    }
}

/// Calls `act` for every item and its index. Each item is worth a thread of its own.
pub(crate) fn for_each<T: Send>(items: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    #[cfg(feature = "parallel")]
    if items.len() > 1 && threads::count() > 1 {
        threads::take_turns(items.len(), items.iter_mut().enumerate(), |(index, item)| act(index, item));
        return;
    }
    items.iter_mut().enumerate().for_each(|(index, item)| act(index, item));
}

/// Does work that shares small parts now and then, while another thread stays awake to take them at once. Waking it
/// each time would take as long as a step.
pub(crate) fn with_company<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if threads::count() > 1 {
        let over = threads::Over::default();
        return rayon::join(|| over.after(act), || over.stand_by()).0;
    }
    act()
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

/// Does work that shares nothing, such as while it holds a lock: a thread that waits for others may take up any other work,
/// and that may wait for the same lock.
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
        threads::take_turns(shares.len(), shares, |(number, (inputs, outputs))| act(number * share, inputs, outputs));
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
                with_company(|| {
                    for _ in 0..20 {
                        map_into(&inputs, &mut outputs, 0, |&input| input * 2);
                        for_each(&mut counts, |index, count| *count += index as u32);
                    }
                });
                assert!(outputs.iter().zip(&inputs).all(|(&output, &input)| output == 2 * input));
                assert!(counts.iter().enumerate().all(|(index, &count)| count == 20 * index as u32));
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
                assert!(panics(&|| with_company(|| panic!("expected by the test"))));
                assert!(panics(&|| within_pool(|| panic!("expected by the test"))));
                let fails = |index: usize, _: &mut u32| assert!(index != 20, "expected by the test");
                assert!(panics(&|| for_each(&mut [0; 40], fails)));
            });
        }
    }
}
