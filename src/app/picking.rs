//! Which particles are under the cursor, in a box, or inside a lasso.
//!
//! On the CPU, not by an id buffer on the device: the answer is exact and there at once (no read-back a frame later), it serves without
//! a device, and one pass over a million particles on a click takes milliseconds.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::camera::{Camera, Projected};

/// What can be picked, and what hides it.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Particle positions, m.
    pub positions: &'a [[f32; 3]],
    /// The surface that hides what is behind it; empty if it is not shown or if one may pick through it.
    pub triangles: &'a [[u32; 3]],
}

/// More candidates than these are never tried: the nearest to the cursor come first, and one of them is visible or the cursor
/// is on a pile of particles smaller than a pixel.
const CANDIDATES: usize = 64;
/// A surface must be nearer by this part of the distance to hide a particle: its own neighbourhood does not, seen at a slant.
const HIDING_MARGIN: f32 = 1e-3;

/// The visible particle nearest to the cursor, at most `tolerance` pixels away; of equals the one nearest to the eye. In the
/// middle of a large face, farther from each of its corners, it is the nearest of these.
pub fn nearest(
    target: &Target<'_>,
    camera: &Camera,
    size: Vec2,
    cursor: Vec2,
    tolerance: f32,
) -> Option<u32> {
    let projector = camera.projector(size);
    let mut candidates: Vec<Candidate> = target
        .positions
        .par_iter()
        .enumerate()
        .filter_map(|(i, &position)| {
            let Projected { pixel, depth } = projector.pixel(Vec3::from(position))?;
            let away = pixel.distance(cursor);
            (away <= tolerance).then_some(Candidate { particle: i as u32, pixel, away, depth, hidden: false })
        })
        .collect();
    candidates.sort_by(|a, b| {
        a.away.total_cmp(&b.away).then(a.depth.total_cmp(&b.depth)).then(a.particle.cmp(&b.particle))
    });
    candidates.truncate(CANDIDATES);
    if !candidates.is_empty() {
        hide(&mut candidates, target, camera, size, cursor, tolerance);
    }
    let visible = candidates.iter().find(|candidate| !candidate.hidden).map(|candidate| candidate.particle);
    visible.or_else(|| corner_under(target, camera, size, cursor))
}

/// The corner nearest to the cursor of the face under it.
fn corner_under(target: &Target<'_>, camera: &Camera, size: Vec2, cursor: Vec2) -> Option<u32> {
    let ray = camera.ray(cursor, size);
    let place = |i: u32| Vec3::from(target.positions[i as usize]);
    let under = target.triangles.par_iter().filter_map(|triangle| {
        let distance = hit(ray.origin, ray.direction, triangle.map(place))?;
        Some((distance, *triangle))
    });
    let (_, face) = under.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let projector = camera.projector(size);
    let away = |i: &u32| projector.pixel(place(*i)).map_or(f32::INFINITY, |p| p.pixel.distance(cursor));
    face.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))
}

struct Candidate {
    particle: u32,
    pixel: Vec2,
    away: f32,
    depth: f32,
    hidden: bool,
}

/// Marks the candidates that lie behind a triangle.
fn hide(
    candidates: &mut [Candidate],
    target: &Target<'_>,
    camera: &Camera,
    size: Vec2,
    cursor: Vec2,
    tolerance: f32,
) {
    let positions = target.positions;
    // The pyramid (or box) through the cursor's square, as four planes: what lies outside of one of them hides nothing.
    let planes = frustum(camera, size, cursor, tolerance + 1.0);
    let near: Vec<[u32; 3]> = target
        .triangles
        .par_iter()
        .filter(|triangle| {
            let corners = triangle.map(|i| Vec3::from(positions[i as usize]));
            planes.iter().all(|&(normal, offset)| corners.iter().any(|c| normal.dot(*c) >= offset))
        })
        .copied()
        .collect();
    for candidate in candidates {
        let point = Vec3::from(positions[candidate.particle as usize]);
        let ray = camera.ray(candidate.pixel, size);
        let reach = (point - ray.origin).dot(ray.direction) * (1.0 - HIDING_MARGIN);
        candidate.hidden = near.iter().any(|triangle| {
            !triangle.contains(&candidate.particle)
                && hit(ray.origin, ray.direction, triangle.map(|i| Vec3::from(positions[i as usize])))
                    .is_some_and(|distance| distance < reach)
        });
    }
}

/// Inward planes (normal, offset) around the square of `radius` pixels about the cursor.
fn frustum(camera: &Camera, size: Vec2, cursor: Vec2, radius: f32) -> [(Vec3, f32); 4] {
    let corner = |x: f32, y: f32| camera.ray(cursor + Vec2::new(x, y) * radius, size);
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let middle = camera.ray(cursor, size);
    let inside = middle.origin + middle.direction * camera.distance;
    std::array::from_fn(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let along = b.origin + b.direction * camera.distance - a.origin;
        let normal = a.direction.cross(along);
        let offset = normal.dot(a.origin);
        if normal.dot(inside) >= offset { (normal, offset) } else { (-normal, -offset) }
    })
}

/// Distance along the ray to a triangle's inside, from either side, in front of the origin (Möller and Trumbore, 1997).
fn hit(origin: Vec3, direction: Vec3, [a, b, c]: [Vec3; 3]) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from_a = origin - a;
    let u = from_a.dot(p) / determinant;
    let q = from_a.cross(ab);
    let v = direction.dot(q) / determinant;
    let distance = ac.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

/// All particles whose picture lies in the rectangle between two corners, also those behind the surface: a box takes what it frames.
pub fn in_box(positions: &[[f32; 3]], camera: &Camera, size: Vec2, [a, b]: [Vec2; 2]) -> Vec<u32> {
    let (low, high) = (a.min(b), a.max(b));
    within(positions, camera, size, |pixel| pixel.cmpge(low).all() && pixel.cmple(high).all())
}

/// All particles whose picture lies inside the closed outline, by the even-odd rule, also those behind the surface.
pub fn in_lasso(positions: &[[f32; 3]], camera: &Camera, size: Vec2, outline: &[Vec2]) -> Vec<u32> {
    let low = outline.iter().copied().fold(Vec2::INFINITY, Vec2::min);
    let high = outline.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max);
    within(positions, camera, size, |pixel| {
        pixel.cmpge(low).all() && pixel.cmple(high).all() && inside(outline, pixel)
    })
}

fn within(
    positions: &[[f32; 3]],
    camera: &Camera,
    size: Vec2,
    contains: impl Fn(Vec2) -> bool + Sync,
) -> Vec<u32> {
    let projector = camera.projector(size);
    positions
        .par_iter()
        .enumerate()
        .filter(|&(_, &position)| projector.pixel(Vec3::from(position)).is_some_and(|p| contains(p.pixel)))
        .map(|(i, _)| i as u32)
        .collect()
}

/// Even-odd rule: a ray to the right crosses the outline an odd number of times.
fn inside(outline: &[Vec2], point: Vec2) -> bool {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).fold(false, |inside, (a, b)| {
        let crosses =
            (a.y > point.y) != (b.y > point.y) && point.x < (b.x - a.x) * (point.y - a.y) / (b.y - a.y) + a.x;
        inside ^ crosses
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::camera::{Projection, Side};

    const SIZE: Vec2 = Vec2::new(800.0, 600.0);

    fn cameras() -> [Camera; 3] {
        let mut front = Camera::default();
        front.look_from(Side::Front);
        [Camera::default(), Camera { projection: Projection::Orthographic, ..Camera::default() }, front]
    }

    /// Two parallel sheets of n x n particles that face +z, the second 4 m behind the first.
    fn sheets(n: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for layer in 0..2 {
            for r in 0..n {
                for c in 0..n {
                    let half = (n - 1) as f32 / 2.0;
                    // Shifted by a third of a cell, so that the back's particles are not behind the front's.
                    let x = c as f32 - half + layer as f32 * 0.33;
                    positions.push([x, half - r as f32 + layer as f32 * 0.33, -4.0 * layer as f32]);
                    if r + 1 < n && c + 1 < n {
                        let a = layer * n * n + r * n + c;
                        triangles.push([a, a + n, a + n + 1]);
                        triangles.push([a, a + n + 1, a + 1]);
                    }
                }
            }
        }
        (positions, triangles)
    }

    fn pixel(camera: &Camera, p: [f32; 3]) -> Vec2 {
        camera.projector(SIZE).pixel(Vec3::from(p)).expect("in front of the eye").pixel
    }

    #[test]
    fn the_nearest_particle_within_the_tolerance_is_picked() {
        let (positions, triangles) = sheets(9);
        let target = Target { positions: &positions, triangles: &triangles };
        for camera in cameras() {
            for i in [0, 40, 80] {
                let cursor = pixel(&camera, positions[i]) + Vec2::new(3.0, -2.0);
                assert_eq!(nearest(&target, &camera, SIZE, cursor, 8.0), Some(i as u32), "{camera:?}");
            }
            assert_eq!(nearest(&target, &camera, SIZE, Vec2::new(5.0, 5.0), 8.0), None);
        }
    }

    #[test]
    fn a_face_under_the_cursor_gives_its_nearest_corner() {
        let (positions, triangles) = sheets(9);
        let target = Target { positions: &positions, triangles: &triangles };
        for camera in cameras() {
            let [a, b] = [40, 50].map(|i: usize| pixel(&camera, positions[i]));
            // On the diagonal of a quad, nearer to its first corner.
            assert_eq!(nearest(&target, &camera, SIZE, a.lerp(b, 0.2), 1.0), Some(40));
            assert_eq!(nearest(&target, &camera, SIZE, a.lerp(b, 0.8), 1.0), Some(50));
        }
    }

    #[test]
    fn nothing_is_picked_through_the_cloth_unless_asked() {
        let (positions, triangles) = sheets(9);
        let back = 81 + 40;
        for camera in cameras() {
            let cursor = pixel(&camera, positions[back]);
            let visible = Target { positions: &positions, triangles: &triangles };
            assert_ne!(nearest(&visible, &camera, SIZE, cursor, 3.0), Some(back as u32));
            let through = Target { positions: &positions, triangles: &[] };
            assert_eq!(nearest(&through, &camera, SIZE, cursor, 3.0), Some(back as u32));
        }
    }

    #[test]
    fn the_back_is_picked_from_behind() {
        let (positions, triangles) = sheets(9);
        let mut camera = Camera::default();
        camera.look_from(Side::Back);
        let target = Target { positions: &positions, triangles: &triangles };
        for i in [81 + 40, 81 + 12] {
            let cursor = pixel(&camera, positions[i]);
            assert_eq!(nearest(&target, &camera, SIZE, cursor, 3.0), Some(i as u32));
        }
    }

    #[test]
    fn a_sheet_seen_at_a_slant_does_not_hide_itself() {
        let (positions, triangles) = sheets(9);
        let camera = Camera { yaw: 1.45, ..Camera::default() };
        let front = Target { positions: &positions[..81], triangles: &triangles[..128] };
        for i in 0..81_u32 {
            let cursor = pixel(&camera, positions[i as usize]);
            assert_eq!(nearest(&front, &camera, SIZE, cursor, 2.0), Some(i));
        }
    }

    #[test]
    fn a_particle_that_is_not_finite_is_never_picked() {
        let positions = [[f32::NAN, 0.0, 0.0], [0.0, 0.0, f32::INFINITY]];
        let target = Target { positions: &positions, triangles: &[] };
        assert_eq!(nearest(&target, &Camera::default(), SIZE, SIZE / 2.0, 1e6), None);
    }

    #[test]
    fn a_box_takes_what_it_frames_whichever_way_it_is_drawn() {
        let (positions, _) = sheets(3);
        for camera in cameras() {
            let corner = pixel(&camera, positions[4]);
            let (low, high) = (corner - Vec2::splat(2.0), corner + Vec2::splat(2.0));
            assert_eq!(in_box(&positions[..9], &camera, SIZE, [low, high]), [4]);
            assert_eq!(in_box(&positions[..9], &camera, SIZE, [high, low]), [4]);
            assert_eq!(in_box(&positions, &camera, SIZE, [Vec2::ZERO, SIZE]).len(), 18);
        }
    }

    #[test]
    fn a_lasso_takes_what_is_inside_its_outline() {
        let triangle = [Vec2::new(0.0, 0.0), Vec2::new(10.0, 0.0), Vec2::new(0.0, 10.0)];
        assert!(inside(&triangle, Vec2::new(2.0, 2.0)));
        assert!(!inside(&triangle, Vec2::new(8.0, 8.0)));
        assert!(!inside(&[], Vec2::ZERO));
        let (positions, _) = sheets(3);
        let camera = Camera::default();
        let around = |i: usize| {
            let p = pixel(&camera, positions[i]);
            [(-4.0, -4.0), (4.0, -4.0), (0.0, 5.0)].map(|(x, y)| p + Vec2::new(x, y))
        };
        assert_eq!(in_lasso(&positions[..9], &camera, SIZE, &around(5)), [5]);
        assert_eq!(in_lasso(&positions[..9], &camera, SIZE, &[]), Vec::<u32>::new());
    }
}
