//! Maps over many items, on all threads where that pays, with the same result on any number of them.

/// Fewest items worth handing to other threads.
#[cfg(feature = "parallel")]
const WORTH_SHARING: usize = 2048;

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
