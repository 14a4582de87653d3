//! Work on many items, on all threads where that pays, with the same result on any number of them.

/// Fewest items worth handing to another thread, where each takes some tenths of a microsecond.
const WORTH_SHARING: usize = 256;

/// How many of so many items one thread takes at a time, at least `least`; `None` where they are not worth sharing.
#[cfg(feature = "parallel")]
fn share_of(items: usize, least: usize) -> Option<usize> {
    let threads = rayon::current_num_threads();
    (threads > 1 && items >= 2 * least).then(|| items.div_ceil(4 * threads).max(least))
}

/// Does the same to every item, which is also told its index. Each item is worth a thread of its own.
pub(crate) fn for_each<T: Send>(items: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    #[cfg(feature = "parallel")]
    if items.len() > 1 && rayon::current_num_threads() > 1 {
        use rayon::prelude::*;
        items.par_iter_mut().enumerate().for_each(|(index, item)| act(index, item));
        return;
    }
    items.iter_mut().enumerate().for_each(|(index, item)| act(index, item));
}

/// Does something that shares a little work now and then, while another thread stays awake to take its part at once. To wake
/// it each time takes as long as a step.
pub(crate) fn with_company<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if rayon::current_num_threads() > 1 {
        use std::sync::atomic::{AtomicBool, Ordering};
        let done = AtomicBool::new(false);
        let leading = || {
            let result = act();
            done.store(true, Ordering::Release);
            result
        };
        let standing_by = || {
            while !done.load(Ordering::Acquire) {
                if rayon::yield_now() != Some(rayon::Yield::Executed) {
                    std::hint::spin_loop();
                }
            }
        };
        return rayon::join(leading, standing_by).0;
    }
    act()
}

/// Does two things, at once where there are threads.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "parallel")]
    if rayon::current_num_threads() > 1 {
        return rayon::join(a, b);
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

/// Lets `act` fill what belongs to each of the inputs, chunk by chunk.
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
    if let Some(share) = share_of(inputs.len(), least) {
        use rayon::prelude::*;
        let shares = inputs.par_chunks(share).zip(outputs.par_chunks_mut(share)).enumerate();
        shares.for_each(|(number, (inputs, outputs))| act(number * share, inputs, outputs));
        return;
    }
    act(0, inputs, outputs);
}
