//! Rewriting: every letter with a rule becomes that rule's text, all at once, generation after generation.

use super::error::LSystemError;

/// The text to begin with, and what becomes of its symbols. Symbols without a rule stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grammar {
    /// Generation 0.
    pub axiom: &'static str,
    /// The successor of each symbol; of several rules for one symbol, the first counts.
    pub rules: &'static [(char, &'static str)],
}

impl Grammar {
    /// Symbols that a text may have.
    pub const MOST_SYMBOLS: usize = 1 << 20;

    /// The text of a generation.
    ///
    /// # Errors
    /// [`LSystemError::TooLong`] for a generation of more than [`Self::MOST_SYMBOLS`], before it takes its memory.
    pub fn expand(&self, generations: u32) -> Result<String, LSystemError> {
        let too_long = |generation| LSystemError::TooLong { generation, most: Self::MOST_SYMBOLS };
        let mut text = self.axiom.to_owned();
        for generation in 1..=generations {
            let symbols: usize =
                text.chars().map(|symbol| self.successor(symbol).map_or(1, |to| to.chars().count())).sum();
            if symbols > Self::MOST_SYMBOLS {
                return Err(too_long(generation));
            }
            let mut next = String::with_capacity(symbols);
            for symbol in text.chars() {
                match self.successor(symbol) {
                    Some(successor) => next.push_str(successor),
                    None => next.push(symbol),
                }
            }
            if next == text {
                break;
            }
            text = next;
        }
        Ok(text)
    }

    fn successor(&self, symbol: char) -> Option<&'static str> {
        self.rules.iter().find(|(from, _)| *from == symbol).map(|(_, to)| *to)
    }
}
