//! File forms of bleeding and blood. Reading checks every number against its limits.

use crate::synthesis::{
    haemodynamics::{Bleeding, BleedingEnd, BleedingSettings, BloodVolume, BloodVolumeSettings, FlowError},
    units::Volume,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

/// [`Bleeding`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Bleeding", deny_unknown_fields)]
struct SavedBleeding {
    settings: BleedingSettings,
    ends: Vec<BleedingEnd>,
    time: f64,
    lost: f64,
    rate: f64,
}

impl From<Bleeding> for SavedBleeding {
    fn from(bleeding: Bleeding) -> Self {
        let Bleeding { settings, ends, time, lost, rate, .. } = bleeding;
        Self { settings, ends, time, lost, rate }
    }
}

impl TryFrom<SavedBleeding> for Bleeding {
    type Error = FlowError;

    fn try_from(saved: SavedBleeding) -> Result<Self, FlowError> {
        let SavedBleeding { settings, ends, time, lost, rate } = saved;
        FlowError::check_finite("the time of the bleeding in s", time)?;
        FlowError::check_finite("the loss of the bleeding in m³", lost)?;
        FlowError::check_finite("the rate of the bleeding in m³/s", rate)?;
        for end in &ends {
            FlowError::check_finite("the age of an open end in s", end.age)?;
            FlowError::check_finite("the loss of an open end in mL", end.lost.ml())?;
        }
        let mut bleeding = Self::new(settings)?;
        (bleeding.ends, bleeding.time, bleeding.lost, bleeding.rate) = (ends, time, lost, rate);
        Ok(bleeding.resumed())
    }
}

impl Serialize for Bleeding {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SavedBleeding::from(self.clone()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Bleeding {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        SavedBleeding::deserialize(deserializer)?.try_into().map_err(D::Error::custom)
    }
}

/// [`BloodVolume`] in a file.
#[derive(Default, Serialize, Deserialize)]
#[serde(rename = "BloodVolume", default, deny_unknown_fields)]
struct SavedBlood {
    settings: BloodVolumeSettings,
    lost: Volume,
}

impl From<BloodVolume> for SavedBlood {
    fn from(blood: BloodVolume) -> Self {
        Self { settings: *blood.settings(), lost: blood.lost() }
    }
}

impl TryFrom<SavedBlood> for BloodVolume {
    type Error = FlowError;

    fn try_from(saved: SavedBlood) -> Result<Self, FlowError> {
        let mut blood = Self::new(saved.settings)?;
        FlowError::check_finite("the lost blood in mL", saved.lost.ml())?;
        blood.lose(saved.lost);
        Ok(blood)
    }
}

impl Serialize for BloodVolume {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SavedBlood::from(*self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for BloodVolume {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        SavedBlood::deserialize(deserializer)?.try_into().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::haemodynamics::{Bleeding, BloodVolume};

    #[test]
    fn blood_survives_a_file_and_nonsense_is_refused() {
        let mut blood = BloodVolume::new(Default::default()).expect("the defaults");
        blood.lose(crate::synthesis::units::Volume::from_ml(1234.5));
        let text = ron::to_string(&blood).expect("blood can be written");
        assert_eq!(ron::from_str::<BloodVolume>(&text), Ok(blood));
        for nonsense in ["(settings: (total: (-1.0)))", "(lost: (NaN))", "(litres: 5)"] {
            assert!(ron::from_str::<BloodVolume>(nonsense).is_err(), "{nonsense}");
        }
    }

    #[test]
    fn bleeding_is_read_with_settings_within_their_limits_only() {
        let text = ron::to_string(&Bleeding::default()).expect("bleeding can be written");
        assert!(ron::from_str::<Bleeding>(&text).is_ok(), "{text}");
        let never_ends = text.replace("longest_step:0.05", "longest_step:0.0");
        assert_ne!(text, never_ends);
        assert!(ron::from_str::<Bleeding>(&never_ends).is_err());
    }
}
