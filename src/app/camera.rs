//! The camera: orbits a target point, in perspective or orthographic projection, and turns pixels into rays.
//!
//! World: right-handed, y up, metres. Screen: x right, y down, pixels, origin at the viewport's top left corner.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Mat4, Vec2, Vec3, camera::rh};
use serde::{Deserialize, Serialize};

/// An axis-aligned box, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest corner.
    pub min: Vec3,
    /// Highest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The box around the finite positions; `None` if there are none.
    pub fn of<'a>(positions: impl IntoIterator<Item = &'a [f32; 3]>) -> Option<Self> {
        positions.into_iter().map(|&p| Vec3::from(p)).filter(|p| p.is_finite()).fold(None, |bounds, p| {
            Some(
                bounds
                    .map_or(Self { min: p, max: p }, |b: Self| Self { min: b.min.min(p), max: b.max.max(p) }),
            )
        })
    }

    /// The middle.
    pub fn centre(&self) -> Vec3 {
        self.min.midpoint(self.max)
    }

    /// The box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The box around points on their ways from this box to the other, which have come so far (0 to 1).
    #[must_use]
    pub fn towards(&self, other: &Self, part: f32) -> Self {
        Self { min: self.min.lerp(other.min, part), max: self.max.lerp(other.max, part) }
    }

    /// Half of the diagonal, m.
    pub fn radius(&self) -> f32 {
        self.min.distance(self.max) / 2.0
    }

    fn corners(&self) -> impl Iterator<Item = Vec3> + Clone + '_ {
        (0..8).map(|i| {
            let pick = |bit: u32, min: f32, max: f32| if i & bit == 0 { min } else { max };
            Vec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            )
        })
    }
}

/// A half line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, m.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
}

impl Ray {
    /// Where the ray's line meets the plane through `point` with the given normal; `None` if they are parallel.
    pub fn meet_plane(&self, point: Vec3, normal: Vec3) -> Option<Vec3> {
        let slope = self.direction.dot(normal);
        (slope.abs() > 1e-6)
            .then(|| self.origin + self.direction * ((point - self.origin).dot(normal) / slope))
    }
}

/// How depth becomes size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Projection {
    /// Far is small.
    #[default]
    Perspective,
    /// Parallel lines stay parallel.
    Orthographic,
}

/// The named directions to look from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Along -z.
    Front,
    /// Along +z.
    Back,
    /// Along +x.
    Left,
    /// Along -x.
    Right,
    /// Along -y.
    Top,
}

/// Where one looks from, and how.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// The point that the camera turns about, m.
    pub target: Vec3,
    /// From the target to the eye, m.
    pub distance: f32,
    /// Turn about the y axis, rad; 0 looks along -z.
    pub yaw: f32,
    /// Height above the horizon, rad, within a right angle.
    pub pitch: f32,
    /// Vertical opening angle, rad.
    pub fov: f32,
    /// Perspective or orthographic; both show the target's surroundings at the same size.
    pub projection: Projection,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            target: Vec3::ZERO,
            distance: 40.0,
            yaw: 0.6,
            pitch: 0.42,
            fov: 35_f32.to_radians(),
            projection: Projection::Perspective,
        }
    }
}

/// Straight down would leave "right" undefined if it were computed from the view direction alone; yaw defines it here.
const STEEPEST: f32 = FRAC_PI_2;

impl Camera {
    /// Unit vectors to the right, up, and forwards.
    pub fn axes(&self) -> [Vec3; 3] {
        let (sin_yaw, cos_yaw) = self.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        let right = Vec3::new(cos_yaw, 0.0, -sin_yaw);
        let back = Vec3::new(sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch);
        [right, back.cross(right), -back]
    }

    /// Where the eye is, m.
    pub fn eye(&self) -> Vec3 {
        self.target - self.axes()[2] * self.distance
    }

    /// Half of the visible height at the target, m.
    pub fn half_height(&self) -> f32 {
        self.distance * (self.fov / 2.0).tan()
    }

    /// From world to clip space, for a viewport of the given width / height. Depth is reversed: 1 near, 0 far.
    pub fn clip_from_world(&self, aspect: f32) -> Mat4 {
        let [_, up, forward] = self.axes();
        let eye = self.eye();
        let view = rh::view::look_at_mat4(eye, eye + forward, up);
        let projection = match self.projection {
            Projection::Perspective => {
                rh::proj::directx::perspective_infinite_reverse(self.fov, aspect, self.near())
            }
            Projection::Orthographic => {
                let half = self.half_height();
                // Near and far swapped reverse the depth; the eye may stand inside of the cloth, so it shows what is behind too.
                let reach = self.distance * 50.0;
                rh::proj::directx::orthographic(-half * aspect, half * aspect, -half, half, reach, -reach)
            }
        };
        projection * view
    }

    fn near(&self) -> f32 {
        (self.distance * 1e-3).max(1e-4)
    }

    /// The ray through a pixel of a viewport of `size` pixels.
    pub fn ray(&self, pixel: Vec2, size: Vec2) -> Ray {
        let [right, up, forward] = self.axes();
        let ndc = (pixel / size * 2.0 - Vec2::ONE) * Vec2::new(1.0, -1.0);
        let half = Vec2::new(size.x / size.y, 1.0);
        let offset = |scale: f32| right * (ndc.x * half.x * scale) + up * (ndc.y * half.y * scale);
        match self.projection {
            Projection::Perspective => {
                Ray { origin: self.eye(), direction: (forward + offset((self.fov / 2.0).tan())).normalize() }
            }
            Projection::Orthographic => {
                Ray { origin: self.eye() + offset(self.half_height()), direction: forward }
            }
        }
    }

    /// Maps points onto the screen of a viewport of `size` pixels.
    pub fn projector(&self, size: Vec2) -> Projector {
        Projector {
            clip_from_world: self.clip_from_world(size.x / size.y),
            size,
            eye: self.eye(),
            forward: self.axes()[2],
        }
    }

    /// Turns about the target by a drag of the mouse; a drag across the viewport's height is half a turn.
    pub fn orbit(&mut self, drag: Vec2, size: Vec2) {
        let angle = drag * (PI / size.y.max(1.0));
        self.yaw = (self.yaw - angle.x).rem_euclid(TAU);
        self.pitch = (self.pitch + angle.y).clamp(-STEEPEST, STEEPEST);
    }

    /// Moves sideways so that the target's plane follows the mouse.
    pub fn pan(&mut self, drag: Vec2, size: Vec2) {
        let [right, up, _] = self.axes();
        let metres = drag * (2.0 * self.half_height() / size.y.max(1.0));
        self.target += up * metres.y - right * metres.x;
    }

    /// Comes nearer (`factor` < 1) or goes away, keeping the point of the target's plane under `pixel` where it is.
    pub fn zoom(&mut self, factor: f32, pixel: Vec2, size: Vec2) {
        let factor = factor.clamp(0.05, 20.0);
        let distance = (self.distance * factor).clamp(1e-3, 1e6);
        let factor = distance / self.distance;
        if let Some(fixed) = self.ray(pixel, size).meet_plane(self.target, self.axes()[2]) {
            self.target = fixed + (self.target - fixed) * factor;
        }
        self.distance = distance;
    }

    /// Looks at the whole box, keeping the direction, with a little room around it.
    pub fn focus(&mut self, bounds: &Bounds, size: Vec2) {
        self.focus_on(&bounds.corners(), bounds, size);
    }

    /// Looks at points whose box is known, keeping the direction, with a little room around them.
    pub fn focus_on(&mut self, points: &(impl Iterator<Item = Vec3> + Clone), bounds: &Bounds, size: Vec2) {
        const ROOM: f32 = 1.12;
        let [right, up, forward] = self.axes();
        let tan = (self.fov / 2.0).tan();
        let aspect = size.x / size.y.max(1.0);
        self.target = bounds.centre();
        let radius = bounds.radius().max(1e-3);
        // Twice: the middle of the points on the screen is not that of their box, seen in perspective.
        for _ in 0..2 {
            let distance = points.clone().fold(0.0, |most: f32, point| {
                let arm = point - self.target;
                let depth = if self.projection == Projection::Perspective { arm.dot(forward) } else { 0.0 };
                let across = (arm.dot(right).abs() / (tan * aspect)).max(arm.dot(up).abs() / tan);
                most.max(across - depth)
            });
            self.distance = (distance * ROOM).max(radius * 0.1);
            let projector = self.projector(size);
            let (low, high) = points
                .clone()
                .filter_map(|point| projector.pixel(point))
                .fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(l, h), p| (l.min(p.pixel), h.max(p.pixel)));
            if low.is_finite() && high.is_finite() {
                self.pan(size / 2.0 - low.midpoint(high), size);
            }
        }
    }

    /// Between perspective and orthographic.
    pub fn switch_projection(&mut self) {
        self.projection = match self.projection {
            Projection::Perspective => Projection::Orthographic,
            Projection::Orthographic => Projection::Perspective,
        };
    }

    /// Looks from a named side, in orthographic projection.
    pub fn look_from(&mut self, side: Side) {
        (self.yaw, self.pitch) = match side {
            Side::Front => (0.0, 0.0),
            Side::Back => (PI, 0.0),
            Side::Left => (-FRAC_PI_2, 0.0),
            Side::Right => (FRAC_PI_2, 0.0),
            Side::Top => (0.0, FRAC_PI_2),
        };
        self.projection = Projection::Orthographic;
    }
}

/// A point on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Pixels from the viewport's top left corner.
    pub pixel: Vec2,
    /// Distance along the view direction, m.
    pub depth: f32,
}

/// Maps world points to pixels; made once for many points.
#[derive(Clone, Copy, Debug)]
pub struct Projector {
    clip_from_world: Mat4,
    size: Vec2,
    eye: Vec3,
    forward: Vec3,
}

impl Projector {
    /// Where a point appears; `None` if it is behind the eye or not finite.
    pub fn pixel(&self, point: Vec3) -> Option<Projected> {
        let clip = self.clip_from_world * point.extend(1.0);
        if !(clip.w > 0.0 && clip.is_finite()) {
            return None;
        }
        let ndc = Vec2::new(clip.x, clip.y) / clip.w;
        let pixel = (ndc * Vec2::new(0.5, -0.5) + Vec2::splat(0.5)) * self.size;
        Some(Projected { pixel, depth: (point - self.eye).dot(self.forward) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Vec2 = Vec2::new(800.0, 500.0);

    fn cameras() -> Vec<Camera> {
        let mut cameras = Vec::new();
        for projection in [Projection::Perspective, Projection::Orthographic] {
            for (yaw, pitch) in [(0.0, 0.0), (0.7, 0.4), (3.0, -1.2), (1.0, FRAC_PI_2)] {
                cameras.push(Camera {
                    yaw,
                    pitch,
                    projection,
                    target: Vec3::new(1.0, 2.0, -3.0),
                    ..Default::default()
                });
            }
        }
        cameras
    }

    #[test]
    fn the_axes_are_orthonormal_and_right_handed() {
        for camera in cameras() {
            let [right, up, forward] = camera.axes();
            assert!(right.cross(up).distance(-forward) < 1e-6);
            assert!((right.length() - 1.0).abs() < 1e-6 && (up.length() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_ray_through_a_projected_point_meets_the_point() {
        for camera in cameras() {
            let point = camera.target + Vec3::new(2.0, -1.0, 3.0);
            let seen = camera.projector(SIZE).pixel(point).expect("in front of the eye");
            let ray = camera.ray(seen.pixel, SIZE);
            let along = (point - ray.origin).dot(ray.direction);
            assert!(ray.origin.distance(point - ray.direction * along) < 1e-3, "{camera:?}");
        }
    }

    #[test]
    fn depth_is_reversed() {
        for camera in cameras() {
            let clip = camera.clip_from_world(1.6);
            let [_, _, forward] = camera.axes();
            let depth = |p: Vec3| {
                let c = clip * p.extend(1.0);
                c.z / c.w
            };
            let near = depth(camera.target - forward);
            let far = depth(camera.target + forward);
            assert!(1.0 >= near && near > far && far >= 0.0, "{near} {far}");
        }
    }

    #[test]
    fn panning_takes_the_target_along_with_the_mouse() {
        for mut camera in cameras() {
            let fixed = camera.target;
            camera.pan(Vec2::new(30.0, -20.0), SIZE);
            let seen = camera.projector(SIZE).pixel(fixed).expect("visible").pixel;
            assert!(seen.distance(SIZE / 2.0 + Vec2::new(30.0, -20.0)) < 0.05, "{seen}");
        }
    }

    #[test]
    fn zooming_keeps_what_is_under_the_cursor() {
        for mut camera in cameras() {
            let cursor = Vec2::new(600.0, 100.0);
            let fixed = camera
                .ray(cursor, SIZE)
                .meet_plane(camera.target, camera.axes()[2])
                .expect("faces the camera");
            camera.zoom(0.5, cursor, SIZE);
            assert!((camera.distance - 20.0).abs() < 1e-4);
            assert!(camera.projector(SIZE).pixel(fixed).expect("visible").pixel.distance(cursor) < 0.05);
        }
    }

    #[test]
    fn focus_shows_the_whole_box_large_and_in_the_middle() {
        let bounds = Bounds { min: Vec3::new(-12.0, -3.0, -12.0), max: Vec3::new(12.0, 5.0, 12.0) };
        for mut camera in cameras() {
            camera.focus(&bounds, SIZE);
            let projector = camera.projector(SIZE);
            let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
            for corner in bounds.corners() {
                let seen = projector.pixel(corner).expect("in front of the eye").pixel;
                assert!(seen.cmpge(Vec2::ZERO).all() && seen.cmple(SIZE).all(), "{camera:?}: {seen}");
                (low, high) = (low.min(seen), high.max(seen));
            }
            let filled = ((high - low) / SIZE).max_element();
            assert!(filled > 0.6, "{camera:?} fills {filled}");
            assert!(low.midpoint(high).distance(SIZE / 2.0) < 40.0, "{camera:?}: {low} {high}");
        }
    }

    #[test]
    fn a_point_behind_the_eye_is_not_on_the_screen() {
        let camera = Camera::default();
        let behind = camera.eye() - camera.axes()[2];
        assert_eq!(camera.projector(SIZE).pixel(behind), None);
        assert_eq!(camera.projector(SIZE).pixel(Vec3::NAN), None);
    }
}
