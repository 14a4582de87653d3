//! Trees to choose from.

use super::error::LSystemError;
use super::rewriting::Grammar;
use super::turtle::Turtle;
use bevy_vessels::synthesis::tree::VesselTree;

/// An L-system with a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// Its rules.
    pub grammar: Grammar,
    /// How its text is drawn.
    pub turtle: Turtle,
    /// Generations that look well.
    pub generations: u32,
}

impl Preset {
    /// The tree after some generations.
    ///
    /// # Errors
    /// [`LSystemError::TooLong`]; a preset itself is free of errors.
    pub fn tree(&self, generations: u32) -> Result<VesselTree, LSystemError> {
        self.turtle.draw(&self.grammar.expand(generations)?)
    }
}

/// All presets.
pub const PRESETS: [Preset; 3] = [STEM, BINARY, MONOPODIAL];

/// A stem as in Fig. 5 of Skjermo & Eidheim (2005), whose own L-system is not printed: the wider child goes on with the
/// smaller angle, and both children together have the cross-section of their parent (da Vinci's rule: 0.8² + 0.8⁴ = 1.05).
const STEM: Preset = Preset {
    name: "stem",
    grammar: Grammar { axiom: "FFA", rules: &[('A', r#"[&&&!!"FFA]/////////^!"FFA"#)] },
    turtle: Turtle { angle: 15.0, length: 1.0, length_ratio: 0.9, diameter: 0.6, diameter_ratio: 0.8 },
    generations: 5,
};

/// Equal daughters, under Murray's law with an exponent of 3: each 2^(−1/3) as wide, half an angle of 75° to the side.
const BINARY: Preset = Preset {
    name: "binary",
    grammar: Grammar { axiom: "FA", rules: &[('A', r#"[+!"//FA][-!"//FA]"#)] },
    turtle: Turtle { angle: 37.5, length: 1.0, length_ratio: 0.8, diameter: 0.3, diameter_ratio: 0.793_700_5 },
    generations: 6,
};

/// One straight trunk with side branches around it, which have twigs at both sides.
const MONOPODIAL: Preset = Preset {
    name: "monopodial",
    grammar: Grammar {
        axiom: "FA",
        rules: &[('A', r#"[&&&!!!!"FB]///////!"FA"#), ('B', r#"F[++!!!!""F][--!!!!""F]!"B"#)],
    },
    turtle: Turtle { angle: 20.0, length: 1.0, length_ratio: 0.9, diameter: 0.4, diameter_ratio: 0.88 },
    generations: 8,
};
