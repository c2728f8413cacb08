//! The springs made linear: products with the stiffness and damping of an implicit step, at the speed of a force pass.
//!
//! To the matrix of a step h a spring of stiffness K (see [`resistance`]) adds h² K + h k_d I = a I + u uᵀ. These are four numbers,
//! fewer than the six of a symmetric block, and a product takes no more operations.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::pass::{Eight, Eights, Field, Fields, Law, Sums, Vectors};
use super::{BLOCK, Means, Slices, end_before};
use crate::forces::springs::resistance;
use crate::math::Real;
use crate::math::lanes::{self, Kernel, LANES, Lanes, eight_of};
use crate::math::parts::Parts;
use crate::model::Springs;

/// The four numbers of eight springs: a, kg, and u, √kg, by component.
type Four<T> = [[T; LANES]; 4];

/// h² K + h k_d I of every spring.
#[derive(Clone, Debug)]
pub struct Linear<T> {
    rows: Vec<Four<T>>,
    loose: Vec<Four<T>>,
}

impl<T> Default for Linear<T> {
    fn default() -> Self {
        Self { rows: Vec::new(), loose: Vec::new() }
    }
}

/// A step that springs are made linear for.
#[derive(Clone, Copy)]
pub struct Step<'a, T: Real> {
    pub springs: &'a Springs<T>,
    /// k_d, kg/s.
    pub damping: T,
    /// m.
    pub positions: &'a [T::Vec3],
    /// s.
    pub h: T,
}

/// The springs of some blocks of particles.
struct Linearise<'a, T: Real> {
    slices: &'a Slices<T>,
    step: Step<'a, T>,
    blocks: std::ops::Range<usize>,
    rows: &'a mut [Four<T>],
    loose: &'a mut [Four<T>],
}

impl<T: Real> Linearise<'_, T> {
    /// The numbers of the first row and of the first list that begin in a block or later.
    fn begins(slices: &Slices<T>, block: usize) -> [usize; 2] {
        let list = block * (BLOCK / LANES) * slices.groups;
        [
            end_before(&slices.row_ends, block * slices.groups),
            if slices.list_ends.is_empty() { 0 } else { end_before(&slices.list_ends, list) },
        ]
    }
}

impl<T: Real> Parts for Linearise<'_, T> {
    fn count(&self) -> usize {
        self.blocks.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { slices, step, blocks, rows, loose } = self;
        let middle = blocks.start + at;
        let (begin, end) = (Self::begins(slices, blocks.start), Self::begins(slices, middle));
        let (rows, more_rows) = rows.split_at_mut(end[0] - begin[0]);
        let (loose, more_loose) = loose.split_at_mut(end[1] - begin[1]);
        (
            Self { slices, step, blocks: blocks.start..middle, rows, loose },
            Self { slices, step, blocks: middle..blocks.end, rows: more_rows, loose: more_loose },
        )
    }
}

impl<T: Real> Kernel<T> for Linearise<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let [first_row, first_list] = Self::begins(self.slices, self.blocks.start);
        let Self { slices, step, blocks, rows, loose } = self;
        let Step { springs, damping, positions, h } = step;
        let field = Vectors(positions);
        let (square, damping) = (h * h, L::splat(with, h * damping));
        let stiffness = |group: usize| L::splat(with, square * springs.groups[group].stiffness);
        let groups = slices.groups;
        let (mut row, mut list) = (first_row, first_list);
        for block in blocks {
            for group in 0..groups {
                let stiffness = stiffness(group);
                let end = slices.row_ends[block * groups + group] as usize;
                for number in row..end {
                    let way = slices.rows[number];
                    let (here, there) =
                        (field.eight::<L>(with, way.from as usize), field.eight::<L>(with, way.to as usize));
                    let rest = L::of(with, slices.row_rest[number]);
                    let [a, x, y, z] = resistance(with, [here, there], stiffness, rest);
                    rows[number - first_row] = only([a + damping, x, y, z], way.lanes);
                }
                row = end;
            }
            if slices.list_ends.is_empty() {
                continue;
            }
            let slice = block * (BLOCK / LANES);
            for own in (slice..slice + BLOCK / LANES).take_while(|own| own * LANES < positions.len()) {
                let here = field.eight::<L>(with, own * LANES);
                for group in 0..groups {
                    let stiffness = stiffness(group);
                    let end = slices.list_ends[own * groups + group] as usize;
                    for number in list..end {
                        let to = &slices.lists[number];
                        // A lane without a spring leads to the particle itself.
                        let some = |lane: usize| u32::from(to[lane] as usize != own * LANES + lane);
                        let springs = (0..LANES).fold(0, |lanes, lane| lanes | some(lane) << lane);
                        let rest = L::of(with, slices.list_rest[number]);
                        let there = field.each::<L>(with, to);
                        let [a, x, y, z] = resistance(with, [here, there], stiffness, rest);
                        loose[number - first_list] = only([a + damping, x, y, z], springs);
                    }
                    list = end;
                }
            }
        }
    }
}

/// The numbers of the springs that there are.
#[inline(always)]
fn only<T: Real, L: Lanes<Scalar = T>>([a, x, y, z]: [L; 4], lanes: u32) -> Four<T> {
    [a.only(lanes).to_array(), x.only(lanes).to_array(), y.only(lanes).to_array(), z.only(lanes).to_array()]
}

/// (a I + u uᵀ) (p - p') of the vectors p of the ones and p' of the others.
#[derive(Clone, Copy)]
struct Product<'a, T>(&'a Linear<T>);

impl<T: Real> Linear<T> {
    #[inline(always)]
    fn of<L: Lanes<Scalar = T>>(&self, with: L::Proof, springs: Eight) -> [L; 4] {
        let four = match springs {
            Eight::Row { number, .. } => &self.rows[number],
            Eight::Loose { number, .. } => &self.loose[number],
        };
        [L::of(with, four[0]), L::of(with, four[1]), L::of(with, four[2]), L::of(with, four[3])]
    }
}

impl<T: Real> Law<T> for Product<'_, T> {
    #[inline(always)]
    fn give<L: Lanes<Scalar = T>>(
        self,
        with: L::Proof,
        springs: Eight,
        here: impl Fields<T>,
        there: impl Fields<T>,
        _: &mut L,
    ) -> [L; 3] {
        let [a, ux, uy, uz] = self.0.of::<L>(with, springs);
        let (here, there): ([L; 3], [L; 3]) = (here.field(with, 0), there.field(with, 0));
        let [x, y, z] = [here[0] - there[0], here[1] - there[1], here[2] - there[2]];
        let along = ux * x + uy * y + uz * z;
        [a * x + ux * along, a * y + uy * along, a * z + uz * along]
    }
}

/// a I + u uᵀ itself, which it adds to what each of its two particles has with itself: xx, yy, zz, or xy, xz, yz.
#[derive(Clone, Copy)]
struct Own<'a, T, const DIAGONAL: bool>(&'a Linear<T>);

impl<T: Real, const DIAGONAL: bool> Law<T> for Own<'_, T, DIAGONAL> {
    const ALIKE: bool = true;

    #[inline(always)]
    fn give<L: Lanes<Scalar = T>>(
        self,
        with: L::Proof,
        springs: Eight,
        _: impl Fields<T>,
        _: impl Fields<T>,
        _: &mut L,
    ) -> [L; 3] {
        let [a, ux, uy, uz] = self.0.of::<L>(with, springs);
        if DIAGONAL { [a + ux * ux, a + uy * uy, a + uz * uz] } else { [ux * uy, ux * uz, uy * uz] }
    }
}

/// Products of a matrix with a vector of each particle, and for each block the scalar products of both, lane by lane.
struct Images<'a, T> {
    /// What each particle's vector is multiplied with besides, kg.
    mass: &'a [T],
    image: &'a mut [[[T; LANES]; 3]],
    squares: &'a mut [[T; LANES]],
}

impl<T: Real> Parts for Images<'_, T> {
    fn count(&self) -> usize {
        self.mass.len()
    }

    fn split_at(self, particle: usize) -> (Self, Self) {
        let (mass, more_mass) = self.mass.split_at(particle);
        let (image, more_image) = self.image.split_at_mut(particle / LANES);
        let (squares, more_squares) = self.squares.split_at_mut(particle / BLOCK);
        (Self { mass, image, squares }, Self { mass: more_mass, image: more_image, squares: more_squares })
    }
}

impl<T: Real> Sums<T> for Images<'_, T> {
    #[inline(always)]
    fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, at: usize, here: impl Fields<T>) -> [L; 3] {
        let (mass, [x, y, z]) = (eight_of::<T, L>(with, &self.mass[at..]), here.field::<L>(with, 0));
        [x * mass, y * mass, z * mass]
    }

    #[inline(always)]
    fn end<L: Lanes<Scalar = T>>(&mut self, with: L::Proof, at: usize, here: impl Fields<T>, sum: [L; 3]) {
        self.image[at / LANES] = [sum[0].to_array(), sum[1].to_array(), sum[2].to_array()];
        let [x, y, z] = here.field::<L>(with, 0);
        let square = x * sum[0] + y * sum[1] + z * sum[2];
        let squares = &mut self.squares[at / BLOCK];
        let before = if at.is_multiple_of(BLOCK) { L::splat(with, T::ZERO) } else { L::load(with, squares) };
        (before + square).store(squares);
    }
}

/// Part of the blocks that particles have with themselves.
struct Blocks<'a, T> {
    /// Begun with these masses, kg, or with nothing.
    mass: Option<&'a [T]>,
    particles: usize,
    values: &'a mut [[[T; LANES]; 3]],
}

impl<T: Real> Parts for Blocks<'_, T> {
    fn count(&self) -> usize {
        self.particles
    }

    fn split_at(self, particle: usize) -> (Self, Self) {
        let (values, more) = self.values.split_at_mut(particle / LANES);
        let masses = self.mass.map(|mass| mass.split_at(particle));
        (
            Self { mass: masses.map(|both| both.0), particles: particle, values },
            Self { mass: masses.map(|both| both.1), particles: self.particles - particle, values: more },
        )
    }
}

impl<T: Real> Sums<T> for Blocks<'_, T> {
    #[inline(always)]
    fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, at: usize, _: impl Fields<T>) -> [L; 3] {
        match self.mass {
            Some(mass) => [eight_of::<T, L>(with, &mass[at..]); 3],
            None => [L::splat(with, T::ZERO); 3],
        }
    }

    #[inline(always)]
    fn end<L: Lanes<Scalar = T>>(&mut self, _: L::Proof, at: usize, _: impl Fields<T>, [x, y, z]: [L; 3]) {
        self.values[at / LANES] = [x.to_array(), y.to_array(), z.to_array()];
    }
}

impl<T: Real> Slices<T> {
    /// Makes the springs linear in a shape.
    pub fn linearise(&self, step: Step<T>, linear: &mut Linear<T>, threads: usize) {
        let none = [[T::ZERO; LANES]; 4];
        linear.rows.resize(self.rows.len(), none);
        linear.loose.resize(self.lists.len(), none);
        let blocks = 0..step.positions.len().div_ceil(BLOCK);
        let (rows, loose) = (&mut linear.rows[..], &mut linear.loose[..]);
        lanes::share(Linearise { slices: self, step, blocks, rows, loose }, 1, threads);
    }

    /// Writes (M + springs) `from` over `image`, M the masses given, and the scalar products of both over `squares`, one a block.
    pub fn multiply(
        &self,
        linear: &Linear<T>,
        mass: &[T],
        from: &[[[T; LANES]; 3]],
        image: &mut [[[T; LANES]; 3]],
        squares: &mut [[T; LANES]],
        Means { windows, threads }: Means<T>,
    ) {
        let sums = Images { mass, image, squares };
        self.go_over([Eights(from)], Product(linear), sums, windows, threads);
    }

    /// Writes the blocks that particles have with themselves in M + springs over these: xx, yy, zz and xy, xz, yz.
    pub fn own_blocks(
        &self,
        linear: &Linear<T>,
        mass: &[T],
        [diagonal, off]: [&mut [[[T; LANES]; 3]]; 2],
        Means { windows, threads }: Means<T>,
    ) {
        let none: [Eights<T>; 0] = [];
        let sums = Blocks { mass: Some(mass), particles: mass.len(), values: diagonal };
        self.go_over(none, Own::<T, true>(linear), sums, windows, threads);
        let sums = Blocks { mass: None, particles: mass.len(), values: off };
        self.go_over(none, Own::<T, false>(linear), sums, windows, threads);
    }
}

#[cfg(test)]
mod tests {
    use super::super::pass::{Pass, Window};
    use super::super::tests::{cloths, crumpled, place};
    use super::*;
    use crate::math::Vector;
    use crate::math::lanes::Plain;
    use crate::model::Topology;
    use glam::{DMat3, DVec3};

    /// h² K + h k_d I of a spring, in doubles.
    fn matrix(d: DVec3, rest: f64, k: f64, h: f64, damping: f64) -> DMat3 {
        let length = d.length();
        let identity = DMat3::IDENTITY;
        let stiffness = if length > 0.0 {
            let n = d / length;
            let along = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            along + (identity - along) * (1.0 - rest / length).max(0.0)
        } else if rest > 0.0 {
            DMat3::ZERO
        } else {
            identity
        };
        stiffness * (h * h * k) + identity * (h * damping)
    }

    fn agree<T: Real>(topology: &Topology, particles: usize, rest_lengths: f64) {
        let (mut springs, state) = crumpled::<T>(topology, particles);
        springs.rest.iter_mut().for_each(|rest| *rest = *rest * T::from_f64(rest_lengths));
        let (h, damping) = (0.1, 2.0);
        let step = Step {
            springs: &springs,
            damping: T::from_f64(damping),
            positions: &state.positions,
            h: T::from_f64(h),
        };
        let slices = Slices::new(particles, &springs);
        let mass: Vec<T> = (0..particles).map(|i| T::from_f64(1.0 + (i % 3) as f64)).collect();
        let from: Vec<T::Vec3> = (0..particles).map(|i| place::<T>(i + 3, 1.0)).collect();
        let mut eights = vec![[[T::ZERO; LANES]; 3]; particles.div_ceil(LANES)];
        for (i, v) in from.iter().enumerate() {
            v.to_array().into_iter().zip(&mut eights[i / LANES]).for_each(|(v, to)| to[i % LANES] = v);
        }
        let none = vec![[[T::ZERO; LANES]; 3]; eights.len()];
        let on = |threads| {
            let (mut linear, mut windows) = (Linear::default(), Vec::new());
            slices.linearise(step, &mut linear, threads);
            let [mut image, mut diagonal, mut off] = [none.clone(), none.clone(), none.clone()];
            let mut products = vec![[T::ZERO; LANES]; particles.div_ceil(BLOCK)];
            let means = Means { windows: &mut windows, threads };
            slices.multiply(&linear, &mass, &eights, &mut image, &mut products, means);
            let means = Means { windows: &mut windows, threads };
            slices.own_blocks(&linear, &mass, [&mut diagonal, &mut off], means);
            (image, products, diagonal, off)
        };
        let (image, products, diagonal, off) = on(1);
        for threads in [2, 3, 8] {
            assert!(on(threads) == (image.clone(), products.clone(), diagonal.clone(), off.clone()));
        }

        let mut linear = Linear::default();
        slices.linearise(step, &mut linear, 1);
        let Linear { rows, loose } = linear.clone();
        let blocks = 0..particles.div_ceil(BLOCK);
        let (more_rows, more_loose) = (&mut linear.rows[..], &mut linear.loose[..]);
        Linearise { slices: &slices, step, blocks, rows: more_rows, loose: more_loose }.run::<Plain<T>>(());
        assert!((&linear.rows, &linear.loose) == (&rows, &loose), "in plain arrays");
        let mut windows = [Window::default()];
        windows[0].hold(1);
        let (mut plain, mut squares) = (none.clone(), products.clone());
        let sums = Images { mass: &mass, image: &mut plain, squares: &mut squares };
        let (fields, law) = ([Eights(&eights)], Product(&linear));
        Pass { slices: &slices, particles, fields, law, first: 0, sums, windows: &mut windows }
            .run::<Plain<T>>(());
        assert!((plain, squares) == (image.clone(), products.clone()), "in plain arrays");

        let mut images: Vec<DVec3> = from.iter().zip(&mass).map(|(v, m)| v.to_f64() * m.to_f64()).collect();
        let mut blocks: Vec<DMat3> =
            mass.iter().map(|m| DMat3::from_diagonal(DVec3::splat(m.to_f64()))).collect();
        // The sum of the magnitudes of all terms, and how many.
        let mut terms: Vec<(f64, f64)> =
            images.iter().map(|image| (image.abs().max_element(), 1.0)).collect();
        for group in &springs.groups {
            for s in group.range.clone() {
                let [i, j] = springs.pairs[s].map(|p| p as usize);
                let d = (state.positions[j] - state.positions[i]).to_f64();
                let matrix = matrix(d, springs.rest[s].to_f64(), group.stiffness.to_f64(), h, damping);
                let way = from[i].to_f64() - from[j].to_f64();
                images[i] += matrix * way;
                images[j] -= matrix * way;
                let size = h * h * group.stiffness.to_f64() + h * damping;
                for end in [i, j] {
                    blocks[end] += matrix;
                    terms[end].0 += size * (1.0 + way.length());
                    terms[end].1 += 1.0;
                }
            }
        }
        // As in a pass of forces; a number of a spring comes of some twenty more operations.
        let epsilon = T::EPSILON.to_f64() / 2.0;
        for i in 0..particles {
            let most = (terms[i].1 + 20.0) * 2.0 * epsilon * terms[i].0;
            let [v, d, o] = [&image, &diagonal, &off]
                .map(|eights| DVec3::from_array(eights[i / LANES].map(|c| c[i % LANES].to_f64())));
            let own = blocks[i];
            let expected = [
                images[i],
                DVec3::new(own.x_axis.x, own.y_axis.y, own.z_axis.z),
                DVec3::new(own.x_axis.y, own.x_axis.z, own.y_axis.z),
            ];
            for (is, should) in [v, d, o].into_iter().zip(expected) {
                assert!((is - should).abs().max_element() <= most, "{is} instead of {should}, {most:e}");
            }
        }
        let product: f64 = products.as_flattened().iter().map(|part| part.to_f64()).sum();
        let parts = from.iter().zip(&images).map(|(v, image)| v.to_f64() * *image);
        let (expected, sizes) = parts.fold((0.0, 0.0), |(sum, size), part| {
            (sum + part.element_sum(), size + part.abs().element_sum())
        });
        let whole: f64 = terms.iter().map(|(size, terms)| (terms + 20.0) * size).sum();
        assert!((product - expected).abs() <= 2.0 * epsilon * (whole + BLOCK as f64 * sizes));
    }

    #[test]
    fn products_are_those_of_the_springs_matrices_on_any_number_of_threads() {
        for (topology, particles) in cloths() {
            for rest_lengths in [1.0, 0.0] {
                agree::<f32>(&topology, particles, rest_lengths);
                agree::<f64>(&topology, particles, rest_lengths);
            }
        }
    }
}
