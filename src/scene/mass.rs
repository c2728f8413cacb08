//! How mass is given to the particles.

use super::Refusal;
use crate::params::{self, Info, Param, Visitor};
use crate::target::QuadMesh;
use glam::DVec3;
use serde::de::{self, Deserialize, Deserializer};
use std::ops::RangeInclusive;

/// Mass by particle or by area.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Mass {
    /// The same mass for every particle, kg.
    PerParticle(f64),
    /// Mass per area, kg/m²: each face's mass goes to its corners in equal parts.
    PerArea(f64),
}

impl Default for Mass {
    fn default() -> Self {
        Self::PerParticle(1.0)
    }
}

impl Mass {
    /// Values that are accepted, kg or kg/m².
    pub const RANGE: RangeInclusive<f64> = 1e-12..=1e12;

    /// The mass of every particle of a mesh, kg.
    ///
    /// # Errors
    /// By area, where a particle belongs to no face with an area.
    pub fn of(&self, mesh: &QuadMesh) -> Result<Vec<f64>, Refusal> {
        match *self {
            Self::PerParticle(mass) => Ok(vec![mass; mesh.positions.len()]),
            Self::PerArea(density) => {
                let mut mass = vec![0.0; mesh.positions.len()];
                for face in mesh.faces() {
                    let share = density * area(face, &mesh.positions) / face.len() as f64;
                    for &corner in face {
                        mass[corner as usize] += share;
                    }
                }
                match mass.iter().position(|m| *m <= 0.0) {
                    None => Ok(mass),
                    Some(i) => Err(Refusal::new(format!(
                        "mass: particle {i} belongs to no face with an area, so PerArea gives it no mass; accepted here: PerParticle"
                    ))),
                }
            }
        }
    }

    fn check(self) -> Result<(), String> {
        let (Self::PerParticle(value) | Self::PerArea(value)) = self;
        if Self::RANGE.contains(&value) {
            Ok(())
        } else {
            Err(format!("mass is {}; accepted: 1e-12 to 1e12 kg or kg/m²", params::Short(value)))
        }
    }
}

/// Area of a polygon, m²: half the length of the sum of its corners' cross products (Newell), which for a bent quad is
/// half the cross product of its diagonals.
fn area(face: &[u32], positions: &[DVec3]) -> f64 {
    let corner = |i: usize| positions[face[i % face.len()] as usize] - positions[face[0] as usize];
    (0..face.len()).map(|i| corner(i).cross(corner(i + 1))).sum::<DVec3>().length() / 2.0
}

impl Param for Mass {
    fn load<'de, D: Deserializer<'de>>(&mut self, _: &'static Info, from: D) -> Result<(), D::Error> {
        let mass = Self::deserialize(from)?;
        mass.check().map_err(de::Error::custom)?;
        *self = mass;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        params::leaf(info, path)?;
        params::set_whole(self, info, text)
            .map_err(|e| format!("{e}; accepted: PerParticle(kg) or PerArea(kg/m²)"))
    }
    fn accept(&mut self, info: &'static Info, _: &Self, visitor: &mut dyn Visitor) {
        visitor.other(info);
    }
}
