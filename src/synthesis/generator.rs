//! All generators of vessels as one type, for presets, components and command lines.
//!
//! In: a tissue, roots and a seed. Out: a [`Growth`]. A new generator is a new variant here.

use crate::synthesis::{
    cco::{Cco, CcoError, CcoSettings},
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
    /// Constrained constructive optimisation: trees of least volume of any kinds, in an area or a volume with a border
    /// (OpenCCO 2023).
    Cco(CcoSettings),
    /// A custom generator. It can't be written to a file: saving a preset or a scene that holds it is an error.
    #[cfg_attr(feature = "serialize", serde(skip))]
    Custom(CustomGenerator),
}

/// Why a generator cannot start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeneratorError {
    /// Space colonization cannot start.
    #[error(transparent)]
    Colonization(#[from] ColonizationError),
    /// Constrained constructive optimisation cannot start.
    #[error(transparent)]
    Cco(#[from] CcoError),
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
            Self::Cco(settings) => Ok(settings.validate().map_err(CcoError::from)?),
            Self::Custom(_) => Ok(Vec::new()),
        }
    }

    /// Fits settings to a tissue of any size. They must be made for a tissue of equivalent diameter 1, as those of all
    /// presets are.
    #[must_use]
    pub fn fit(self, extent: Extent) -> Self {
        match self {
            Self::Colonization(settings) => Self::Colonization(settings.fit(extent)),
            Self::Cco(settings) => Self::Cco(settings.fit(extent)),
            Self::Custom(custom) => Self::Custom(custom.scaled(extent.equivalent_diameter())),
        }
    }

    /// Multiplies every length by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        match self {
            Self::Colonization(settings) => Self::Colonization(settings.scaled(factor)),
            Self::Cco(settings) => Self::Cco(settings.scaled(factor)),
            Self::Custom(custom) => Self::Custom(custom.scaled(factor)),
        }
    }

    /// The spacing of roots in a tissue of this extent, for each kind of vessels that this generator grows.
    pub fn root_spacing(&self, extent: Extent) -> ByKind<Option<RootSpacing>> {
        match self {
            Self::Colonization(settings) => settings.root_spacing(),
            Self::Cco(settings) => settings.root_spacing(extent),
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
            Self::Cco(settings) => Ok(Box::new(Cco::new(tissue, settings.clone(), roots, seed)?)),
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
        match self {
            Self::Colonization(settings) => {
                if let Some(mut growth) = as_own::<Colonization>(growth, |own| Arc::ptr_eq(own.tissue(), &tissue)) {
                    growth.restart(settings.clone(), roots, seed)?;
                    return Ok(growth);
                }
            }
            Self::Cco(settings) => {
                if let Some(mut growth) = as_own::<Cco>(growth, |own| Arc::ptr_eq(own.tissue(), &tissue)) {
                    growth.restart(settings.clone(), roots, seed)?;
                    return Ok(growth);
                }
            }
            Self::Custom(_) => {}
        }
        self.start(tissue, roots, seed)
    }

    /// The settings of space colonization, if this is it.
    pub fn colonization(&self) -> Option<&ColonizationSettings> {
        match self {
            Self::Colonization(settings) => Some(settings),
            Self::Cco(_) | Self::Custom(_) => None,
        }
    }

    /// The same, to be changed.
    pub fn colonization_mut(&mut self) -> Option<&mut ColonizationSettings> {
        match self {
            Self::Colonization(settings) => Some(settings),
            Self::Cco(_) | Self::Custom(_) => None,
        }
    }

    /// The settings of constrained constructive optimisation, if this is it.
    pub fn cco(&self) -> Option<&CcoSettings> {
        match self {
            Self::Cco(settings) => Some(settings),
            Self::Colonization(_) | Self::Custom(_) => None,
        }
    }

    /// The same, to be changed.
    pub fn cco_mut(&mut self) -> Option<&mut CcoSettings> {
        match self {
            Self::Cco(settings) => Some(settings),
            Self::Colonization(_) | Self::Custom(_) => None,
        }
    }
}

/// A growth as its own type, if it is of that type and usable.
fn as_own<G: Growth>(growth: Box<dyn Growth>, is_usable: impl Fn(&G) -> bool) -> Option<Box<G>> {
    let growth: Box<dyn Any> = growth;
    growth.downcast::<G>().ok().filter(|growth| is_usable(growth))
}

impl Default for Generator {
    fn default() -> Self {
        Self::Colonization(ColonizationSettings::default())
    }
}

impl From<CcoSettings> for Generator {
    fn from(settings: CcoSettings) -> Self {
        Self::Cco(settings)
    }
}

impl From<ColonizationSettings> for Generator {
    fn from(settings: ColonizationSettings) -> Self {
        Self::Colonization(settings)
    }
}

/// A generator of vessels outside this crate, for [`CustomGenerator`], which has an example.
///
/// In a Bevy world, a panic in [`start`](Self::start) or in a step of its growth fails the organ that it is for, and
/// the app goes on, unless it is built to abort on panics. Elsewhere a panic reaches the caller.
pub trait GrowthMaker: fmt::Debug + Send + Sync {
    /// The spacing of roots for each kind of vessels that it grows. All lengths must be multiplied by `scale`.
    ///
    /// For any other kind, users must ask for [no roots](crate::synthesis::roots::RootPlacement::None); by default there
    /// are arteries and veins. Otherwise [`Roots::resolve`] fails.
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
///
/// Make it once, and clone it: another one from [`new`](Self::new) counts as a changed setting, and starts the growth
/// again.
///
/// ```
/// use bevy_vessels::synthesis::{
///     generator::{CustomGenerator, Generator, GrowthMaker},
///     growth::{GrownTree, Growth, StepCount, TreeUpdate},
///     roots::{RootPlacement, RootPlacements, RootSpacing, Roots},
///     tissue::{Disc, Tissue},
///     tree::{ByKind, NO_PARENT, VesselKind, VesselTree},
/// };
/// use std::sync::Arc;
///
/// /// Makes one straight artery, half the way from its root to the origin.
/// #[derive(Debug)]
/// struct Straight;
///
/// impl GrowthMaker for Straight {
///     fn root_spacing(&self, scale: f32) -> ByKind<Option<RootSpacing>> {
///         ByKind { artery: Some(RootSpacing { step: 0.1 * scale, reach: scale }), ..ByKind::default() }
///     }
///
///     fn start(
///         &self,
///         tissue: Arc<dyn Tissue>,
///         roots: &Roots,
///         scale: f32,
///         seed: u64,
///     ) -> Result<Box<dyn Growth>, String> {
///         let placed = roots.resolve(&*tissue, &self.root_spacing(scale), seed).map_err(|error| error.to_string())?;
///         let root = placed.artery.first().ok_or("there is no arterial root; place one")?.position;
///         let tree = VesselTree::from_arrays(vec![root, 0.5 * root], vec![NO_PARENT, 0], vec![0.01 * scale; 2]);
///         Ok(Box::new(Done(tree.map_err(|error| error.to_string())?)))
///     }
/// }
///
/// /// A growth that needs no steps.
/// #[derive(Debug)]
/// struct Done(VesselTree);
///
/// impl Growth for Done {
///     fn advance(&mut self) {}
///     fn settle(&mut self) {}
///     fn is_finished(&self) -> bool {
///         true
///     }
///     fn progress(&self) -> StepCount {
///         StepCount::default()
///     }
///     fn trees(&self) -> ByKind<Option<GrownTree<'_>>> {
///         ByKind { artery: Some(GrownTree::of(&self.0)), ..ByKind::default() }
///     }
///     fn update(&self, _: VesselKind) -> TreeUpdate<'_> {
///         TreeUpdate::Grown { changed: &[] }
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let generator = Generator::Custom(CustomGenerator::new(Straight));
/// let roots = RootPlacements { vein: RootPlacement::None, ..RootPlacements::default() };
/// let growth = generator.start(Arc::new(Disc::flat(0.5)?), &roots.into(), 7)?;
/// assert_eq!(growth.nodes(VesselKind::Artery), 2);
/// # Ok(())
/// # }
/// ```
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
