//! The picture beneath the panels: every lane, blended between its last two states, as the display settings say.

use super::{Canvas, Cloth, LaneState, Style, Workbench, panels};
use crate::app::{
    camera::Bounds,
    engine::{Moment, State},
    render::{Earlier, Frame, Ramp, flag},
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
        let mut bounds: Vec<Option<Bounds>> = Vec::new();
        for (number, (lane, cloth)) in state.lanes.iter().zip(cloths.iter_mut()).enumerate() {
            let earlier = on_the_way(state, lane);
            let flags = if self.session.selection.is_empty() {
                &lane.flags
            } else {
                self.flags.clone_from(&lane.flags);
                for particle in &self.session.selection {
                    if let Some(flag) = self.flags.get_mut(*particle as usize) {
                        *flag |= flag::SELECTED;
                    }
                }
                &self.flags
            };
            cloth.set_topology(device, queue, drawing.renderer(), &lane.geometry.topology());
            let kinds = lane.scene.springs.kinds();
            let frame = Frame {
                version: lane.version,
                positions: &lane.positions,
                earlier: earlier.as_ref().map(|(before, part)| Earlier {
                    version: before.version,
                    positions: &before.positions,
                    part: *part,
                }),
                flags,
                values_version: state.version,
                values: lane.values.as_ref().map(|values| values.as_slice()),
                enabled: kinds.each_ref().map(|kind| kind.enabled),
                rest_scale: kinds.each_ref().map(|kind| kind.rest_scale as f32),
                tint: (state.lanes.len() > 1 && !by_distance).then(|| panels::lane_colour(number)),
            };
            cloth.set_frame(device, queue, drawing.renderer(), &frame, &style);
            bounds.push(match earlier {
                Some((before, part)) => {
                    before.bounds.zip(lane.bounds).map(|(before, now)| before.towards(&now, part))
                }
                None => lane.bounds,
            });
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

/// The state before, and how much of the way to the last one is to be shown; none if that is shown as it is.
fn on_the_way<'a>(state: &State, lane: &'a LaneState) -> Option<(&'a Moment, f32)> {
    let before = lane.previous.as_ref().filter(|_| state.running && !state.beat.is_zero())?;
    let part = state.at.elapsed().as_secs_f32() / state.beat.as_secs_f32();
    Some((before, part.min(1.0)))
}
