//! Advancing all particles by forces and velocities: the updates of the explicit Euler family, eight particles at once.

use crate::forces::Problem;
use crate::math::Real;
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::parts::Parts;
use crate::model::Particles;

/// v += dt f / m, then x += dt v with the new velocity.
pub(super) fn kick_and_drift<T: Real>(
    problem: &Problem<T>,
    state: &mut Particles<T>,
    force: &[T::Vec3],
    dt: T,
) {
    advance::<T, true>(problem, state, force, dt);
}

/// x += dt v with the old velocity, then v += dt f / m.
pub(super) fn drift_and_kick<T: Real>(
    problem: &Problem<T>,
    state: &mut Particles<T>,
    force: &[T::Vec3],
    dt: T,
) {
    advance::<T, false>(problem, state, force, dt);
}

fn advance<T: Real, const KICK_FIRST: bool>(
    problem: &Problem<T>,
    state: &mut Particles<T>,
    force: &[T::Vec3],
    dt: T,
) {
    let Particles { positions, velocities, .. } = state;
    let inverse_mass = &problem.inverse_mass;
    let kernel = Advance::<T, KICK_FIRST> { positions, velocities, force, inverse_mass, dt };
    lanes::share(kernel, LANES, problem.useful_threads());
}

struct Advance<'a, T: Real, const KICK_FIRST: bool> {
    positions: &'a mut [T::Vec3],
    velocities: &'a mut [T::Vec3],
    force: &'a [T::Vec3],
    inverse_mass: &'a [T],
    dt: T,
}

impl<T: Real, const KICK_FIRST: bool> Parts for Advance<'_, T, KICK_FIRST> {
    fn count(&self) -> usize {
        self.force.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { positions, velocities, force, inverse_mass, dt } = self;
        let (positions, more_positions) = positions.split_at_mut(at);
        let (velocities, more_velocities) = velocities.split_at_mut(at);
        let (force, more_force) = force.split_at(at);
        let (inverse_mass, more_mass) = inverse_mass.split_at(at);
        (
            Self { positions, velocities, force, inverse_mass, dt },
            Self {
                positions: more_positions,
                velocities: more_velocities,
                force: more_force,
                inverse_mass: more_mass,
                dt,
            },
        )
    }
}

impl<T: Real, const KICK_FIRST: bool> Kernel<T> for Advance<'_, T, KICK_FIRST> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "a kernel")]
    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { positions, velocities, force, inverse_mass, dt } = self;
        let step = L::splat(with, dt);
        let (positions, last_positions) = positions.as_chunks_mut::<LANES>();
        let (velocities, last_velocities) = velocities.as_chunks_mut::<LANES>();
        let (force, last_force) = force.as_chunks::<LANES>();
        let (inverse_mass, last_inverse_mass) = inverse_mass.as_chunks::<LANES>();
        let particles = positions.iter_mut().zip(velocities);
        for ((positions, velocities), (force, w)) in particles.zip(force.iter().zip(inverse_mass)) {
            let (x, v, f) =
                (L::vectors(with, positions), L::vectors(with, velocities), L::vectors(with, force));
            let push = L::of(with, *w) * step;
            let kicked = [v[0] + f[0] * push, v[1] + f[1] * push, v[2] + f[2] * push];
            let way = if KICK_FIRST { kicked } else { v };
            let drifted = [x[0] + way[0] * step, x[1] + way[1] * step, x[2] + way[2] * step];
            L::put_vectors(drifted, positions);
            L::put_vectors(kicked, velocities);
        }
        let particles = last_positions.iter_mut().zip(last_velocities);
        for ((x, v), (&f, &w)) in particles.zip(last_force.iter().zip(last_inverse_mass)) {
            let before = *v;
            *v += f * (w * dt);
            *x += if KICK_FIRST { *v } else { before } * dt;
        }
    }
}
