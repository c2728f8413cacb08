//! PC2 point cache: the positions of the source's vertices, in their order, for a program that has the mesh already.
//!
//! 32 bytes of header (`POINTCACHE2\0`, version 1, points, start, frames a sample, samples), then x y z of every point of
//! every sample, all in 32 bits, little-endian.

use super::{Frame, Sink};
use crate::scene::{Pending, Refusal};
use crate::target::Surface;
use glam::DVec3;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

pub(super) struct PointCache {
    file: Pending,
    surface: Surface,
    positions: Vec<DVec3>,
    samples: u32,
}

/// Where the number of samples stands in the file.
const SAMPLES_AT: u64 = 28;

impl PointCache {
    pub(super) fn new(path: &Path, surface: Surface) -> Result<Self, Refusal> {
        let file = Pending::new(path)?;
        let points = i32::try_from(surface.vertices.len());
        let points = points.map_err(|_| file.failed("over 2147483647 points, more than PC2 can count"))?;
        let mut header = b"POINTCACHE2\0".to_vec();
        header.extend(1_i32.to_le_bytes());
        header.extend(points.to_le_bytes());
        header.extend(0_f32.to_le_bytes());
        header.extend(1_f32.to_le_bytes());
        header.extend(0_i32.to_le_bytes());
        file.file().write_all(&header).map_err(|e| file.failed(e))?;
        Ok(Self { file, surface, positions: Vec::new(), samples: 0 })
    }
}

impl Sink for PointCache {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        self.surface.place(frame.positions, &mut self.positions);
        super::check_single(&self.positions).map_err(|e| self.file.failed(e))?;
        let mut to = BufWriter::new(self.file.file());
        for p in &self.positions {
            to.write_all(&super::single(*p)).map_err(|e| self.file.failed(e))?;
        }
        to.flush().map_err(|e| self.file.failed(e))?;
        self.samples += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        let mut to = self.file.file();
        to.seek(SeekFrom::Start(SAMPLES_AT)).map_err(|e| self.file.failed(e))?;
        to.write_all(&self.samples.to_le_bytes()).map_err(|e| self.file.failed(e))?;
        self.file.keep()
    }
}
