//! Parameters that are one of several names.

use serde::de;
use std::fmt;
use std::marker::PhantomData;

use super::{Key, excerpt};

/// An enumeration that a user chooses from, declared with [`choice!`](crate::choice!).
pub trait Choice: Copy + PartialEq + 'static {
    /// All of them.
    const ALL: &'static [Self];
    /// Their names, in the same order.
    const NAMES: &'static [&'static str];

    /// Position among all of them.
    fn index(self) -> usize {
        Self::ALL.iter().position(|c| *c == self).unwrap_or(0)
    }
}

/// The choice of a name; case and quotes do not matter.
///
/// # Errors
/// One line with the names there are.
pub fn choose<C: Choice>(name: &str, text: &str) -> Result<C, String> {
    let wanted = text.trim().trim_matches('"');
    let found = C::NAMES.iter().position(|known| known.eq_ignore_ascii_case(wanted));
    found
        .map(|i| C::ALL[i])
        .ok_or_else(|| format!("{name} cannot be '{}'; accepted: {}", excerpt(text), C::NAMES.join(", ")))
}

/// Reads a choice by name, from an identifier or a string.
pub struct ChoiceVisitor<C>(
    /// Which.
    pub PhantomData<C>,
);

impl<'de, C: Choice> de::Visitor<'de> for ChoiceVisitor<C> {
    type Value = C;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "one of {}", C::NAMES.join(", "))
    }
    fn visit_enum<A: de::EnumAccess<'de>>(self, data: A) -> Result<C, A::Error> {
        let (Key(name), variant) = data.variant()?;
        de::VariantAccess::unit_variant(variant)?;
        choose("it", &name).map_err(de::Error::custom)
    }
}

/// Declares an enumeration that a user chooses from.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($(#[$variant_meta:meta])* $variant:ident),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
        $vis enum $name { $($(#[$variant_meta])* $variant),* }

        impl $crate::params::Choice for $name {
            const ALL: &'static [Self] = &[$(Self::$variant),*];
            const NAMES: &'static [&'static str] = &[$(stringify!($variant)),*];
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                from.deserialize_enum(
                    stringify!($name),
                    <Self as $crate::params::Choice>::NAMES,
                    $crate::params::ChoiceVisitor::<Self>(std::marker::PhantomData),
                )
            }
        }

        impl $crate::params::Param for $name {
            fn load<'de, D: serde::Deserializer<'de>>(
                &mut self, _: &'static $crate::params::Info, from: D,
            ) -> Result<(), D::Error> {
                *self = serde::Deserialize::deserialize(from)?;
                Ok(())
            }
            fn set_path(
                &mut self, info: &'static $crate::params::Info, path: &str, text: &str,
            ) -> Result<(), String> {
                $crate::params::leaf(info, path)?;
                *self = $crate::params::choose(info.name, text)?;
                Ok(())
            }
            fn accept(
                &mut self, info: &'static $crate::params::Info, default: &Self,
                visitor: &mut dyn $crate::params::Visitor,
            ) {
                use $crate::params::Choice;
                let mut index = self.index();
                visitor.choice(info, Self::NAMES, &mut index, default.index());
                *self = Self::ALL[index.min(Self::ALL.len() - 1)];
            }
        }
    };
}
