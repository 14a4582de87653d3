//! Work on many items, on all threads where that pays, with the same result on any number of them.

/// Fewest items worth handing to another thread, where each takes some tenths of a microsecond.
const WORTH_SHARING: usize = 256;

#[cfg(feature = "parallel")]
mod threads {
    use rayon::Yield;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::sync::{Mutex, PoisonError};

    /// Shares of the work for each thread: as many as even out that some take longer than others.
    const SHARES: usize = 8;
    /// How often a thread looks whether the others are done before it goes to sleep: for some tenths of a millisecond. To be
    /// woken takes nearly as long.
    const PATIENCE: usize = 4096;

    /// How many of so many items a thread takes at a time; `None` where they are not worth sharing.
    pub fn share_of(items: usize, least: usize) -> Option<usize> {
        let threads = rayon::current_num_threads();
        (threads > 1 && items >= 2 * least).then(|| items.div_ceil(SHARES * threads).max(least.div_ceil(4)))
    }

    /// Does all of so many shares of work. Threads take them in turns.
    pub fn take_turns<S: Send>(count: usize, shares: impl Iterator<Item = S> + Send, act: impl Fn(S) + Sync) {
        let (shares, unfinished) = (Mutex::new(shares), AtomicUsize::new(count));
        // The lock is held for no longer than it takes to say which share is next.
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

    /// Does the same on several threads at once.
    fn on_threads(count: usize, work: &(impl Fn() + Sync)) {
        if count > 1 {
            rayon::join(work, || on_threads(count - 1, work));
        } else {
            work();
        }
    }

    /// Says that something is over: done, or ended by a panic. Nobody may wait for it for ever.
    #[derive(Default)]
    pub struct Over(AtomicBool);

    impl Over {
        /// Does something and says so afterwards.
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

        /// Stays awake until it is over, and does what other work there is meanwhile.
        pub fn stand_by(&self) {
            while !self.0.load(Ordering::Acquire) {
                if rayon::yield_now() != Some(Yield::Executed) {
                    std::hint::spin_loop();
                }
            }
        }
    }
}

/// Does the same to every item, which is also told its index. Each item is worth a thread of its own.
pub(crate) fn for_each<T: Send>(items: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    #[cfg(feature = "parallel")]
    if items.len() > 1 && rayon::current_num_threads() > 1 {
        threads::take_turns(items.len(), items.iter_mut().enumerate(), |(index, item)| act(index, item));
        return;
    }
    items.iter_mut().enumerate().for_each(|(index, item)| act(index, item));
}

/// Does something that shares a little work now and then, while another thread stays awake to take its part at once. To wake
/// it each time takes as long as a step.
pub(crate) fn with_company<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if rayon::current_num_threads() > 1 {
        let over = threads::Over::default();
        return rayon::join(|| over.after(act), || over.stand_by()).0;
    }
    act()
}

/// Does two things, at once where there are threads. Whoever is done first stays awake for the other's work.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "parallel")]
    if rayon::current_num_threads() > 1 {
        let over = threads::Over::default();
        let first = || {
            let result = a();
            over.stand_by();
            result
        };
        return rayon::join(first, || over.after(b));
    }
    (a(), b())
}

/// Fills `outputs` with `map` of each input, in order. `blank` only sizes the buffer.
pub(crate) fn map_into<I, O>(inputs: &[I], outputs: &mut Vec<O>, blank: O, map: impl Fn(&I) -> O + Sync)
where
    I: Sync,
    O: Clone + Send,
{
    outputs.clear();
    outputs.resize(inputs.len(), blank);
    map_all(inputs, outputs, WORTH_SHARING, |_, input| map(input));
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

/// Lets `act` fill what belongs to each of the inputs, some of them at a time.
pub(crate) fn zip_chunks<I: Sync, O: Send>(inputs: &[I], outputs: &mut [O], act: impl Fn(&[I], &mut [O]) + Sync) {
    zip_shares(inputs, outputs, WORTH_SHARING, |_, inputs, outputs| act(inputs, outputs));
}

/// As [`zip_chunks`]; `act` is also told the index of a chunk's first item.
#[cfg_attr(not(feature = "parallel"), expect(unused_variables, reason = "one thread has nobody to share with"))]
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
                assert_eq!(join(|| 1, || 2), (1, 2));
            });
        }
    }

    #[test]
    fn nobody_waits_for_what_has_panicked() {
        let panics = |act: &(dyn Fn() + Sync)| catch_unwind(AssertUnwindSafe(act)).is_err();
        for threads in [1, 2] {
            on(threads, || {
                assert!(panics(&|| with_company(|| panic!("expected by the test"))));
                assert!(panics(&|| _ = join(|| panic!("expected by the test"), || ())));
                assert!(panics(&|| _ = join(|| (), || panic!("expected by the test"))));
                let fails = |index: usize, _: &mut u32| assert!(index != 20, "expected by the test");
                assert!(panics(&|| for_each(&mut [0; 40], fails)));
            });
        }
    }
}
