//! Where the camera looks by itself: at a scene that opens, at what is asked for, at what a burst has left.

use glam::Vec3;

use super::{LaneState, Workbench};
use crate::app::{
    camera::{Bounds, Camera},
    picture,
};

/// What the next frame is to look at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Focus {
    /// A scene that has just been opened.
    Opened,
    /// The selection, or the whole cloth.
    Wanted,
    /// All of a cloth that has burst: seen from within, a few springs that fly off would fill the picture.
    Burst,
}

/// What the camera does by itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Framing {
    /// What the next frame looks at.
    pub focus: Option<Focus>,
    /// The camera keeps the cloth in the picture: from its opening until the mouse first does something there.
    pub follows: bool,
    /// The view before a burst, and the one that shows what is left of the cloth.
    pub before_burst: Option<[Camera; 2]>,
}

impl Default for Framing {
    fn default() -> Self {
        Self { focus: Some(Focus::Opened), follows: true, before_burst: None }
    }
}

impl Workbench {
    /// Looks at what a burst has left, and back to where one looked from once that is mended.
    pub(super) fn see_burst(&mut self) {
        let has_burst = self.session.state().lanes.iter().any(|lane| lane.health.is_diverged());
        match self.framing.before_burst {
            None if has_burst => {
                let now = self.viewport.camera;
                self.framing.before_burst = Some([now; 2]);
                self.framing.focus = self.framing.focus.or(Some(Focus::Burst));
            }
            Some([before, shown]) if !has_burst => {
                self.framing.before_burst = None;
                // Whoever has turned the view himself keeps it.
                if self.viewport.camera == shown && self.framing.focus != Some(Focus::Opened) {
                    self.viewport.camera = before;
                }
            }
            _ => {}
        }
    }

    /// Turns after cloth that moves on, `seconds` later than the last time. As long as it is about where it is looked for the
    /// camera rests: a flag shall wave before a still ground.
    pub(super) fn follow(&mut self, lane: &LaneState, seconds: f32) {
        /// Seconds in which the view catches up with most of the way.
        const EASE: f32 = 0.8;
        /// How far off is still well placed: of half the picture's height, and as a ratio of sizes.
        const PLACED: f32 = 0.12;
        let Some(bounds) = lane.bounds else { return };
        let size = self.viewport.size();
        let camera = &mut self.viewport.camera;
        let mut wanted = *camera;
        wanted.focus(&bounds, size);
        let part = 1.0 - (-seconds.min(0.1) / EASE).exp();
        let way = wanted.target - camera.target;
        let far = way.length();
        let excess = (far - PLACED * wanted.half_height()).max(0.0);
        let larger = (wanted.distance / camera.distance).ln();
        let beyond = larger - larger.clamp(-PLACED, PLACED);
        if excess > 0.0 {
            camera.target += way / far * (excess * part);
        }
        camera.distance *= (beyond * part).exp();
    }

    pub(super) fn look(&mut self, lane: &LaneState) {
        let size = self.viewport.size();
        let focus = self.framing.focus.take();
        self.framing.follows |= focus.is_some();
        if focus == Some(Focus::Burst) {
            if let Some(bounds) = lane.bounds {
                self.viewport.camera.focus(&bounds, size);
            }
            if let Some([_, shown]) = &mut self.framing.before_burst {
                *shown = self.viewport.camera;
            }
            return;
        }
        if focus == Some(Focus::Opened) {
            let usual = Camera { projection: self.viewport.camera.projection, ..Camera::default() };
            let yaw = picture::telling_yaw(usual, &lane.positions, &lane.geometry.triangles);
            self.viewport.camera = Camera { yaw, ..usual };
        }
        let selected: Vec<[f32; 3]> = self
            .session
            .selection
            .iter()
            .filter(|_| focus == Some(Focus::Wanted))
            .filter_map(|p| lane.positions.get(*p as usize).copied())
            .collect();
        if let Some(bounds) = Bounds::of(&selected) {
            // Room around, also around a single particle.
            let room = Vec3::splat((bounds.radius() * 0.3).max(2.0 * mean_length(lane)));
            let bounds = Bounds { min: bounds.min - room, max: bounds.max + room };
            self.viewport.camera.focus(&bounds, size);
        } else if let Some(bounds) = lane.bounds {
            // Cloth falls: below a flat sheet there must be room for it.
            let fall = ((bounds.max - bounds.min).with_y(0.0).max_element() - (bounds.max.y - bounds.min.y))
                .max(0.0);
            let fall = if focus == Some(Focus::Opened) { fall } else { 0.0 };
            let room = Bounds { min: bounds.min - Vec3::Y * fall * 0.8, max: bounds.max };
            if focus == Some(Focus::Opened) {
                self.ground_height = bounds.min.y - fall * 1.1 - bounds.radius() * 0.1;
            }
            self.viewport.camera.focus(&room, size);
        }
    }
}

fn mean_length(lane: &LaneState) -> f32 {
    let lengths = &lane.geometry.rest_lengths[0];
    if lengths.is_empty() { 0.1 } else { lengths.iter().sum::<f32>() / lengths.len() as f32 }
}
