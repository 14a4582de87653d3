//! `--set key=value`: one value of a preset, found by its path and given as RON.

use bevy_vessels::synthesis::preset::{Preset, PresetError};
use ron::value::RawValue;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::fmt;

/// Field in which a key is looked up if the preset itself does not have it, so that `steps=50` is enough.
const INNER: &str = "generator";

/// The preset with one value changed.
pub fn apply(preset: &Preset, change: &str) -> Result<Preset, String> {
    let (path, value) = change.split_once('=').ok_or("give it as key=value")?;
    // Parsed separately first, so that it cannot be more than one value.
    let value = RawValue::from_ron(value.trim()).map_err(|error| format!("not a RON value: {}", error.code))?;
    let text = preset.to_ron().map_err(|error| error.to_string())?;
    let mut keys: Vec<&str> = path.trim().split('.').collect();
    if !Fields::of(&text)?.names().any(|name| name == keys[0]) {
        keys.insert(0, INNER);
    }
    let (text, before) = replace(&text, &keys, value.get_ron(), None)?;
    Preset::from_ron(&text).map_err(|error| match error {
        // The parser's message and position refer to a text that the user never saw.
        PresetError::Syntax(_) => format!("it cannot have this value; now it is {}", shortened(&before)),
        other => other.to_string(),
    })
}

/// RON on one line, cut off if it is long.
fn shortened(text: &str) -> String {
    const SHOWN: usize = 60;
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let shown: String = line.chars().take(SHOWN).collect();
    if shown.len() < line.len() { shown + " …" } else { line }
}

/// RON of a struct, or of a variant that holds one, with the value at a path replaced, and the old value.
fn replace(text: &str, path: &[&str], value: &str, within: Option<&str>) -> Result<(String, String), String> {
    let [key, rest @ ..] = path else {
        return Ok((value.to_owned(), text.to_owned()));
    };
    let variant = Variant::of(text);
    let mut fields = Fields::of(variant.held).map_err(|_| format!("{} has no fields", within.unwrap_or("a preset")))?;
    let names: Vec<String> = fields.names().map(str::to_owned).collect();
    let Some((_, field)) = fields.0.iter_mut().find(|(name, _)| name == key) else {
        return Err(format!("no setting {key:?} in {}; there are {}", within.unwrap_or(INNER), names.join(", ")));
    };
    let (changed, before) = replace(field, rest, value, Some(key))?;
    *field = changed;
    let fields: Vec<String> = fields.0.into_iter().map(|(name, value)| format!("{name}: {value}")).collect();
    Ok((format!("{}({}){}", variant.before, fields.join(", "), variant.after), before))
}

/// RON of a struct, and the text around it if an enum variant holds it.
struct Variant<'a> {
    before: &'a str,
    held: &'a str,
    after: &'a str,
}

impl<'a> Variant<'a> {
    /// Looks into `Name((field: …))` and `Name(field: …)`. Any other text is the held value itself.
    fn of(text: &'a str) -> Self {
        let name = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(0);
        let (name, held) = text.split_at(name);
        let inner = held.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')).unwrap_or(held);
        match inner.trim() {
            inner if !name.is_empty() && inner.starts_with('(') && inner.ends_with(')') => {
                let start = text.len() - held.len() + 1;
                Self { before: &text[..start], held: inner, after: ")" }
            }
            _ => Self { before: name, held, after: "" },
        }
    }
}

/// Names and RON of any struct's fields.
struct Fields(Vec<(String, String)>);

impl Fields {
    fn of(text: &str) -> Result<Self, String> {
        ron::from_str(text).map_err(|error| error.to_string())
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(name, _)| name.as_str())
    }
}

impl<'de> Deserialize<'de> for Fields {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FieldsVisitor;

        impl<'de> Visitor<'de> for FieldsVisitor {
            type Value = Fields;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a struct")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Fields, A::Error> {
                let mut fields = Vec::new();
                while let Some((name, value)) = map.next_entry::<String, Box<RawValue>>()? {
                    fields.push((name, value.get_ron().trim().to_owned()));
                }
                Ok(Fields(fields))
            }
        }

        deserializer.deserialize_any(FieldsVisitor)
    }
}
