//! What the mouse means: turns presses, drags and releases over the viewport into intents, and changes nothing itself.
//!
//! Left on a particle: click selects, drag moves. Left elsewhere: drag orbits, with Shift frames a box, with Ctrl draws a lasso.
//! With the box or the lasso in the hand a left drag frames or ropes wherever it begins, once: then the hand is empty again,
//! unless Shift asks for more. Right orbits, middle (or Shift and right) pans, the wheel zooms, Escape lets go.

use glam::{Vec2, Vec3};

use super::camera::Camera;

/// What a left drag does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// Moves particles, and turns the camera beside them.
    #[default]
    Move,
    /// Frames a box.
    Box,
    /// Draws a lasso.
    Lasso,
}

/// The mouse in one frame, in pixels of the viewport.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(clippy::struct_excessive_bools)]
pub struct Pointer {
    /// Where it is; `None` outside of the window.
    pub at: Option<Vec2>,
    /// Moved since the last frame.
    pub moved: Vec2,
    /// Left, right and middle button held; a press counts only where it began over the viewport.
    pub left: bool,
    /// Right button.
    pub right: bool,
    /// Middle button.
    pub middle: bool,
    /// Shift key.
    pub shift: bool,
    /// Ctrl or Command key.
    pub ctrl: bool,
    /// Escape was pressed in this frame.
    pub escape: bool,
    /// Factor of the wheel or a pinch: above 1 comes nearer.
    pub zoom: f32,
}

/// What the user wants; the workbench does it.
#[derive(Clone, Debug, PartialEq)]
pub enum Intent {
    /// Turn the camera by a drag, pixels.
    Orbit(Vec2),
    /// Shift the camera by a drag, pixels.
    Pan(Vec2),
    /// Come nearer (above 1) to what is under the cursor.
    Zoom(f32, Vec2),
    /// Select one particle, or none; `add` keeps the others.
    Click {
        /// The particle under the cursor.
        particle: Option<u32>,
        /// Keep what is selected, and take a selected one out.
        add: bool,
    },
    /// Select what lies in the box.
    Box([Vec2; 2], bool),
    /// Select what lies in the outline.
    Lasso(Vec<Vec2>, bool),
    /// Take hold of this particle, and of the selection if it is part of it.
    Grab(u32),
    /// Hold what was taken this far from where it was taken, m.
    Drag(Vec3),
    /// Let go.
    Release,
    /// Let go, and put back as it was before.
    Cancel,
    /// Select nothing.
    Deselect,
}

#[derive(Clone, Debug, Default, PartialEq)]
enum State {
    #[default]
    Idle,
    /// Left is down; not yet clear whether it becomes a click or a drag.
    Pressed {
        at: Vec2,
        particle: Option<u32>,
    },
    /// A particle is held: where the mouse took it, and in which plane it moves.
    Holding {
        from: Vec3,
        normal: Vec3,
    },
    Orbiting,
    Panning,
    Framing {
        from: Vec2,
    },
    Roping {
        outline: Vec<Vec2>,
    },
    /// Escape was pressed: nothing happens until every button is up.
    Cancelled,
}

/// The state between two frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hands {
    state: State,
    /// What a left drag does.
    pub tool: Tool,
}

/// Farther than this the mouse drags, nearer it clicks, pixels.
const DRAG_THRESHOLD: f32 = 4.0;
/// Points of a lasso are at least this far apart, pixels.
const LASSO_STEP: f32 = 3.0;

impl Hands {
    /// True while a particle is held.
    pub fn are_holding(&self) -> bool {
        matches!(self.state, State::Holding { .. })
    }

    /// The outline of a box or lasso that is being drawn, pixels.
    pub fn outline(&self, at: Vec2) -> Vec<Vec2> {
        match &self.state {
            State::Framing { from } => vec![*from, Vec2::new(at.x, from.y), at, Vec2::new(from.x, at.y)],
            State::Roping { outline } => outline.clone(),
            _ => Vec::new(),
        }
    }

    /// Takes one frame of the mouse. `pick` names the particle under a pixel, `place` says where a particle is, m.
    pub fn update(
        &mut self,
        pointer: &Pointer,
        camera: &Camera,
        size: Vec2,
        pick: impl FnOnce(Vec2) -> Option<u32>,
        place: impl FnOnce(u32) -> Option<Vec3>,
    ) -> Vec<Intent> {
        let mut intents = Vec::new();
        let Some(at) = pointer.at else {
            self.leave(&mut intents);
            return intents;
        };
        if pointer.zoom > 0.0 && (pointer.zoom - 1.0).abs() > 1e-6 {
            intents.push(Intent::Zoom(pointer.zoom, at));
        }
        if pointer.escape {
            self.escape(&mut intents);
        }
        let pressed = pointer.left || pointer.right || pointer.middle;
        match &mut self.state {
            State::Idle if pointer.left => {
                self.state = State::Pressed { at, particle: pick(at) };
            }
            State::Idle if pointer.middle || (pointer.right && pointer.shift) => self.state = State::Panning,
            State::Idle if pointer.right => self.state = State::Orbiting,
            State::Pressed { at: from, particle } => {
                let (from, particle) = (*from, *particle);
                if !pointer.left {
                    intents.push(Intent::Click { particle, add: pointer.shift });
                    self.state = State::Idle;
                } else if from.distance(at) > DRAG_THRESHOLD {
                    self.begin_drag(
                        pointer,
                        camera,
                        size,
                        [from, at],
                        particle.zip(particle.and_then(place)),
                        &mut intents,
                    );
                }
            }
            State::Holding { from, normal } => {
                if pointer.left {
                    if let Some(to) = camera.ray(at, size).meet_plane(*from, *normal) {
                        intents.push(Intent::Drag(to - *from));
                    }
                } else {
                    intents.push(Intent::Release);
                    self.state = State::Idle;
                }
            }
            State::Framing { from } if !pointer.left => {
                intents.push(Intent::Box([*from, at], pointer.shift));
                self.put_away(pointer);
            }
            State::Roping { outline } => {
                if outline.last().is_none_or(|last| last.distance(at) > LASSO_STEP) {
                    outline.push(at);
                }
                if !pointer.left {
                    intents.push(Intent::Lasso(std::mem::take(outline), pointer.shift));
                    self.put_away(pointer);
                }
            }
            State::Orbiting if pressed && pointer.moved != Vec2::ZERO => {
                intents.push(Intent::Orbit(pointer.moved));
            }
            State::Panning if pressed && pointer.moved != Vec2::ZERO => {
                intents.push(Intent::Pan(pointer.moved));
            }
            State::Orbiting | State::Panning | State::Cancelled if !pressed => self.state = State::Idle,
            _ => {}
        }
        intents
    }

    fn begin_drag(
        &mut self,
        pointer: &Pointer,
        camera: &Camera,
        size: Vec2,
        [from, at]: [Vec2; 2],
        held: Option<(u32, Vec3)>,
        intents: &mut Vec<Intent>,
    ) {
        if let Some((particle, place)) = held.filter(|_| self.tool == Tool::Move) {
            let normal = camera.axes()[2];
            // From the place where the mouse went down, not from the particle: it must not jump to the cursor.
            let from = camera.ray(from, size).meet_plane(place, normal).unwrap_or(place);
            intents.push(Intent::Grab(particle));
            if let Some(to) = camera.ray(at, size).meet_plane(from, normal) {
                intents.push(Intent::Drag(to - from));
            }
            self.state = State::Holding { from, normal };
        } else {
            self.state = match self.tool {
                _ if pointer.ctrl => State::Roping { outline: vec![from, at] },
                Tool::Lasso => State::Roping { outline: vec![from, at] },
                Tool::Box => State::Framing { from },
                Tool::Move if pointer.shift => State::Framing { from },
                Tool::Move => {
                    intents.push(Intent::Orbit(at - from));
                    State::Orbiting
                }
            };
        }
    }

    /// An outline is complete.
    fn put_away(&mut self, pointer: &Pointer) {
        self.state = State::Idle;
        if !pointer.shift {
            self.tool = Tool::Move;
        }
    }

    fn escape(&mut self, intents: &mut Vec<Intent>) {
        match self.state {
            State::Idle => intents.push(Intent::Deselect),
            State::Holding { .. } => {
                intents.push(Intent::Cancel);
                self.state = State::Cancelled;
            }
            _ => self.state = State::Cancelled,
        }
    }

    /// The mouse is gone (window left, focus lost): what is held is let go, a half-drawn outline is forgotten.
    fn leave(&mut self, intents: &mut Vec<Intent>) {
        if self.are_holding() {
            intents.push(Intent::Release);
        }
        self.state = State::Idle;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Vec2 = Vec2::new(800.0, 600.0);

    /// Plays frames of the mouse over a world with particle 7 in the middle of the picture.
    fn play(hands: &mut Hands, frames: &[Pointer]) -> Vec<Intent> {
        let camera = Camera::default();
        let pick = |at: Vec2| (at.distance(SIZE / 2.0) < 8.0).then_some(7);
        frames
            .iter()
            .flat_map(|pointer| hands.update(pointer, &camera, SIZE, pick, |_| Some(Vec3::ZERO)))
            .collect()
    }

    fn mouse(x: f32, y: f32) -> Pointer {
        Pointer { at: Some(Vec2::new(x, y)), zoom: 1.0, ..Default::default() }
    }

    fn left(x: f32, y: f32) -> Pointer {
        Pointer { left: true, ..mouse(x, y) }
    }

    #[test]
    fn a_click_selects_and_shift_adds() {
        let click =
            play(&mut Hands::default(), &[left(400.0, 300.0), left(402.0, 301.0), mouse(402.0, 301.0)]);
        assert_eq!(click, [Intent::Click { particle: Some(7), add: false }]);
        let shift = Pointer { shift: true, ..mouse(10.0, 10.0) };
        let click = play(&mut Hands::default(), &[Pointer { left: true, ..shift }, shift]);
        assert_eq!(click, [Intent::Click { particle: None, add: true }]);
    }

    #[test]
    fn a_drag_grabs_moves_in_the_plane_and_releases() {
        let mut hands = Hands::default();
        let intents = play(&mut hands, &[left(400.0, 300.0), left(430.0, 300.0), left(460.0, 270.0)]);
        assert!(hands.are_holding());
        assert_eq!(intents[0], Intent::Grab(7));
        let camera = Camera::default();
        let [right, up, forward] = camera.axes();
        let Some(Intent::Drag(offset)) = intents.last() else { panic!("{intents:?}") };
        let metres_per_pixel = 2.0 * camera.half_height() / SIZE.y;
        assert!(offset.dot(forward).abs() < 1e-3);
        assert!((offset.dot(right) - 60.0 * metres_per_pixel).abs() < 1e-2);
        assert!((offset.dot(up) - 30.0 * metres_per_pixel).abs() < 1e-2);
        assert_eq!(play(&mut hands, &[mouse(460.0, 270.0)]), [Intent::Release]);
    }

    #[test]
    fn holding_still_keeps_holding() {
        let mut hands = Hands::default();
        play(&mut hands, &[left(400.0, 300.0), left(430.0, 300.0)]);
        let still = play(&mut hands, &[left(430.0, 300.0); 3]);
        assert!(still.iter().all(|intent| matches!(intent, Intent::Drag(_))) && still[0] == still[2]);
    }

    #[test]
    fn escape_cancels_a_drag_and_waits_for_the_button() {
        let mut hands = Hands::default();
        play(&mut hands, &[left(400.0, 300.0), left(430.0, 300.0)]);
        let escape = Pointer { escape: true, ..left(440.0, 300.0) };
        assert_eq!(play(&mut hands, &[escape, left(450.0, 300.0), mouse(450.0, 300.0)]), [Intent::Cancel]);
        assert_eq!(play(&mut hands, &[Pointer { escape: true, ..mouse(0.0, 0.0) }]), [Intent::Deselect]);
    }

    #[test]
    fn leaving_the_window_lets_go() {
        let mut hands = Hands::default();
        play(&mut hands, &[left(400.0, 300.0), left(430.0, 300.0)]);
        assert_eq!(play(&mut hands, &[Pointer::default()]), [Intent::Release]);
    }

    #[test]
    fn beside_the_particles_a_drag_orbits_frames_or_ropes() {
        let mut hands = Hands::default();
        let moved = Pointer { moved: Vec2::new(5.0, 0.0), ..left(45.0, 10.0) };
        let intents = play(&mut hands, &[left(10.0, 10.0), left(40.0, 10.0), moved, mouse(45.0, 10.0)]);
        assert_eq!(intents, [Intent::Orbit(Vec2::new(30.0, 0.0)), Intent::Orbit(Vec2::new(5.0, 0.0))]);
        let shift = |pointer| Pointer { shift: true, ..pointer };
        let framed = [shift(left(10.0, 10.0)), shift(left(50.0, 60.0)), shift(mouse(50.0, 60.0))];
        let intents = play(&mut Hands::default(), &framed);
        assert_eq!(intents, [Intent::Box([Vec2::splat(10.0), Vec2::new(50.0, 60.0)], true)]);
        let mut lasso = Hands { tool: Tool::Lasso, ..Default::default() };
        let intents =
            play(&mut lasso, &[left(10.0, 10.0), left(50.0, 10.0), left(50.0, 50.0), mouse(50.0, 50.0)]);
        assert!(matches!(&intents[..], [Intent::Lasso(outline, false)] if outline.len() == 3), "{intents:?}");
    }

    #[test]
    fn a_box_is_framed_over_particles_too_and_once() {
        let over = [left(400.0, 300.0), left(430.0, 330.0), mouse(430.0, 330.0)];
        let shift = over.map(|pointer| Pointer { shift: true, ..pointer });
        let mut hands = Hands { tool: Tool::Box, ..Default::default() };
        let framed = [Vec2::new(400.0, 300.0), Vec2::new(430.0, 330.0)];
        assert_eq!(play(&mut hands, &shift), [Intent::Box(framed, true)]);
        assert_eq!(play(&mut hands, &over), [Intent::Box(framed, false)]);
        assert_eq!(play(&mut hands, &over)[0], Intent::Grab(7));
    }

    #[test]
    fn the_other_buttons_and_the_wheel_move_the_camera() {
        let by = Vec2::new(3.0, 4.0);
        let middle = Pointer { middle: true, moved: by, ..mouse(400.0, 300.0) };
        assert_eq!(play(&mut Hands::default(), &[middle, middle]), [Intent::Pan(by)]);
        let right = Pointer { right: true, moved: by, ..mouse(400.0, 300.0) };
        assert_eq!(play(&mut Hands::default(), &[right, right]), [Intent::Orbit(by)]);
        let wheel = Pointer { zoom: 1.2, ..mouse(4.0, 3.0) };
        assert_eq!(play(&mut Hands::default(), &[wheel]), [Intent::Zoom(1.2, Vec2::new(4.0, 3.0))]);
    }
}
