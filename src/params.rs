//! Parameters: one declaration gives the field, its default, accepted range, unit and text; files, panels and the
//! command line all read that declaration.
//!
//! ```
//! tenter::params! {
//!     /// A fan.
//!     pub struct Fan {
//!         /// Whether it turns.
//!         enabled: bool = true;
//!         /// Turns per second.
//!         frequency: f64 = 0.5, unit "Hz", range 0.0..=100.0, slider linear 0.0..=5.0;
//!     }
//! }
//! use tenter::params::Params;
//! let mut fan = Fan::default();
//! fan.set("frequency", "2.5").unwrap();
//! assert_eq!(fan.frequency, 2.5);
//! assert!(fan.set("frequency", "-1").unwrap_err().contains("0 to 100 Hz"));
//! ```

mod choice;

pub use choice::{Choice, ChoiceVisitor, choose};

use glam::DVec3;
use serde::de::{self, DeserializeSeed, Deserializer, MapAccess};
use std::fmt;
use std::ops::RangeInclusive;

/// What is declared about one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Info {
    /// Name of the field, as in files and on the command line.
    pub name: &'static str,
    /// Its documentation, equation included.
    pub doc: &'static str,
    /// SI unit, empty where there is none.
    pub unit: &'static str,
    /// Values that are accepted; everything finite where there is none.
    pub range: Option<RangeInclusive<f64>>,
    /// The part of the range that a slider offers, and how.
    pub slider: Option<(Scale, RangeInclusive<f64>)>,
    /// Values worth comparing where a method spends more work by it on the same step; empty for all other parameters.
    pub effort: &'static [f64],
    /// The choice beside it, and the name chosen there, without which it does nothing.
    pub when: Option<(&'static str, &'static str)>,
}

/// How a slider divides its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps.
    Linear,
    /// Equal ratios.
    Log,
}

impl Info {
    /// The name as a label: underscores become spaces, the first letter a capital.
    pub fn label(&self) -> String {
        let mut label = self.name.replace('_', " ");
        if let Some(first) = label.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        label
    }

    /// What is accepted, in words: `0 to 1e12 N/m`.
    pub fn accepted(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        match &self.range {
            Some(range) => format!("{} to {}{unit}", Short(*range.start()), Short(*range.end())),
            None => format!("any finite number{unit}"),
        }
    }

    /// A value of the wrong type.
    fn wrong<E: de::Error>(&self, error: &E) -> E {
        E::custom(format!("{}: {}; accepted: {}", self.name, plain(&error.to_string()), self.accepted()))
    }

    /// A text that is no value of this type.
    fn unreadable(&self, error: &str) -> String {
        format!("{error}; accepted: {}", self.accepted())
    }

    fn check(&self, value: f64) -> Result<(), String> {
        let inside = self.range.as_ref().is_none_or(|range| range.contains(&value));
        if value.is_finite() && inside {
            Ok(())
        } else {
            Err(format!("{} is {}; accepted: {}", self.name, Short(value), self.accepted()))
        }
    }
}

/// A number as people write it: plain in the middle of the scale, with an exponent at its ends.
pub struct Short(
    /// The number.
    pub f64,
);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if self.0 == 0.0 || !self.0.is_finite() || (1e-3..1e6).contains(&size) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

/// Sees every parameter of a set in the order of declaration, and may change it. Panels, listings and documentation
/// are visitors. The second value is the default.
pub trait Visitor {
    /// A real number.
    fn number(&mut self, info: &'static Info, value: &mut f64, default: f64);
    /// A whole number.
    fn count(&mut self, info: &'static Info, value: &mut u32, default: u32);
    /// On or off.
    fn switch(&mut self, info: &'static Info, value: &mut bool, default: bool);
    /// One of several names, by index.
    fn choice(
        &mut self,
        info: &'static Info,
        names: &'static [&'static str],
        value: &mut usize,
        default: usize,
    );
    /// A vector.
    fn vector(&mut self, info: &'static Info, value: &mut DVec3, default: DVec3);
    /// A nested set: call `inside` to see it.
    fn group(&mut self, info: &'static Info, inside: &mut dyn FnMut(&mut dyn Visitor));
    /// Something that has no general form (a target, a list of pins).
    fn other(&mut self, _info: &'static Info) {}
}

/// A value that can be declared with [`params!`](crate::params!).
pub trait Param: Sized {
    /// Reads it in place: what the file leaves out keeps its value.
    ///
    /// # Errors
    /// A wrong type, an unknown field, or a value outside the declared range.
    fn load<'de, D: Deserializer<'de>>(&mut self, info: &'static Info, from: D) -> Result<(), D::Error>;

    /// Sets what `path` names (empty: all of it) from RON text.
    ///
    /// # Errors
    /// One line: an unknown path, text that does not parse, or a value outside the declared range.
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String>;

    /// Shows it to a visitor.
    fn accept(&mut self, info: &'static Info, default: &Self, visitor: &mut dyn Visitor);
}

/// A set of parameters, declared with [`params!`](crate::params!).
pub trait Params: Default + Clone {
    /// Name of the type.
    const NAME: &'static str;
    /// Names of the fields.
    const FIELDS: &'static [&'static str];

    /// Reads the value of field `key` in place; an unknown key is an error.
    ///
    /// # Errors
    /// A wrong type, an unknown field, or a value outside the declared range.
    fn load_field<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error>;

    /// Sets the parameter named by a dotted path from RON text.
    ///
    /// # Errors
    /// One line: an unknown path, text that does not parse, or a value outside the declared range.
    fn set(&mut self, path: &str, text: &str) -> Result<(), String>;

    /// Shows every parameter to a visitor, with the defaults given.
    fn visit_with(&mut self, defaults: &Self, visitor: &mut dyn Visitor);

    /// Shows every parameter to a visitor.
    fn visit(&mut self, visitor: &mut dyn Visitor) {
        self.visit_with(&Self::default(), visitor);
    }
}

/// Splits `a.b.c` into `a` and `b.c`.
pub fn split_path(path: &str) -> (&str, &str) {
    path.split_once('.').unwrap_or((path, ""))
}

/// Says that a path leads nowhere, and where it could lead.
pub fn unknown(name: &str, fields: &[&str]) -> String {
    let name = excerpt(name);
    if fields.is_empty() {
        format!("unknown key '{name}'; there are none here")
    } else {
        format!("unknown key '{name}'; known: {}", fields.join(", "))
    }
}

/// Reads one RON value; `what` names it in the error.
///
/// # Errors
/// One line: the text and what is wrong with it.
pub fn parse<'a, T: de::Deserialize<'a>>(what: &str, text: &'a str) -> Result<T, String> {
    ron_options()
        .from_str(text)
        .map_err(|e| format!("{what} cannot be '{}': {}", excerpt(text), plain(&e.code.to_string())))
}

/// How RON is read everywhere: plain, so that a saved file needs no header.
pub fn ron_options() -> ron::Options {
    ron::Options::default()
}

/// A reader of RON text.
///
/// # Errors
/// One line: what is wrong with the text.
pub fn ron_reader(text: &str) -> Result<ron::Deserializer<'_>, String> {
    ron::Deserializer::from_str_with_options(text, &ron_options()).map_err(|e| one_line(&e.to_string()))
}

/// What a reader of RON complains of, on one line, in words for users: without the names that types have in the program.
pub fn plain(complaint: &str) -> String {
    let line = one_line(complaint);
    let between = |before: &str, after: &str| {
        let (_, rest) = line.split_once(before)?;
        Some(rest.split_once(after)?.0.to_owned())
    };
    match line.as_str() {
        "Expected float" | "Expected integer" => "a number is missing".to_owned(),
        "Expected boolean" => "it is neither true nor false".to_owned(),
        "Expected string" => "a text in quotes is missing".to_owned(),
        "Expected identifier" => "a name is missing".to_owned(),
        "Non-whitespace trailing characters" => "more follows than one value".to_owned(),
        text if text.starts_with("Expected opening `(`") => "an opening `(` is missing".to_owned(),
        text if text.starts_with("Expected opening `[`") => "an opening `[` is missing".to_owned(),
        text if text.starts_with("Found invalid std identifier") => "a name is missing".to_owned(),
        text if text.starts_with("Invalid digit") => "it is no whole number".to_owned(),
        text if text.starts_with("Expected struct") => {
            let found = between("but found `", "`").unwrap_or_default();
            format!("`{found}` stands where an opening `(` is missing")
        }
        text if text.starts_with("Unexpected missing field named") => {
            let name = between("named `", "`").unwrap_or_default();
            format!("`{name}` is missing")
        }
        text if text.starts_with("Unexpected variant named") => {
            let name = between("named `", "`").unwrap_or_default();
            let known = between("expected one of ", " instead").unwrap_or_default();
            format!("unknown `{name}`; known: {}", known.replace(", or ", ", "))
        }
        _ => line,
    }
}

/// Sets a whole parameter from RON text, or leaves it as it was.
///
/// # Errors
/// One line: what is wrong with the text.
pub fn set_whole<P: Param + Clone>(param: &mut P, info: &'static Info, text: &str) -> Result<(), String> {
    let mut fresh = param.clone();
    let mut from = ron_reader(text)?;
    fresh.load(info, &mut from).and_then(|()| from.end()).map_err(|e| plain(&e.to_string()))?;
    *param = fresh;
    Ok(())
}

/// The start of a text, on one line.
pub fn excerpt(text: &str) -> String {
    let line = one_line(text);
    if line.chars().count() > 60 { format!("{}…", line.chars().take(60).collect::<String>()) } else { line }
}

/// A message on one line, with its middle cut out where it would fill a screen: parsers quote what they were given, which may be a
/// megabyte, between what they expected (at the start) and where it stood (at the end).
pub fn brief(text: &str) -> String {
    /// Characters kept at either end.
    const KEPT: usize = 200;
    let line = one_line(text);
    let Some((head, _)) = line.char_indices().nth(KEPT) else { return line };
    match line.char_indices().nth_back(KEPT - 1) {
        Some((tail, _)) if tail > head => format!("{}…{}", &line[..head], &line[tail..]),
        _ => line,
    }
}

/// The text without line breaks and other control characters.
pub fn one_line(text: &str) -> String {
    text.split(|c: char| c.is_control()).filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

impl Param for f64 {
    fn load<'de, D: Deserializer<'de>>(&mut self, info: &'static Info, from: D) -> Result<(), D::Error> {
        let value = <f64 as de::Deserialize>::deserialize(from).map_err(|e| info.wrong(&e))?;
        info.check(value).map_err(de::Error::custom)?;
        *self = value;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        leaf(info, path)?;
        let value = parse(info.name, text).map_err(|e| info.unreadable(&e))?;
        info.check(value)?;
        *self = value;
        Ok(())
    }
    fn accept(&mut self, info: &'static Info, default: &Self, visitor: &mut dyn Visitor) {
        visitor.number(info, self, *default);
    }
}

impl Param for u32 {
    fn load<'de, D: Deserializer<'de>>(&mut self, info: &'static Info, from: D) -> Result<(), D::Error> {
        let value = <u32 as de::Deserialize>::deserialize(from).map_err(|e| info.wrong(&e))?;
        info.check(f64::from(value)).map_err(de::Error::custom)?;
        *self = value;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        leaf(info, path)?;
        let value: u32 = parse(info.name, text).map_err(|e| info.unreadable(&e))?;
        info.check(f64::from(value))?;
        *self = value;
        Ok(())
    }
    fn accept(&mut self, info: &'static Info, default: &Self, visitor: &mut dyn Visitor) {
        visitor.count(info, self, *default);
    }
}

impl Param for bool {
    fn load<'de, D: Deserializer<'de>>(&mut self, info: &'static Info, from: D) -> Result<(), D::Error> {
        *self = <bool as de::Deserialize>::deserialize(from).map_err(|e: D::Error| {
            de::Error::custom(format!("{}: {e}; accepted: true or false", info.name))
        })?;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        leaf(info, path)?;
        *self = parse(info.name, text)?;
        Ok(())
    }
    fn accept(&mut self, info: &'static Info, default: &Self, visitor: &mut dyn Visitor) {
        visitor.switch(info, self, *default);
    }
}

impl Param for DVec3 {
    fn load<'de, D: Deserializer<'de>>(&mut self, info: &'static Info, from: D) -> Result<(), D::Error> {
        let value: DVec3 = vector::deserialize(from).map_err(|e| info.wrong(&e))?;
        value.to_array().iter().try_for_each(|c| info.check(*c)).map_err(de::Error::custom)?;
        *self = value;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        leaf(info, path)?;
        let (x, y, z): (f64, f64, f64) = parse(info.name, text).map_err(|e| info.unreadable(&e))?;
        [x, y, z].iter().try_for_each(|c| info.check(*c))?;
        *self = DVec3::new(x, y, z);
        Ok(())
    }
    fn accept(&mut self, info: &'static Info, default: &Self, visitor: &mut dyn Visitor) {
        visitor.vector(info, self, *default);
    }
}

impl Param for String {
    fn load<'de, D: Deserializer<'de>>(&mut self, _: &'static Info, from: D) -> Result<(), D::Error> {
        *self = <String as de::Deserialize>::deserialize(from)?;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        leaf(info, path)?;
        // On a command line quotes are a nuisance: text that is no RON string is taken as it stands.
        *self = ron_options().from_str(text).unwrap_or_else(|_| text.to_owned());
        Ok(())
    }
    fn accept(&mut self, info: &'static Info, _: &Self, visitor: &mut dyn Visitor) {
        visitor.other(info);
    }
}

/// Vectors stand in files as `(x, y, z)`.
pub mod vector {
    use glam::DVec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Reads `(x, y, z)`.
    ///
    /// # Errors
    /// Anything that is not three numbers.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<DVec3, D::Error> {
        let (x, y, z) = Deserialize::deserialize(from)?;
        Ok(DVec3::new(x, y, z))
    }

    /// Writes `(x, y, z)`.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn serialize<S: Serializer>(value: &DVec3, to: S) -> Result<S::Ok, S::Error> {
        (value.x, value.y, value.z).serialize(to)
    }
}

/// Fails unless the path ends here.
///
/// # Errors
/// The path goes on behind a value that has no parts.
pub fn leaf(info: &Info, path: &str) -> Result<(), String> {
    if path.is_empty() { Ok(()) } else { Err(format!("{} has no part '{path}'", info.name)) }
}

impl<P: Params> Param for P {
    fn load<'de, D: Deserializer<'de>>(&mut self, _: &'static Info, from: D) -> Result<(), D::Error> {
        from.deserialize_struct(P::NAME, P::FIELDS, InPlace(self))
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        if !path.is_empty() {
            return self.set(path, text);
        }
        if !text.trim_start().starts_with('(') {
            let name = info.name;
            let parts: Vec<String> = P::FIELDS.iter().map(|field| format!("{name}.{field}")).collect();
            return Err(format!(
                "{name} is a set of values and cannot be '{}'; accepted: {}, or all in ()",
                excerpt(text),
                parts.join(", ")
            ));
        }
        set_whole(self, info, text)
    }
    fn accept(&mut self, info: &'static Info, default: &Self, visitor: &mut dyn Visitor) {
        visitor.group(info, &mut |inside| self.visit_with(default, inside));
    }
}

/// Reads a set of parameters into an existing one, so that what the file leaves out keeps the default of its place.
pub struct InPlace<'a, P>(
    /// Where to.
    pub &'a mut P,
);

impl<'de, P: Params> de::Visitor<'de> for InPlace<'_, P> {
    type Value = ();
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the fields of {}", P::NAME)
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut seen: Vec<String> = Vec::new();
        while let Some(Key(key)) = map.next_key()? {
            if seen.contains(&key) {
                return Err(de::Error::custom(format!("{key} is given twice")));
            }
            self.0.load_field(&key, &mut map)?;
            seen.push(key);
        }
        Ok(())
    }
}

/// A field's name.
pub(crate) struct Key(pub(crate) String);

impl<'de> de::Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Name;
        impl de::Visitor<'_> for Name {
            type Value = Key;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a field's name")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Key, E> {
                Ok(Key(text.to_owned()))
            }
        }
        from.deserialize_identifier(Name)
    }
}

/// Reads one parameter in place, for use with [`MapAccess::next_value_seed`].
pub struct Seed<'a, P>(
    /// Where to.
    pub &'a mut P,
    /// What is declared about it.
    pub &'static Info,
);

impl<'de, P: Param> DeserializeSeed<'de> for Seed<'_, P> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        self.0.load(self.1, from)
    }
}

/// Declares a set of parameters: `name: type = default, unit "…", range a..=b, slider log a..=b, effort [1.0, 2.0], when
/// choice Name;` with everything behind the default optional. See the [module](mod@crate::params).
#[macro_export]
macro_rules! params {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $(
        $(#[doc = $doc:literal])*
        $(#[serde($($serde:tt)*)])?
        $field:ident : $ty:ty = $default:expr
            $(, unit $unit:literal)? $(, range $range:expr)? $(, slider $scale:ident $slider:expr)? $(, effort $effort:expr)?
            $(, when $choice:ident $chosen:ident)? ;
    )* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        $vis struct $name { $(
            $(#[doc = $doc])*
            $(#[serde($($serde)*)])?
            pub $field: $ty,
        )* }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $name {
            $(
                #[doc(hidden)]
                #[allow(non_upper_case_globals)]
                pub const $field: &'static $crate::params::Info = &$crate::params::Info {
                    name: stringify!($field),
                    doc: concat!($($doc, "\n"),*),
                    unit: $crate::params!(@or "" $(, $unit)?),
                    range: $crate::params!(@some $($range)?),
                    slider: $crate::params!(@slider $($scale $slider)?),
                    effort: $crate::params!(@effort $($effort)?),
                    when: $crate::params!(@some $((stringify!($choice), stringify!($chosen)))?),
                };
            )*
        }

        impl $crate::params::Params for $name {
            const NAME: &'static str = stringify!($name);
            const FIELDS: &'static [&'static str] = &[$(stringify!($field)),*];

            #[allow(unused_variables)]
            fn load_field<'de, A: serde::de::MapAccess<'de>>(
                &mut self, key: &str, map: &mut A,
            ) -> Result<(), A::Error> {
                match key {
                    $(stringify!($field) =>
                        map.next_value_seed($crate::params::Seed(&mut self.$field, Self::$field)),)*
                    _ => Err(serde::de::Error::custom($crate::params::unknown(key, Self::FIELDS))),
                }
            }

            #[allow(unused_variables)]
            fn set(&mut self, path: &str, text: &str) -> Result<(), String> {
                let (head, rest) = $crate::params::split_path(path);
                match head {
                    $(stringify!($field) =>
                        $crate::params::Param::set_path(&mut self.$field, Self::$field, rest, text),)*
                    _ => Err($crate::params::unknown(head, Self::FIELDS)),
                }
            }

            #[allow(unused_variables)]
            fn visit_with(&mut self, defaults: &Self, visitor: &mut dyn $crate::params::Visitor) {
                $($crate::params::Param::accept(&mut self.$field, Self::$field, &defaults.$field, visitor);)*
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                let mut fresh = Self::default();
                from.deserialize_struct(
                    <Self as $crate::params::Params>::NAME,
                    <Self as $crate::params::Params>::FIELDS,
                    $crate::params::InPlace(&mut fresh),
                )?;
                Ok(fresh)
            }
        }
    };
    (@or $default:literal) => { $default };
    (@or $default:literal, $given:literal) => { $given };
    (@some) => { None };
    (@some $range:expr) => { Some($range) };
    (@effort) => { &[] };
    (@effort $values:expr) => { &$values };
    (@slider) => { None };
    (@slider linear $range:expr) => { Some(($crate::params::Scale::Linear, $range)) };
    (@slider log $range:expr) => { Some(($crate::params::Scale::Log, $range)) };
}
