//! Maps over many items, on all threads where that pays, with the same result on any number of them.

/// Fewest items worth handing to other threads.
#[cfg(feature = "parallel")]
const WORTH_SHARING: usize = 2048;

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

/// Does something on one of the threads that share work, where there are any: what is shared on the way is then handed from
/// one to the other, and nobody has to be woken for it each time.
pub(crate) fn among_threads<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if rayon::current_num_threads() > 1 {
        return rayon::scope(|_| act());
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
    #[cfg(feature = "parallel")]
    if inputs.len() >= WORTH_SHARING && rayon::current_num_threads() > 1 {
        use rayon::prelude::*;
        let share = inputs.len().div_ceil(4 * rayon::current_num_threads()).max(256);
        outputs.par_chunks_mut(share).zip(inputs.par_chunks(share)).for_each(|(outputs, inputs)| {
            for (output, input) in outputs.iter_mut().zip(inputs) {
                *output = map(input);
            }
        });
        return;
    }
    for (output, input) in outputs.iter_mut().zip(inputs) {
        *output = map(input);
    }
}

/// Lets `act` fill what belongs to each of the inputs, chunk by chunk.
pub(crate) fn zip_chunks<I: Sync, O: Send>(inputs: &[I], outputs: &mut [O], act: impl Fn(&[I], &mut [O]) + Sync) {
    #[cfg(feature = "parallel")]
    if inputs.len() >= WORTH_SHARING && rayon::current_num_threads() > 1 {
        use rayon::prelude::*;
        let share = inputs.len().div_ceil(4 * rayon::current_num_threads()).max(256);
        inputs.par_chunks(share).zip(outputs.par_chunks_mut(share)).for_each(|(inputs, outputs)| act(inputs, outputs));
        return;
    }
    act(inputs, outputs);
}
