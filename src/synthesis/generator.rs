//! All generators of vessels as one type, for presets, components and command lines.
//!
//! In: a tissue, roots and a seed. Out: a [`Growth`]. A new generator is a new variant here.

use crate::synthesis::{
    colonization::{Colonization, ColonizationError, ColonizationSettings},
    growth::{Growth, GrowthWarning},
    roots::{RootSpacing, Roots},
    tissue::{Extent, Tissue},
    tree::ByKind,
};
use std::{any::Any, fmt, sync::Arc};

/// The generator of an organ's vessels, with its settings.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum Generator {
    /// Space colonization: arteries and veins that grow towards drains (Rauch & Harders 2021).
    Colonization(ColonizationSettings),
    /// A custom generator. It can't be written to a file.
    #[cfg_attr(feature = "serialize", serde(skip))]
    Custom(CustomGenerator),
}

/// Why a generator cannot start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeneratorError {
    /// Space colonization cannot start.
    #[error(transparent)]
    Colonization(#[from] ColonizationError),
    /// A custom generator cannot start.
    #[error("{reason}")]
    Custom {
        /// Its error message.
        reason: String,
    },
}

impl Generator {
    /// Checks every setting against its limits, and returns warnings about unusual ones.
    ///
    /// # Errors
    /// The first setting outside its limits.
    pub fn validate(&self) -> Result<Vec<GrowthWarning>, GeneratorError> {
        match self {
            Self::Colonization(settings) => {
                let warnings = settings.validate().map_err(ColonizationError::from)?;
                Ok(warnings.iter().map(GrowthWarning::new).collect())
            }
            Self::Custom(_) => Ok(Vec::new()),
        }
    }

    /// Fits settings to a tissue of any size. They must be made for a tissue of equivalent diameter 1, as those of all
    /// presets are.
    #[must_use]
    pub fn fit(self, extent: Extent) -> Self {
        match self {
            Self::Colonization(settings) => Self::Colonization(settings.fit(extent)),
            Self::Custom(custom) => Self::Custom(custom.scaled(extent.equivalent_diameter())),
        }
    }

    /// Multiplies every length by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        match self {
            Self::Colonization(settings) => Self::Colonization(settings.scaled(factor)),
            Self::Custom(custom) => Self::Custom(custom.scaled(factor)),
        }
    }

    /// The spacing of roots for each kind of vessels that this generator grows.
    pub fn root_spacing(&self) -> ByKind<Option<RootSpacing>> {
        match self {
            Self::Colonization(settings) => settings.root_spacing(),
            Self::Custom(custom) => custom.maker.root_spacing(custom.scale),
        }
    }

    /// Starts a growth. Lengths in the settings are the tissue's: see [`fit`](Self::fit).
    ///
    /// # Errors
    /// A setting outside its limits, or roots that cannot be placed as requested.
    pub fn start(&self, tissue: Arc<dyn Tissue>, roots: &Roots, seed: u64) -> Result<Box<dyn Growth>, GeneratorError> {
        match self {
            Self::Colonization(settings) => Ok(Box::new(Colonization::new(tissue, settings.clone(), roots, seed)?)),
            Self::Custom(custom) => {
                let started = custom.maker.start(tissue, roots, custom.scale, seed);
                started.map_err(|reason| GeneratorError::Custom { reason })
            }
        }
    }

    /// Starts a growth in place of another one, and reuses its memory if both have the same generator and tissue.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn restart(
        &self,
        growth: Box<dyn Growth>,
        tissue: Arc<dyn Tissue>,
        roots: &Roots,
        seed: u64,
    ) -> Result<Box<dyn Growth>, GeneratorError> {
        let growth: Box<dyn Any> = growth;
        match (self, growth.downcast::<Colonization>()) {
            (Self::Colonization(settings), Ok(mut growth)) if Arc::ptr_eq(growth.tissue(), &tissue) => {
                growth.restart(settings.clone(), roots, seed)?;
                Ok(growth)
            }
            _ => self.start(tissue, roots, seed),
        }
    }

    /// The settings of space colonization, if this is it.
    pub fn colonization(&self) -> Option<&ColonizationSettings> {
        match self {
            Self::Colonization(settings) => Some(settings),
            Self::Custom(_) => None,
        }
    }

    /// The same, to be changed.
    pub fn colonization_mut(&mut self) -> Option<&mut ColonizationSettings> {
        match self {
            Self::Colonization(settings) => Some(settings),
            Self::Custom(_) => None,
        }
    }
}

impl Default for Generator {
    fn default() -> Self {
        Self::Colonization(ColonizationSettings::default())
    }
}

impl From<ColonizationSettings> for Generator {
    fn from(settings: ColonizationSettings) -> Self {
        Self::Colonization(settings)
    }
}

/// A generator of vessels outside this crate, for [`CustomGenerator`].
pub trait GrowthMaker: fmt::Debug + Send + Sync {
    /// The spacing of roots for each kind of vessels that it grows. All lengths must be multiplied by `scale`.
    fn root_spacing(&self, scale: f32) -> ByKind<Option<RootSpacing>>;

    /// Starts a growth, with all lengths multiplied by `scale`: 1, or the
    /// [equivalent diameter](Extent::equivalent_diameter) of the tissue if the generator is [fitted](Generator::fit) to
    /// it. [`Roots::resolve`] gives the places of roots.
    ///
    /// # Errors
    /// Why it cannot start, in words that name the value and the remedy.
    fn start(&self, tissue: Arc<dyn Tissue>, roots: &Roots, scale: f32, seed: u64) -> Result<Box<dyn Growth>, String>;
}

/// A custom generator of vessels. Two are equal if they share their maker and scale.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct CustomGenerator {
    maker: Arc<dyn GrowthMaker>,
    scale: f32,
}

impl CustomGenerator {
    /// A generator from a maker, with unscaled lengths.
    pub fn new(maker: impl GrowthMaker + 'static) -> Self {
        Self { maker: Arc::new(maker), scale: 1.0 }
    }

    fn scaled(self, factor: f32) -> Self {
        Self { scale: self.scale * factor, ..self }
    }
}

impl PartialEq for CustomGenerator {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.maker, &other.maker) && self.scale == other.scale
    }
}
