//! What is simulated: a grid by its numbers, or a mesh by its file.

use super::{Place, Refusal};
use crate::params::{self, InPlace, Info, Param, Params, Visitor};
use crate::target::{self, Import, ImportOptions, ImportReport, QuadMesh, Surface};
use serde::de::{self, Deserialize, Deserializer, VariantAccess};
use serde::ser::SerializeStructVariant;
use serde::{Serialize, Serializer};
use std::fmt;

crate::choice! {
    /// How a grid lies in space.
    pub enum Plane {
        /// Flat on y = 0, rows along z.
        Horizontal,
        /// Upright on z = 0, row 0 on top.
        Vertical,
    }
}

crate::params! {
    /// A rectangular sheet of quads; particle index = row x columns + column.
    pub struct GridTarget {
        /// Particles along x.
        columns: u32 = 25, range 1.0..=1e6, slider log 2.0..=200.0;
        /// Particles along z (horizontal) or y (vertical).
        rows: u32 = 25, range 1.0..=1e6, slider log 2.0..=200.0;
        /// Distance between neighbours.
        spacing: f64 = 1.0, unit "m", range 1e-6..=1e6, slider log 0.01..=10.0;
        /// How the sheet lies in space.
        plane: Plane = Plane::Horizontal;
    }
}

crate::params! {
    /// A mesh from a file: `.obj`, `.gltf` or `.glb`.
    pub struct MeshTarget {
        /// Path relative to the scene's file, or `asset:NAME` for a mesh that comes with Tenter.
        path: String = String::new();
        /// Positions are multiplied by this.
        scale: f64 = 1.0, range 1e-9..=1e9, slider log 0.01..=100.0;
        /// Vertices nearer than this part of the bounding box's diagonal become one particle; those at exactly the
        /// same place always do.
        weld: f64 = 0.0, range 0.0..=1.0, slider linear 0.0..=0.001;
    }
}

impl MeshTarget {
    /// The name of a mesh that comes with Tenter.
    pub fn asset(&self) -> Option<&str> {
        self.path.strip_prefix("asset:")
    }

    fn options(&self, surface: bool) -> ImportOptions {
        ImportOptions { scale: self.scale, weld: self.weld, surface }
    }
}

/// What is simulated.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// A generated sheet.
    Grid(GridTarget),
    /// An imported mesh.
    Mesh(MeshTarget),
}

/// A target's mesh with what its import found.
#[derive(Clone, Debug)]
pub struct Built {
    /// The mesh.
    pub mesh: QuadMesh,
    /// What was found and mended; empty for a grid.
    pub report: ImportReport,
}

impl Default for Target {
    fn default() -> Self {
        Self::Grid(GridTarget::default())
    }
}

/// Bytes that a simulation takes for each particle of a quad mesh, state, springs and import included: an upper
/// estimate, for refusing what could never fit.
const BYTES_PER_PARTICLE: u64 = 1000;

impl Target {
    /// A mesh by its path.
    pub fn mesh(path: impl Into<String>) -> Self {
        Self::Mesh(MeshTarget { path: path.into(), ..MeshTarget::default() })
    }

    /// Makes the mesh.
    ///
    /// # Errors
    /// A file that cannot be read, or is not a mesh, or lies where the scene may not look; a target that does not fit
    /// into memory.
    pub fn build(&self, place: &Place) -> Result<Built, Refusal> {
        match self {
            Self::Grid(grid) => {
                let particles = u64::from(grid.columns) * u64::from(grid.rows);
                let bytes = particles * BYTES_PER_PARTICLE;
                let free = free_memory();
                if bytes > free || particles > u64::from(u32::MAX) {
                    return Err(Refusal::new(format!(
                        "target: a grid of {} x {} has {particles} particles and needs about {} GB; accepted here: up to {} particles",
                        grid.columns,
                        grid.rows,
                        bytes / 1_000_000_000,
                        free / BYTES_PER_PARTICLE
                    )));
                }
                let upright = grid.plane == Plane::Vertical;
                let mesh = target::grid(grid.columns, grid.rows, grid.spacing, upright);
                let report = ImportReport {
                    faces: mesh.face_counts(),
                    components: mesh.components(),
                    ..ImportReport::default()
                };
                Ok(Built { mesh, report })
            }
            Self::Mesh(mesh) => {
                let options = mesh.options(false);
                let Import { mesh, report, .. } = place.import(&mesh.path, &options)?;
                Ok(Built { mesh, report })
            }
        }
    }

    /// The surface as the target's source has it, for exports: of a mesh the file's own. The file is read again.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn surface(&self, place: &Place) -> Result<Surface, Refusal> {
        match self {
            Self::Grid(grid) => Ok(Surface::of_grid(&self.build(place)?.mesh, grid.columns, grid.rows)),
            Self::Mesh(mesh) => {
                Ok(place.import(&mesh.path, &mesh.options(true))?.surface.unwrap_or_default())
            }
        }
    }

    pub(super) fn check(&self) -> Result<(), Refusal> {
        match self {
            Self::Mesh(mesh) if mesh.path.is_empty() => {
                Err(Refusal::new("target: Mesh has no path; accepted: Mesh(path: \"shirt.obj\")"))
            }
            _ => Ok(()),
        }
    }
}

/// Memory that can still be taken, bytes; where the system does not say, 8 GB.
fn free_memory() -> u64 {
    let kilobytes = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        line.trim().trim_end_matches(" kB").parse::<u64>().ok()
    });
    kilobytes.map_or(8_000_000_000, |kb| kb * 1024)
}

impl Serialize for Target {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Grid(grid) => {
                let mut fields = to.serialize_struct_variant("Target", 0, "Grid", 4)?;
                fields.serialize_field("columns", &grid.columns)?;
                fields.serialize_field("rows", &grid.rows)?;
                fields.serialize_field("spacing", &grid.spacing)?;
                fields.serialize_field("plane", &grid.plane)?;
                fields.end()
            }
            Self::Mesh(mesh) => {
                let mut fields = to.serialize_struct_variant("Target", 1, "Mesh", 3)?;
                fields.serialize_field("path", &mesh.path)?;
                fields.serialize_field("scale", &mesh.scale)?;
                fields.serialize_field("weld", &mesh.weld)?;
                fields.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Target {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Variant;
        impl<'de> de::Visitor<'de> for Variant {
            type Value = Target;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("Grid(…) or Mesh(…)")
            }
            fn visit_enum<A: de::EnumAccess<'de>>(self, data: A) -> Result<Target, A::Error> {
                let (params::Key(name), variant) = data.variant()?;
                match name.as_str() {
                    "Grid" => {
                        let mut grid = GridTarget::default();
                        variant.struct_variant(GridTarget::FIELDS, InPlace(&mut grid))?;
                        Ok(Target::Grid(grid))
                    }
                    "Mesh" => {
                        let mut mesh = MeshTarget::default();
                        variant.struct_variant(MeshTarget::FIELDS, InPlace(&mut mesh))?;
                        Ok(Target::Mesh(mesh))
                    }
                    _ => Err(de::Error::custom(params::unknown(&name, &["Grid", "Mesh"]))),
                }
            }
        }
        from.deserialize_enum("Target", &["Grid", "Mesh"], Variant)
    }
}

impl Param for Target {
    fn load<'de, D: Deserializer<'de>>(&mut self, _: &'static Info, from: D) -> Result<(), D::Error> {
        *self = Self::deserialize(from)?;
        Ok(())
    }
    fn set_path(&mut self, info: &'static Info, path: &str, text: &str) -> Result<(), String> {
        match self {
            _ if path.is_empty() => params::set_whole(self, info, text).map_err(|e| {
                format!("{e}; accepted: Grid(columns: 25, rows: 25), or Mesh(path: \"shirt.obj\"), and more of their fields")
            }),
            Self::Grid(grid) => grid.set(path, text),
            Self::Mesh(mesh) => mesh.set(path, text),
        }
    }
    fn accept(&mut self, info: &'static Info, _: &Self, visitor: &mut dyn Visitor) {
        visitor.group(info, &mut |inside| match self {
            Self::Grid(grid) => grid.visit(inside),
            Self::Mesh(mesh) => mesh.visit(inside),
        });
    }
}
