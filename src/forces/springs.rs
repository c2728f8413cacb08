//! Springs with isotropic damping: F = k (|d| - L) d/|d| + k_d (v_j - v_i) on i from j, d = x_j - x_i.
//!
//! The damping is the thesis' law (eq. 2.4): along all directions, not only along the spring, so that it brakes rigid
//! rotation too. Where |d| = 0 the spring has no direction and exerts no force.

use crate::math::Real;
use crate::math::lanes::Lanes;
use crate::model::KindSettings;

crate::params! {
    /// One kind of springs.
    pub struct Kind {
        /// Whether springs of this kind act.
        enabled: bool = true;
        /// Stiffness k: force per elongation.
        stiffness: f64 = 1000.0, unit "N/m", range 0.0..=1e12, slider log 0.01..=1e6;
        /// Rest length = length in the imported or generated shape x this.
        rest_scale: f64 = 1.0, range 0.0..=1000.0, slider linear 0.0..=2.0;
    }
}

crate::params! {
    /// The springs of the cloth, by kind (Provot, "Deformation constraints in a mass-spring model to describe rigid
    /// cloth behavior", 1995).
    pub struct SpringParams {
        /// Along the edges of the faces.
        stretch: Kind = Kind::default();
        /// Along both diagonals of every quad.
        shear: Kind = Kind { stiffness: 300.0, ..Kind::default() };
        /// Straight across every regular vertex.
        bend: Kind = Kind { stiffness: 100.0, ..Kind::default() };
        /// Damping k_d of every spring: F = k_d (v_j - v_i) on i.
        damping: f64 = 2.0, unit "kg/s", range 0.0..=1e9, slider log 0.0..=100.0;
    }
}

impl SpringParams {
    /// The kinds in the order in which springs are stored.
    pub fn kinds(&self) -> [KindSettings; 3] {
        [&self.stretch, &self.shear, &self.bend].map(|kind| KindSettings {
            enabled: kind.enabled,
            stiffness: kind.stiffness,
            rest_scale: kind.rest_scale,
        })
    }
}

/// The forces on eight particles at x with velocities v from others at x' with v', by component, and how much longer their springs are
/// than at rest.
#[expect(clippy::inline_always, reason = "a kernel's")]
#[inline(always)]
pub fn pull<L: Lanes, const DAMPED: bool>(
    [x, there]: [[L; 3]; 2],
    [v, speed]: [[L; 3]; 2],
    stiffness: L,
    rest: L,
    damping: L,
) -> ([L; 3], L) {
    let [dx, dy, dz] = [there[0] - x[0], there[1] - x[1], there[2] - x[2]];
    let length = (dx * dx + dy * dy + dz * dz).sqrt();
    let elongation = length - rest;
    let tension = (stiffness * elongation / length).where_positive(length);
    let force = if DAMPED {
        [
            dx * tension + (speed[0] - v[0]) * damping,
            dy * tension + (speed[1] - v[1]) * damping,
            dz * tension + (speed[2] - v[2]) * damping,
        ]
    } else {
        [dx * tension, dy * tension, dz * tension]
    };
    (force, elongation)
}

/// How eight springs resist a change of the way d from x to x', by component: K = a I + u uᵀ, given as a and u.
///
/// With n = d/|d| and rest length L, K = k n nᵀ + k max(0, 1 - L/|d|) (I - n nᵀ). A compressed spring pushes its ends sideways;
/// leaving that out keeps K positive semidefinite (Choi and Ko, "Stable but responsive cloth", 2002). Without a direction there is
/// no force, and no stiffness unless L is 0: then K = k I.
#[expect(clippy::inline_always, reason = "a kernel's")]
#[inline(always)]
pub fn resistance<L: Lanes>(with: L::Proof, [x, there]: [[L; 3]; 2], stiffness: L, rest: L) -> [L; 4] {
    let [zero, one] = [L::splat(with, Real::ZERO), L::splat(with, Real::ONE)];
    let [dx, dy, dz] = [there[0] - x[0], there[1] - x[1], there[2] - x[2]];
    let length = (dx * dx + dy * dy + dz * dz).sqrt();
    let without_length = one - one.where_positive(length);
    let without_rest = one - one.where_positive(rest);
    let stretched = ((length - rest) / length).where_positive(length).max(zero);
    let across = stiffness * (stretched + without_length * without_rest);
    let along = (stiffness - across).max(zero).sqrt();
    let part = (along / length).where_positive(length);
    [across, dx * part, dy * part, dz * part]
}
