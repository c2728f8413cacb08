//! Which particles are pinned: a union of simple selections.

use super::{GridTarget, Refusal, Target};
use crate::params::{self, Info, Param, Visitor, vector};
use crate::target::QuadMesh;
use glam::DVec3;
use serde::de::{self, Deserialize, Deserializer};

/// One selection of particles.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Pin {
    /// One particle by index.
    Particle(u32),
    /// The first n and the last n particles of a grid's row 0.
    Corners(u32),
    /// A row of a grid.
    Row(u32),
    /// A column of a grid.
    Column(u32),
    /// The particle nearest to a point, m (the lowest index where several are).
    Nearest(#[serde(with = "vector")] DVec3),
    /// All particles inside a box from its lowest to its highest corner, m, faces included.
    Box(#[serde(with = "vector")] DVec3, #[serde(with = "vector")] DVec3),
    /// The highest part of the shape: this fraction of its bounding box's height.
    Top(f64),
}

/// The union of some selections. Left out, a grid has [`Pin::Corners`]`(3)` and a mesh none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pins(Option<Vec<Pin>>);

/// As a list; those left out are not written at all.
impl serde::Serialize for Pins {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.as_deref().unwrap_or_default().serialize(to)
    }
}

impl Pins {
    /// The union of these.
    pub fn of(pins: impl Into<Vec<Pin>>) -> Self {
        Self(Some(pins.into()))
    }

    /// Whether they are left to the target.
    pub fn is_default(&self) -> bool {
        self.0.is_none()
    }

    /// Memory that the list takes, bytes.
    pub(crate) fn size(&self) -> usize {
        self.0.as_deref().map_or(0, size_of_val)
    }

    /// The selections, those of the target where they are left out.
    pub fn list(&self, target: &Target) -> Vec<Pin> {
        match (&self.0, target) {
            (Some(pins), _) => pins.clone(),
            (None, Target::Grid(_)) => vec![Pin::Corners(3)],
            (None, Target::Mesh(_)) => Vec::new(),
        }
    }

    /// Takes over that the user pinned or freed `changed`; `pinned` says of each particle whether it is pinned now.
    pub fn edit(&mut self, target: &Target, pinned: &[bool], changed: &[u32], pin: bool) {
        let particles = (0u32..).zip(pinned).filter(|(_, p)| **p).map(|(i, _)| Pin::Particle(i));
        self.0 = Some(if pin {
            let mut list = self.list(target);
            let added = changed.iter().map(|i| Pin::Particle(*i)).filter(|p| !list.contains(p));
            let added: Vec<_> = added.collect();
            list.extend(added);
            list
        } else {
            particles.collect()
        });
    }

    /// For each particle, whether it is pinned.
    ///
    /// # Errors
    /// A particle, row or column that is not there; a grid's selection on a mesh.
    pub fn select(&self, target: &Target, mesh: &QuadMesh) -> Result<Vec<bool>, Refusal> {
        let mut pinned = vec![false; mesh.positions.len()];
        for pin in self.list(target) {
            pin.select(target, mesh, &mut pinned)?;
        }
        Ok(pinned)
    }
}

impl Pin {
    fn select(&self, target: &Target, mesh: &QuadMesh, pinned: &mut [bool]) -> Result<(), Refusal> {
        let grid = || match target {
            Target::Grid(grid) => Ok(grid),
            Target::Mesh(_) => Err(Refusal::new(format!(
                "pins: {self:?} needs a grid; accepted for a mesh: Particle, Nearest, Box, Top"
            ))),
        };
        let within = |index: u32, count: u32, what: &str| {
            if index < count {
                Ok(index as usize)
            } else {
                Err(Refusal::new(format!(
                    "pins: {self:?}, but the {what}s are 0 to {}",
                    count.saturating_sub(1)
                )))
            }
        };
        let positions = &mesh.positions;
        match *self {
            Self::Particle(i) => pinned[within(i, positions.len() as u32, "particle")?] = true,
            Self::Corners(n) => {
                let GridTarget { columns, .. } = *grid()?;
                let n = n.min(columns) as usize;
                pinned[..n].fill(true);
                pinned[columns as usize - n..columns as usize].fill(true);
            }
            Self::Row(r) => {
                let GridTarget { columns, rows, .. } = *grid()?;
                let start = within(r, rows, "row")? * columns as usize;
                pinned[start..start + columns as usize].fill(true);
            }
            Self::Column(c) => {
                let GridTarget { columns, .. } = *grid()?;
                let c = within(c, columns, "column")?;
                pinned.iter_mut().skip(c).step_by(columns as usize).for_each(|p| *p = true);
            }
            Self::Nearest(point) => {
                let nearest = (0..positions.len()).min_by(|&a, &b| {
                    let distance = |i: usize| positions[i].distance_squared(point);
                    distance(a).total_cmp(&distance(b))
                });
                nearest.into_iter().for_each(|i| pinned[i] = true);
            }
            Self::Box(low, high) => {
                let inside = |p: &DVec3| p.cmpge(low).all() && p.cmple(high).all();
                pinned.iter_mut().zip(positions).for_each(|(pin, p)| *pin |= inside(p));
            }
            Self::Top(fraction) => {
                let (low, high) = positions
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.y), h.max(p.y)));
                let edge = high - fraction * (high - low);
                pinned.iter_mut().zip(positions).for_each(|(pin, p)| *pin |= p.y >= edge);
            }
        }
        Ok(())
    }

    fn check(&self) -> Result<(), String> {
        let finite = |point: &DVec3| {
            if point.is_finite() { Ok(()) } else { Err(format!("{self:?}; accepted: finite coordinates")) }
        };
        match self {
            Self::Nearest(point) => finite(point),
            Self::Box(low, high) => {
                finite(low)?;
                finite(high)?;
                if low.cmple(*high).all() {
                    Ok(())
                } else {
                    Err(format!("{self:?}; accepted: the lowest corner first, the highest second"))
                }
            }
            Self::Top(fraction) if !(0.0..=1.0).contains(fraction) => {
                Err(format!("Top({fraction}); accepted: 0 to 1"))
            }
            _ => Ok(()),
        }
    }
}

impl Param for Pins {
    fn load<'de, D: Deserializer<'de>>(&mut self, _: &'static Info, from: D) -> Result<(), D::Error> {
        let pins = Vec::<Pin>::deserialize(from)?;
        pins.iter().try_for_each(Pin::check).map_err(de::Error::custom)?;
        self.0 = Some(pins);
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        params::leaf(info, path)?;
        params::set_whole(self, info, text)
            .map_err(|e| format!("{e}; accepted: a list, as in [Corners(2), Top(0.03), Particle(7)]"))
    }
    fn accept(&mut self, info: &'static Info, _: &Self, visitor: &mut dyn Visitor) {
        visitor.other(info);
    }
}
