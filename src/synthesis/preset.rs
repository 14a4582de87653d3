//! Named settings with their source: the paper's, its reference cases, its variations, and organs.
//!
//! A preset is a RON file; the built-in ones are in `assets/presets` and compiled in. Lengths are made for a tissue of
//! equivalent diameter 1 and are fitted to the organ (see [`Preset::generator_for`]). Settings that a file leaves out
//! have their defaults.

use crate::synthesis::generator::{Generator, GeneratorError};
use crate::synthesis::roots::{RootPlacements, Roots};
use crate::synthesis::tissue::{Extent, TissueSource};
use crate::synthesis::units::{Flow, Scale, ScaleError};
use std::fmt;
use std::str::FromStr;

/// Everything that defines a vasculature except the organ and the seed.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Preset {
    /// Version of the preset format. A file without it has the present version.
    ///
    /// Limits: at most [`Self::VERSION`]. Default: [`Self::VERSION`].
    pub version: u32,
    /// The source of the numbers.
    pub source: String,
    /// Whether lengths are made for a tissue of equivalent diameter 1, and fitted to the organ. Otherwise they are used
    /// as they are, in tissue lengths.
    ///
    /// Default: true.
    pub fit: bool,
    /// The source of the tissue: the surface or volume of an organ's mesh, or both in stages; a shape; an image.
    ///
    /// Default: the surface of the mesh.
    pub tissue: TissueSource,
    /// Where vessels begin.
    pub roots: RootPlacements,
    /// The generator of the vessels, with its settings.
    ///
    /// Default: space colonization with the paper's settings.
    pub generator: Generator,
    /// The blood of an organ of this kind. Default: unknown.
    pub blood: Option<OrganBlood>,
}

/// The blood that flows through an organ, as measured, and the size at which it does.
///
/// A tree ends in vessels that are far wider than capillaries, so its own resistance lets through many times this flow.
/// What is missing is the resistance of the vessels below its terminals: the bed. `fit_bed` of a
/// [network](crate::synthesis::haemodynamics::Network) or a
/// [circulation](crate::synthesis::haemodynamics::Circulation) finds it, as the one with which this flow passes at the
/// pressures of roots and bed. Nothing else is fitted: pressures in the tree and wall shear follow from its radii, which
/// the presets' sources explain.
///
/// The presets take flows from: Williams & Leggett, "Reference values for resting blood flow to organs of man" (Clinical
/// Physics and Physiological Measurement 10, 1989); Carlisle et al., "Estimation of total hepatic blood flow by duplex
/// ultrasound" (Gut 33, 1992); Koutsiaris et al., "Volume flow and wall shear stress quantification in the human
/// conjunctival capillaries and post-capillary venules in vivo" (Biorheology 44, 2007).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct OrganBlood {
    /// Flow into all arterial roots together.
    pub flow: Flow,
    /// Equivalent diameter of the organ's tissue, in metres: of a disc with the area of its surface, or a ball with its
    /// volume.
    pub diameter: f64,
}

impl OrganBlood {
    /// Flow into a tissue of another size: as much for each gram as in the organ. What a volume weighs goes with its
    /// cube, and a wall of the same thickness with its square.
    pub fn flow_into(&self, extent: Extent, scale: Scale) -> Flow {
        let share = scale.to_metres(extent.equivalent_diameter()) / self.diameter;
        let mass = match extent {
            Extent::Length(_) => share,
            Extent::Area(_) => share * share,
            Extent::Volume(_) | Extent::Sheet { .. } => share * share * share,
        };
        Flow::from_cubic_metres_per_second(self.flow.cubic_metres_per_second() * mass)
    }

    #[cfg(feature = "serialize")]
    fn validate(&self) -> Result<(), PresetError> {
        let flow = self.flow.cubic_metres_per_second();
        for (what, value) in [("flow in m³/s", flow), ("diameter in metres", self.diameter)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(PresetError::Blood { what, value });
            }
        }
        Ok(())
    }

    /// The scale at which a tissue has the size of the organ, in whatever unit its mesh is.
    ///
    /// # Errors
    /// A tissue without size, or a diameter that isn't above 0.
    pub fn scale(&self, extent: Extent) -> Result<Scale, ScaleError> {
        Scale::from_metres(self.diameter / f64::from(extent.equivalent_diameter()))
    }
}

impl Default for Preset {
    fn default() -> Self {
        Self {
            version: Self::VERSION,
            source: String::new(),
            fit: true,
            tissue: TissueSource::default(),
            roots: RootPlacements::default(),
            generator: Generator::default(),
            blood: None,
        }
    }
}

impl Preset {
    /// The present version of the format. It rises when old files would change their meaning.
    pub const VERSION: u32 = 1;

    /// The generator, with its lengths for a tissue of this extent.
    pub fn generator_for(&self, extent: Extent) -> Generator {
        if self.fit { self.generator.clone().fit(extent) } else { self.generator.clone() }
    }

    /// The roots of all kinds of vessels.
    pub fn roots(&self) -> Roots {
        self.roots.clone().into()
    }

    /// Reads a preset from a file's text.
    ///
    /// # Errors
    /// Text that is not a preset, with line and column; a file of a newer version than this crate knows; a setting
    /// outside its limits.
    #[cfg(feature = "serialize")]
    pub fn from_ron(text: &str) -> Result<Self, PresetError> {
        // Read first, since a newer version may hold what the present one rejects.
        let Form { version } = ron_options().from_str(text).map_err(Box::new)?;
        if version > Self::VERSION {
            return Err(PresetError::Newer { version });
        }
        let preset: Self = ron_options().from_str(text).map_err(Box::new)?;
        preset.generator.validate()?;
        preset.blood.map_or(Ok(()), |blood| blood.validate())?;
        Ok(preset)
    }

    /// Writes the preset as a file that [`from_ron`](Self::from_ron) reads.
    ///
    /// # Errors
    /// Only if a number cannot be written, which does not happen for settings that validate.
    #[cfg(feature = "serialize")]
    pub fn to_ron(&self) -> Result<String, PresetError> {
        let pretty = ron::ser::PrettyConfig::default();
        ron_options().to_string_pretty(self, pretty).map_err(|error| PresetError::Write(error.to_string()))
    }
}

/// The part of a preset that is read first.
#[cfg(feature = "serialize")]
#[derive(serde::Deserialize)]
#[serde(rename = "Preset", default)]
struct Form {
    version: u32,
}

#[cfg(feature = "serialize")]
impl Default for Form {
    fn default() -> Self {
        Self { version: Preset::VERSION }
    }
}

/// Optional values are written without `Some`.
#[cfg(feature = "serialize")]
fn ron_options() -> ron::Options {
    ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME)
}

/// Why a preset could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PresetError {
    /// No built-in preset has this name.
    #[error("there is no preset {0:?}; there are {names}", names = PresetName::ALL.map(PresetName::name).join(", "))]
    UnknownName(String),
    /// A file of a version that this crate doesn't know.
    #[error(
        "the preset has version {version}, but this version of {} reads versions up to {}; update it, or save the preset \
         from the older program",
        env!("CARGO_PKG_NAME"),
        Preset::VERSION
    )]
    Newer {
        /// The version found.
        version: u32,
    },
    /// A setting outside its limits.
    #[error(transparent)]
    Generator(#[from] GeneratorError),
    /// Blood that no organ has.
    #[error("the blood's {what} is {value}; it must be a finite number above 0")]
    Blood {
        /// Which number of the blood.
        what: &'static str,
        /// The value found.
        value: f64,
    },
    /// Text that is not a preset.
    #[cfg(feature = "serialize")]
    #[error("not a preset: {0}")]
    Syntax(#[from] Box<ron::error::SpannedError>),
    /// A preset that cannot be written.
    #[error("the preset cannot be written: {0}")]
    Write(String),
}

/// The enum of the built-in presets, each with the name of its file.
macro_rules! presets {
    ($($(#[$doc:meta])* $preset:ident = $name:literal,)+) => {
        /// The built-in presets.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
        pub enum PresetName {
            $($(#[$doc])* $preset,)+
        }

        impl PresetName {
            /// All built-in presets.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$preset),+];
            /// Number of built-in presets.
            pub const COUNT: usize = [$($name),+].len();

            /// The name in files and on command lines, such as `reference-disc`.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$preset => $name,)+
                }
            }

            /// The file's text.
            #[cfg(feature = "serialize")]
            pub fn ron(self) -> &'static str {
                match self {
                    $(Self::$preset => include_str!(concat!("../../assets/presets/", $name, ".ron")),)+
                }
            }
        }
    };
}

presets! {
    /// The paper's defaults, with venous settings that never stall.
    #[default]
    Paper = "paper",
    /// The paper's own program on its disc, defects included, as the reference figures were measured.
    ReferenceDisc = "reference-disc",
    /// The same program in a ball.
    ReferenceBall = "reference-ball",
    /// The paper's Fig. 5 with a larger exponent: wider angles, less difference in radius.
    WideAngles = "wide-angles",
    /// The paper's Fig. 5 with a larger direction weight: straighter vessels.
    Straight = "straight",
    /// The paper's Fig. 5 with a smaller bifurcation threshold: more symmetric bifurcations.
    Symmetric = "symmetric",
    /// The paper's Fig. 5 with a larger bifurcation threshold: more lateral branches.
    Lateral = "lateral",
    /// The wall of the large intestine.
    Colon = "colon",
    /// The liver, through its volume.
    Liver = "liver",
    /// The kidney, through its volume.
    Kidney = "kidney",
    /// The white of the eye.
    Conjunctiva = "conjunctiva",
    /// The back of the eye.
    Retina = "retina",
    /// OpenCCO's disc: arteries of least volume.
    CcoDisc = "cco-disc",
    /// OpenCCO's ball.
    CcoBall = "cco-ball",
    /// The liver with four trees of least volume that avoid each other.
    CcoLiver = "cco-liver",
}

#[cfg(feature = "serialize")]
impl PresetName {
    /// The preset.
    #[expect(clippy::expect_used, reason = "the text is compiled in, and a test loads every one")]
    pub fn load(self) -> Preset {
        Preset::from_ron(self.ron()).expect("built-in presets are valid")
    }
}

impl fmt::Display for PresetName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for PresetName {
    type Err = PresetError;

    fn from_str(name: &str) -> Result<Self, PresetError> {
        Self::ALL
            .into_iter()
            .find(|preset| preset.name() == name)
            .ok_or_else(|| PresetError::UnknownName(name.to_owned()))
    }
}

#[cfg(all(test, feature = "serialize"))]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_preset_loads_names_its_source_and_survives_a_round_trip() {
        for name in PresetName::ALL {
            let preset = Preset::from_ron(name.ron()).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(preset.source.len() > 20, "{name} names no source");
            assert_eq!(name.name().parse::<PresetName>().ok(), Some(name));
            let text = preset.to_ron().expect("a valid preset can be written");
            assert_eq!(Preset::from_ron(&text).ok(), Some(preset));
        }
    }

    #[test]
    fn the_papers_preset_is_the_default() {
        let paper = PresetName::Paper.load();
        assert_eq!(paper.generator, Generator::default());
        assert_eq!(Preset { source: paper.source.clone(), ..Preset::default() }, paper);
        assert!(paper.generator.validate().is_ok_and(|warnings| warnings.is_empty()));
    }

    #[test]
    fn a_newer_form_is_refused_whatever_it_holds() {
        let newer = Preset::from_ron("(version: 9, warp: Fast(3), generator: Sorcery((mana: [1, 2])))");
        let text = newer.map_err(|error| error.to_string()).expect_err("a newer form");
        assert!(text.contains("version 9") && text.contains("up to 1"), "{text}");
        assert_eq!(Preset::from_ron("()").ok(), Some(Preset::default()));
        assert_eq!(Preset::from_ron("(version: 1)").ok(), Some(Preset::default()));
    }

    #[test]
    fn bad_files_are_refused_by_name() {
        assert!("colonn".parse::<PresetName>().is_err_and(|error| error.to_string().contains("colon,")));
        let unknown = Preset::from_ron("(generator: Colonization((stepz: 3)))").map_err(|error| error.to_string());
        assert!(unknown.is_err_and(|text| text.contains("stepz")));
        let outside = Preset::from_ron("(generator: Colonization((arterial: (direction_weight: 7.0))))")
            .map_err(|e| e.to_string());
        assert!(outside.is_err_and(|text| text.contains("direction_weight is 7")));
        let beyond = "(generator: Colonization((arterial: (terminal_radius: 1e38))))";
        assert!(Preset::from_ron(beyond).is_err_and(|error| error.to_string().contains("terminal_radius is 1")));
        for (blood, name) in [("flow: (-1.0), diameter: 0.1", "flow"), ("flow: (1e-6), diameter: 0", "diameter")] {
            let refused = Preset::from_ron(&format!("(blood: ({blood}))"));
            assert!(refused.is_err_and(|error| error.to_string().contains(name)), "{blood}");
        }
        for garbage in ["", "(", "\u{0}\u{1}", "[1, 2]", "(generator: Colonization((steps: -1)))"] {
            assert!(Preset::from_ron(garbage).is_err(), "{garbage:?}");
        }
    }
}
