//! The scene's choice of a method: its name and the parameters that differ from their defaults.

use super::registry::find;
use crate::params::{self, Info, Param, Visitor};
use serde::de::{self, Deserialize, Deserializer, MapAccess};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// A method by name, with parameters; those left out have their defaults.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimulatorSettings {
    /// Name of the method.
    pub id: String,
    /// Its parameters by name.
    pub params: BTreeMap<String, Value>,
}

impl SimulatorSettings {
    /// A method with its default parameters.
    pub fn new(id: &str) -> Self {
        Self { id: id.to_owned(), params: BTreeMap::new() }
    }

    /// The same with one parameter set.
    #[must_use]
    pub fn with(mut self, name: &str, value: Value) -> Self {
        self.params.insert(name.to_owned(), value);
        self
    }

    /// # Errors
    /// One line: an unknown method, or a parameter that it refuses.
    pub fn check(&self) -> Result<(), String> {
        find(&self.id)?.check(&self.params)
    }
}

impl Default for SimulatorSettings {
    fn default() -> Self {
        Self::new("symplectic_euler")
    }
}

/// A parameter's value in a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// On or off.
    Switch(bool),
    /// A whole number.
    Count(u64),
    /// A real number.
    Number(f64),
    /// The name of a choice.
    Text(String),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Switch(on) => write!(f, "{on}"),
            Self::Count(n) => write!(f, "{n}"),
            Self::Number(x) => write!(f, "{x:?}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Switch(on) => to.serialize_bool(*on),
            Self::Count(n) => to.serialize_u64(*n),
            Self::Number(x) => to.serialize_f64(*x),
            Self::Text(text) => to.serialize_str(text),
        }
    }
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Any;
        impl de::Visitor<'_> for Any {
            type Value = Value;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, true or false, or a name in quotes")
            }
            fn visit_bool<E: de::Error>(self, on: bool) -> Result<Value, E> {
                Ok(Value::Switch(on))
            }
            fn visit_u64<E: de::Error>(self, n: u64) -> Result<Value, E> {
                Ok(Value::Count(n))
            }
            fn visit_i64<E: de::Error>(self, n: i64) -> Result<Value, E> {
                Ok(u64::try_from(n).map_or(Value::Number(n as f64), Value::Count))
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<Value, E> {
                Ok(Value::Number(x))
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Value, E> {
                Ok(Value::Text(text.to_owned()))
            }
        }
        from.deserialize_any(Any)
    }
}

/// Reads the map of parameters, each checked as it is read, so that an error points at its line.
struct ParamsSeed<'a>(&'a mut SimulatorSettings, bool);

impl<'de> de::DeserializeSeed<'de> for ParamsSeed<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_map(self)
    }
}

impl<'de> de::Visitor<'de> for ParamsSeed<'_> {
    type Value = ();
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map of parameters: {\"name\": value}")
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Self(settings, id_known) = self;
        settings.params.clear();
        while let Some((name, value)) = map.next_entry::<String, Value>()? {
            if settings.params.insert(name.clone(), value).is_some() {
                return Err(de::Error::custom(format!("{name} is given twice")));
            }
            if id_known {
                settings.check().map_err(de::Error::custom)?;
            }
        }
        Ok(())
    }
}

const FIELDS: &[&str] = &["id", "params"];

struct Fields<'a>(&'a mut SimulatorSettings);

impl<'de> de::Visitor<'de> for Fields<'_> {
    type Value = ();
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(id: \"…\", params: {…})")
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let (mut id_known, mut params_known) = (false, false);
        while let Some(params::Key(key)) = map.next_key()? {
            let twice = match key.as_str() {
                "id" => {
                    let id: String = map.next_value()?;
                    find(&id).map_err(de::Error::custom)?;
                    if id != self.0.id && !params_known {
                        self.0.params.clear();
                    }
                    self.0.id = id;
                    std::mem::replace(&mut id_known, true)
                }
                "params" => {
                    map.next_value_seed(ParamsSeed(self.0, id_known))?;
                    std::mem::replace(&mut params_known, true)
                }
                _ => return Err(de::Error::custom(params::unknown(&key, FIELDS))),
            };
            if twice {
                return Err(de::Error::custom(format!("{key} is given twice")));
            }
        }
        self.0.check().map_err(de::Error::custom)
    }
}

impl Param for SimulatorSettings {
    fn load<'de, D: Deserializer<'de>>(&mut self, _: &'static Info, from: D) -> Result<(), D::Error> {
        from.deserialize_struct("SimulatorSettings", FIELDS, Fields(self))
    }

    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        let (head, rest) = params::split_path(path);
        match (head, rest) {
            ("", _) => params::set_whole(self, info, text)
                .map_err(|e| format!("{e}; accepted: (id: \"verlet\"), with params: {{…}} if need be")),
            ("id", "") => {
                let id = text.trim().trim_matches('"');
                let entry = find(id)?;
                id.clone_into(&mut self.id);
                // What the new method does not know means nothing to it.
                self.params.retain(|name, _| entry.params.contains(&name.as_str()));
                self.check().or_else(|_| {
                    self.params.clear();
                    self.check()
                })
            }
            ("params", "") => {
                let mut fresh = self.clone();
                let mut from = params::ron_reader(text)?;
                de::DeserializeSeed::deserialize(ParamsSeed(&mut fresh, true), &mut from)
                    .map_err(|e| params::plain(&e.to_string()))?;
                *self = fresh;
                Ok(())
            }
            ("params", name) => {
                let mut fresh = self.clone();
                let value = params::ron_options()
                    .from_str(text)
                    .unwrap_or_else(|_| Value::Text(text.trim().trim_matches('"').to_owned()));
                fresh.params.insert(name.to_owned(), value);
                fresh.check()?;
                *self = fresh;
                Ok(())
            }
            _ => Err(params::unknown(head, FIELDS)),
        }
    }

    fn accept(&mut self, info: &'static Info, _: &Self, visitor: &mut dyn Visitor) {
        visitor.other(info);
    }
}
