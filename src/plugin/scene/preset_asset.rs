//! Presets as assets, and their files.

use crate::synthesis::preset::{Preset, PresetError};
use bevy::{
    asset::{Asset, AssetLoader, LoadContext, ReflectAsset, io::Reader},
    reflect::{Reflect, TypePath},
};
use std::{io, str::Utf8Error};

/// A preset as an asset. Preset files end in `.vessels.ron`, and hold what [`Preset::from_ron`] reads.
///
/// To save the vessels of an organ as such a file, write `Preset::from(&vasculature).to_ron()`.
#[derive(Asset, Reflect, Clone, Debug, PartialEq)]
#[reflect(Asset, Clone, Debug, PartialEq)]
pub struct PresetAsset(pub Preset);

impl From<Preset> for PresetAsset {
    fn from(preset: Preset) -> Self {
        Self(preset)
    }
}

/// Reads presets from files that end in `.vessels.ron`.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct PresetLoader;

/// The reason why no preset could be loaded.
#[derive(Debug, thiserror::Error)]
pub enum PresetLoadError {
    /// It cannot be read.
    #[error("{path} cannot be read: {error}")]
    Read {
        /// The file.
        path: String,
        /// Why not.
        error: io::Error,
    },
    /// It is not text.
    #[error("{path} is not UTF-8 text: {error}")]
    Text {
        /// The file.
        path: String,
        /// Where the text ends.
        error: Utf8Error,
    },
    /// It is text, but not a preset.
    #[error("{path}: {error}")]
    Preset {
        /// The file.
        path: String,
        /// What is wrong, with line and column, or the value and its limits.
        error: PresetError,
    },
}

impl AssetLoader for PresetLoader {
    type Asset = PresetAsset;
    type Settings = ();
    type Error = PresetLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<PresetAsset, PresetLoadError> {
        let path = || context.path().to_string();
        let mut bytes = Vec::new();
        let read = reader.read_to_end(&mut bytes).await;
        read.map_err(|error| PresetLoadError::Read { path: path(), error })?;
        let text = str::from_utf8(&bytes).map_err(|error| PresetLoadError::Text { path: path(), error })?;
        let preset = Preset::from_ron(text).map_err(|error| PresetLoadError::Preset { path: path(), error })?;
        Ok(PresetAsset(preset))
    }

    fn extensions(&self) -> &[&str] {
        &["vessels.ron"]
    }
}
