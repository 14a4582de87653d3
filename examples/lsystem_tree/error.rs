//! What is wrong with an L-system.

use bevy_vessels::synthesis::tree::TreeError;

/// Why there is no tree. Positions count the symbols of the rewritten text from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LSystemError {
    /// Rewriting makes a text without end.
    #[error("generation {generation} has more than {most} symbols; take fewer generations, or shorter rules")]
    TooLong {
        /// The first generation that is too long.
        generation: u32,
        /// Symbols that a text may have.
        most: usize,
    },
    /// A bracket that closes nothing.
    #[error("symbol {position} is a ']' without a '[' before it; remove it, or open it")]
    Unopened {
        /// Its position.
        position: usize,
    },
    /// A bracket that nothing closes.
    #[error("symbol {position} is a '[' that is never closed; add a ']'")]
    Unclosed {
        /// The position of the last such bracket.
        position: usize,
    },
    /// A character that is no command and no letter.
    #[error("symbol {position} is {symbol:?}; commands are F + - & ^ \\ / [ ] ! \", and letters do nothing")]
    Unknown {
        /// The character.
        symbol: char,
        /// Its position.
        position: usize,
    },
    /// The turtle's lengths or diameters vanish or have no end.
    #[error("the turtle draws no tree: {0}")]
    Tree(#[from] TreeError),
}
