//! The picture beneath the panels: every lane, blended between its last two states, as the display settings say.

use std::time::Instant;

use glam::Vec3;

use super::{Canvas, Cloth, LaneState, Style, Workbench, panels};
use crate::app::{
    camera::Bounds,
    render::{Frame, Ramp, flag},
    viewport::Tile,
};

impl Workbench {
    /// The style as it is drawn: lanes may be coloured by their distance.
    pub(super) fn shown_style(&self) -> Style {
        let mut style = self.style.clone();
        if self.by_distance() {
            style.ramp = Ramp::Distance;
            style.surface_values = true;
            style.spring_strain = false;
            style.value_range = self.display.distance_range;
        }
        style
    }

    pub(super) fn draw_lanes(&mut self, canvas: &mut Canvas<'_>) {
        let style = self.shown_style();
        let is_tiled = self.is_tiled();
        let by_distance = self.by_distance();
        let Some((drawing, cloths)) = &mut self.drawing else { return };
        let (device, queue) = (&canvas.gpu.device, &canvas.gpu.queue);
        let state = self.session.state();
        while cloths.len() < state.lanes.len() {
            cloths.push(Cloth::new(device, queue, drawing.renderer()));
        }
        cloths.truncate(state.lanes.len());
        self.frame += 1;
        let mut bounds: Vec<Option<Bounds>> = Vec::new();
        for (number, (lane, cloth)) in state.lanes.iter().zip(cloths.iter_mut()).enumerate() {
            let blended = blend(state.running, state.at, state.beat, lane, &mut self.positions);
            let positions = if blended { &self.positions } else { lane.positions.as_ref() };
            self.flags.clone_from(&lane.flags);
            for particle in &self.session.selection {
                if let Some(flag) = self.flags.get_mut(*particle as usize) {
                    *flag |= flag::SELECTED;
                }
            }
            cloth.set_topology(device, queue, drawing.renderer(), &lane.geometry.topology());
            let kinds = lane.scene.springs.kinds();
            let frame = Frame {
                // A still picture uploads nothing: the state's version stands for all that it holds.
                version: if blended { u64::MAX - self.frame } else { state.version },
                positions,
                flags: &self.flags,
                values: lane.values.as_ref().map(|values| values.as_slice()),
                enabled: kinds.each_ref().map(|kind| kind.enabled),
                rest_scale: kinds.each_ref().map(|kind| kind.rest_scale as f32),
                tint: (state.lanes.len() > 1 && !by_distance).then(|| panels::lane_colour(number)),
            };
            cloth.set_frame(device, queue, drawing.renderer(), &frame, &style);
            bounds.push(Bounds::of(positions.iter()));
        }
        let (camera, ground_height) = (&self.viewport.camera, self.ground_height);
        let count = cloths.len();
        let rects = self.viewport.rects().iter().enumerate().take(count.max(1));
        let tiles: Vec<Tile<'_>> = rects
            .map(|(tile, rect)| {
                let lanes = if is_tiled { tile..(tile + 1).min(count) } else { 0..count };
                let bounds = bounds[lanes.clone()].iter().flatten().copied().reduce(|a, b| a.union(&b));
                Tile { camera, rect: *rect, lanes, ground_height, bounds }
            })
            .collect();
        drawing.draw(canvas, &tiles, cloths, &style);
    }
}

/// Writes the lane's positions between its last two states into `into`; false if the last state is to be shown as it is.
fn blend(
    running: bool,
    at: Instant,
    beat: std::time::Duration,
    lane: &LaneState,
    into: &mut Vec<[f32; 3]>,
) -> bool {
    let Some(previous) = lane.previous.as_ref().filter(|_| running && !beat.is_zero()) else { return false };
    let part = (at.elapsed().as_secs_f32() / beat.as_secs_f32()).min(1.0);
    into.clear();
    into.extend(
        previous
            .iter()
            .zip(lane.positions.iter())
            .map(|(&a, &b)| Vec3::from(a).lerp(Vec3::from(b), part).to_array()),
    );
    true
}
