//! Figures of all organs of a batch together.

use super::Failure;
use super::organ::Outcome;
use bevy_vessels::synthesis::{io::write_atomically, tree::VesselKind};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// Figures that people see; files have all of them.
const SHOWN: [&str; 5] = ["nodes", "leaves", "total_length", "root_radius", "coverage"];

/// Figures of the organs reported so far.
#[derive(Debug, Default, Serialize)]
pub struct Summary {
    /// Organs, whether grown now or before.
    organs: u64,
    /// Organs whose files were there.
    pub resumed: u64,
    /// Wall time of all of it.
    pub seconds: f64,
    /// Every number of the organs' lines, by its path: `arterial.nodes`, `arterial.strahler.1.streams`.
    figures: BTreeMap<String, Moments>,
}

impl Summary {
    /// Adds an organ.
    pub fn add(&mut self, Outcome { line, was_there, .. }: &Outcome) {
        self.organs += 1;
        self.resumed += u64::from(*was_there);
        // Fails only on maps with keys that are not strings, and there are none.
        let Ok(Value::Object(mut fields)) = serde_json::to_value(line) else { return };
        fields.remove("seed");
        self.add_value("", &Value::Object(fields));
    }

    fn add_value(&mut self, path: &str, value: &Value) {
        let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
        match value {
            Value::Object(fields) => fields.iter().for_each(|(key, value)| self.add_value(&below(key), value)),
            Value::Array(list) => {
                (1..)
                    .zip(list)
                    .for_each(|(number, value): (u32, _)| self.add_value(&below(&number.to_string()), value));
            }
            Value::Number(number) => {
                if let Some(number) = number.as_f64() {
                    self.figures.entry(path.to_owned()).or_default().add(number);
                }
            }
            _ => {}
        }
    }

    /// Writes all figures as JSON.
    pub fn save(&self, path: &Path) -> Result<(), Failure> {
        write_atomically(path, |out| {
            serde_json::to_writer_pretty(&mut *out, self)?;
            writeln!(out)
        })
        .map_err(Failure::run)
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { organs, resumed, seconds, .. } = self;
        writeln!(f, "{organs} organs, {resumed} of them there before, in {seconds:.1} s: mean ± standard deviation")?;
        for kind in VesselKind::ALL {
            for figure in SHOWN {
                if let Some(moments) = self.figures.get(&format!("{}.{figure}", kind.name())) {
                    let (mean, deviation) = (rounded(moments.mean), rounded(moments.standard_deviation()));
                    let (least, most) = (rounded(moments.minimum), rounded(moments.maximum));
                    writeln!(f, "  {} {figure}: {mean} ± {deviation}, from {least} to {most}", kind.name())?;
                }
            }
        }
        Ok(())
    }
}

/// A number with four digits that count, as many decimal places as that takes.
fn rounded(value: f64) -> String {
    let before_point = value.abs().log10().floor();
    let decimals = if before_point.is_finite() { (3.0 - before_point).clamp(0.0, 12.0) as usize } else { 0 };
    format!("{value:.decimals$}")
}

/// The distribution of a figure, without its values (Welford 1962).
#[derive(Debug, Default)]
struct Moments {
    count: u64,
    mean: f64,
    /// Sum of squared deviations from the mean.
    squares: f64,
    minimum: f64,
    maximum: f64,
}

impl Moments {
    fn add(&mut self, value: f64) {
        let is_first = self.count == 0;
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
        self.minimum = if is_first { value } else { self.minimum.min(value) };
        self.maximum = if is_first { value } else { self.maximum.max(value) };
    }

    /// The root of the mean squared deviation, as in the statistics of a tree.
    fn standard_deviation(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }
}

impl Serialize for Moments {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Shown {
            count: u64,
            mean: f64,
            standard_deviation: f64,
            minimum: f64,
            maximum: f64,
        }
        let &Self { count, mean, minimum, maximum, .. } = self;
        Shown { count, mean, standard_deviation: self.standard_deviation(), minimum, maximum }.serialize(serializer)
    }
}
