//! What the library's kernels are held against: the plain list, and kernels written by hand for a sheet that is
//! numbered along its rows, in single precision and on one thread. None of them watches, tears or draws.

use faer::linalg::solvers::SolveCore;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Side};
use std::arch::x86_64::{
    __m128, __m256, _CMP_GT_OQ, _mm_add_ps, _mm_loadu_ps, _mm_storeu_ps, _mm_sub_ps, _mm256_add_ps,
    _mm256_and_ps, _mm256_castps128_ps256, _mm256_castps256_ps128, _mm256_cmp_ps, _mm256_div_ps,
    _mm256_extractf128_ps, _mm256_insertf128_ps, _mm256_loadu_ps, _mm256_mul_ps, _mm256_set1_ps,
    _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_sqrt_ps, _mm256_storeu_ps, _mm256_sub_ps,
    _mm256_unpackhi_ps, _mm256_unpacklo_ps,
};
use tenter::model::Topology;
use tenter::target::grid;

const LANES: usize = 8;
/// The scene's: stiffness by kind, damping of springs and air, gravity, dt.
const STIFFNESS: [f32; 3] = [1000.0, 300.0, 100.0];
const DAMPING: f32 = 2.0;
const AIR: f32 = 1.0;
const GRAVITY: f32 = -10.0;
const DT: f32 = 1e-4;

/// A sheet with its springs as a list, and by first particle.
pub struct Reference {
    side: usize,
    inverse_mass: Vec<f32>,
    x: Vec<[f32; 4]>,
    v: Vec<[f32; 4]>,
    f: Vec<[f32; 4]>,
    /// Pair, rest length and stiffness of each spring.
    list: Vec<([u32; 2], f32, f32)>,
    /// Groups of the springs that each particle is the first of.
    ends: Vec<u32>,
    groups: Vec<Group>,
    coloured: Vec<Eight>,
    /// Positions with inverse masses.
    places: Vec<[f32; 4]>,
    /// Positions and velocities by component, for the stencil.
    rows: [Vec<f32>; 6],
    sums: [Vec<f32>; 3],
}

/// Eight springs that share no particle.
struct Eight {
    ends: [[u32; LANES]; 2],
    rest: [f32; LANES],
}

/// The springs of a list in eights: greedy colours inside of bands of eight rows, in the order of the bands; what does not
/// fill an eight is left out.
fn coloured(side: usize, list: &[([u32; 2], f32, f32)]) -> Vec<Eight> {
    let band = |pair: &[u32; 2]| pair[0] as usize / (8 * side);
    let mut eights = Vec::new();
    let mut used = vec![0_u64; side * side];
    for number in 0..side.div_ceil(8) {
        let mut colours = vec![Vec::new(); 64];
        for (pair, rest, _) in list.iter().filter(|(pair, ..)| band(pair) == number) {
            let [i, j] = pair.map(|p| p as usize);
            let colour = (!(used[i] | used[j])).trailing_zeros() as usize;
            used[i] |= 1 << colour;
            used[j] |= 1 << colour;
            colours[colour].push((*pair, *rest));
        }
        used.fill(0);
        for eight in colours.iter().flat_map(|colour| colour.chunks_exact(LANES)) {
            let end = |end: usize| std::array::from_fn(|lane| eight[lane].0[end]);
            eights.push(Eight { ends: [end(0), end(1)], rest: std::array::from_fn(|lane| eight[lane].1) });
        }
    }
    eights
}

/// Eight springs of one particle; a lane without a spring leads to the particle itself.
struct Group {
    to: [u32; LANES],
    rest: [f32; LANES],
    stiffness: [f32; LANES],
}

impl Reference {
    pub fn new(side: u32) -> Self {
        let mesh = grid(side, side, 1.0, false);
        let topology = Topology::of(&mesh);
        let crumpled = mesh.positions.iter().map(|p| *p + super::crumple(*p));
        let x: Vec<[f32; 4]> = crumpled.map(|p| [p.x as f32, p.y as f32, p.z as f32, 0.0]).collect();
        let mut inverse_mass = vec![1.0; x.len()];
        (inverse_mass[0], inverse_mass[side as usize - 1]) = (0.0, 0.0);
        let springs = topology.pairs.iter().zip(STIFFNESS);
        let list: Vec<_> = springs
            .flat_map(|(pairs, k)| pairs.iter().map(move |p| (*p, k)))
            .map(|(pair, k)| {
                let [a, b] = pair.map(|p| mesh.positions[p as usize]);
                (pair, a.distance(b) as f32, k)
            })
            .collect();
        let mut own = vec![Vec::new(); x.len()];
        for &([i, j], rest, k) in &list {
            own[i as usize].push((j, rest, k));
        }
        let (mut ends, mut groups) = (Vec::new(), Vec::new());
        for (i, own) in own.iter().enumerate() {
            for springs in own.chunks(LANES) {
                let mut group = Group { to: [i as u32; LANES], rest: [1.0; LANES], stiffness: [0.0; LANES] };
                for (lane, (j, rest, k)) in springs.iter().enumerate() {
                    (group.to[lane], group.rest[lane], group.stiffness[lane]) = (*j, *rest, *k);
                }
                groups.push(group);
            }
            ends.push(groups.len() as u32);
        }
        let rows = std::array::from_fn(|c| x.iter().map(|x| if c < 3 { x[c] } else { 0.0 }).collect());
        let zeros = vec![[0.0; 4]; x.len()];
        let sums = std::array::from_fn(|_| vec![0.0; x.len()]);
        let side = side as usize;
        let places = x.iter().zip(&inverse_mass).map(|(x, w)| [x[0], x[1], x[2], *w]).collect();
        let coloured = coloured(side, &list);
        Self {
            side,
            inverse_mass,
            v: zeros.clone(),
            f: zeros,
            x,
            list,
            ends,
            groups,
            coloured,
            places,
            rows,
            sums,
        }
    }

    /// One sweep of relaxation, eight springs that share no particle at once, by colours inside of bands of rows.
    #[allow(unsafe_code)]
    pub fn relax_coloured(&mut self) {
        assert!(std::arch::is_x86_feature_detected!("avx2"), "the reference needs AVX2");
        // SAFETY: the instructions are there, and every index is that of a particle.
        unsafe { self.relax_eights() };
    }

    #[target_feature(enable = "avx2")]
    #[allow(unsafe_code)]
    unsafe fn relax_eights(&mut self) {
        for eight in &self.coloured {
            let [i, j] = &eight.ends;
            // SAFETY: as above.
            let (a, b, rest) = unsafe {
                (columns(&self.places, i), columns(&self.places, j), _mm256_loadu_ps(eight.rest.as_ptr()))
            };
            let d = [_mm256_sub_ps(b[0], a[0]), _mm256_sub_ps(b[1], a[1]), _mm256_sub_ps(b[2], a[2])];
            let [xx, yy, zz] = d.map(|d| _mm256_mul_ps(d, d));
            let length = _mm256_sqrt_ps(_mm256_add_ps(_mm256_add_ps(xx, yy), zz));
            let w = _mm256_add_ps(a[3], b[3]);
            let factor = _mm256_div_ps(_mm256_sub_ps(length, rest), _mm256_mul_ps(length, w));
            let some = _mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_mul_ps(length, w), _mm256_setzero_ps());
            let factor = _mm256_and_ps(factor, some);
            let (first, second) = (_mm256_mul_ps(factor, a[3]), _mm256_mul_ps(factor, b[3]));
            let add = |x: __m256, d: __m256| _mm256_add_ps(x, _mm256_mul_ps(d, first));
            let take = |x: __m256, d: __m256| _mm256_sub_ps(x, _mm256_mul_ps(d, second));
            let a = [add(a[0], d[0]), add(a[1], d[1]), add(a[2], d[2]), a[3]];
            let b = [take(b[0], d[0]), take(b[1], d[1]), take(b[2], d[2]), b[3]];
            for (to, values) in [(i, transposed(a)), (j, transposed(b))] {
                for (lane, two) in values.into_iter().enumerate() {
                    let halves = [_mm256_castps256_ps128(two), _mm256_extractf128_ps::<1>(two)];
                    for (half, to) in halves.into_iter().zip([to[lane], to[lane + 4]]) {
                        // SAFETY: as above, and four numbers stand there.
                        unsafe {
                            _mm_storeu_ps(self.places.get_unchecked_mut(to as usize).as_mut_ptr(), half);
                        }
                    }
                }
            }
        }
    }

    /// One sweep of relaxation over the list as it stands, each spring waiting for the one before it.
    pub fn relax(&mut self) {
        for &([i, j], rest, _) in &self.list {
            let (i, j) = (i as usize, j as usize);
            let (a, b) = (self.x[i], self.x[j]);
            let (wi, wj) = (self.inverse_mass[i], self.inverse_mass[j]);
            let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            if wi + wj > 0.0 && length > 0.0 {
                let factor = (length - rest) / length / (wi + wj);
                for (c, d) in d.into_iter().enumerate() {
                    self.x[i][c] += d * factor * wi;
                    self.x[j][c] -= d * factor * wj;
                }
            }
        }
    }

    pub fn coloured_springs(&self) -> u64 {
        (self.coloured.len() * LANES) as u64
    }

    pub fn springs(&self) -> u64 {
        self.list.len() as u64
    }

    fn begin(&mut self) {
        for (f, v) in self.f.iter_mut().zip(&self.v) {
            *f = [-AIR * v[0], GRAVITY - AIR * v[1], -AIR * v[2], 0.0];
        }
    }

    fn update(&mut self) {
        let particles = self.x.iter_mut().zip(&mut self.v).zip(&self.f).zip(&self.inverse_mass);
        for (((x, v), f), w) in particles {
            for c in 0..4 {
                v[c] += f[c] * (w * DT);
                x[c] += v[c] * DT;
            }
        }
    }

    /// A step, spring by spring.
    pub fn list(&mut self) {
        self.begin();
        for &([i, j], rest, k) in &self.list {
            let [i, j] = [i as usize, j as usize];
            let ([xi, xj], [vi, vj]) = ([self.x[i], self.x[j]], [self.v[i], self.v[j]]);
            let d = [xj[0] - xi[0], xj[1] - xi[1], xj[2] - xi[2]];
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let tension = if length > 0.0 { k * (length - rest) / length } else { 0.0 };
            for c in 0..3 {
                let pull = d[c] * tension + (vj[c] - vi[c]) * DAMPING;
                self.f[i][c] += pull;
                self.f[j][c] -= pull;
            }
        }
        self.update();
    }

    /// A step, eight springs of a particle at once.
    #[allow(unsafe_code)]
    pub fn half_gather(&mut self) {
        assert!(std::arch::is_x86_feature_detected!("avx2"), "the reference needs AVX2");
        self.begin();
        // SAFETY: the instructions are there, and every index is that of a particle.
        unsafe { self.half_gather_forces() };
        self.update();
    }

    #[target_feature(enable = "avx2")]
    #[allow(unsafe_code)]
    unsafe fn half_gather_forces(&mut self) {
        let one = |value: f32| _mm256_set1_ps(value);
        let mut first = 0;
        for (i, &end) in self.ends.iter().enumerate() {
            let (xi, vi) = (self.x[i], self.v[i]);
            let mut own = _mm256_castps256_ps128(_mm256_setzero_ps());
            for group in &self.groups[std::mem::replace(&mut first, end as usize)..end as usize] {
                // SAFETY: as above; eight numbers stand in each array of a group.
                let (x, v, rest, k) = unsafe {
                    let [rest, k] = [&group.rest, &group.stiffness].map(|a| _mm256_loadu_ps(a.as_ptr()));
                    (columns(&self.x, &group.to), columns(&self.v, &group.to), rest, k)
                };
                let d = [
                    _mm256_sub_ps(x[0], one(xi[0])),
                    _mm256_sub_ps(x[1], one(xi[1])),
                    _mm256_sub_ps(x[2], one(xi[2])),
                ];
                let u = [
                    _mm256_sub_ps(v[0], one(vi[0])),
                    _mm256_sub_ps(v[1], one(vi[1])),
                    _mm256_sub_ps(v[2], one(vi[2])),
                ];
                let (xx, yy, zz) =
                    (_mm256_mul_ps(d[0], d[0]), _mm256_mul_ps(d[1], d[1]), _mm256_mul_ps(d[2], d[2]));
                let length = _mm256_sqrt_ps(_mm256_add_ps(_mm256_add_ps(xx, yy), zz));
                let tension = _mm256_div_ps(_mm256_mul_ps(k, _mm256_sub_ps(length, rest)), length);
                let some = _mm256_cmp_ps::<_CMP_GT_OQ>(length, _mm256_setzero_ps());
                let (tension, damping) = (_mm256_and_ps(tension, some), one(DAMPING));
                let pull = [
                    _mm256_add_ps(_mm256_mul_ps(d[0], tension), _mm256_mul_ps(u[0], damping)),
                    _mm256_add_ps(_mm256_mul_ps(d[1], tension), _mm256_mul_ps(u[1], damping)),
                    _mm256_add_ps(_mm256_mul_ps(d[2], tension), _mm256_mul_ps(u[2], damping)),
                ];
                let pulls = transposed([pull[0], pull[1], pull[2], _mm256_setzero_ps()]);
                let [a, b, c, d] = pulls;
                let all = _mm256_add_ps(_mm256_add_ps(a, b), _mm256_add_ps(c, d));
                let all = _mm_add_ps(_mm256_castps256_ps128(all), _mm256_extractf128_ps::<1>(all));
                own = _mm_add_ps(own, all);
                for (lane, two) in pulls.into_iter().enumerate() {
                    let halves = [_mm256_castps256_ps128(two), _mm256_extractf128_ps::<1>(two)];
                    for (half, to) in halves.into_iter().zip([group.to[lane], group.to[lane + 4]]) {
                        // SAFETY: a particle's index, and four numbers stand there.
                        unsafe {
                            let f = self.f.get_unchecked_mut(to as usize).as_mut_ptr();
                            _mm_storeu_ps(f, _mm_sub_ps(_mm_loadu_ps(f), half));
                        }
                    }
                }
            }
            let f: &mut [f32; 4] = &mut self.f[i];
            // SAFETY: four numbers stand there.
            unsafe { _mm_storeu_ps(f.as_mut_ptr(), _mm_add_ps(_mm_loadu_ps(f.as_ptr()), own)) };
        }
    }

    /// A step on the structure of the sheet: no indices and one rest length a kind, row by row.
    #[allow(unsafe_code)]
    pub fn stencil(&mut self) {
        assert!(std::arch::is_x86_feature_detected!("avx2"), "the reference needs AVX2");
        // SAFETY: the instructions are there.
        unsafe { self.stencil_step() };
    }

    #[target_feature(enable = "avx2")]
    fn stencil_step(&mut self) {
        let Self { side, rows, sums, inverse_mass, .. } = self;
        let side = *side;
        for c in 0..3 {
            let begin = if c == 1 { GRAVITY } else { 0.0 };
            sums[c].iter_mut().zip(&rows[c + 3]).for_each(|(f, v)| *f = begin - AIR * v);
        }
        let diagonal = 2f32.sqrt();
        // Each neighbour to the right or below: kind, columns, rows and rest length.
        let neighbours = [
            (0, 1, 0, 1.0),
            (0, 0, 1, 1.0),
            (1, 1, 1, diagonal),
            (1, -1, 1, diagonal),
            (2, 2, 0, 2.0),
            (2, 0, 2, 2.0),
        ];
        for row in 0..side {
            for (kind, right, below, rest) in neighbours {
                if row + below >= side {
                    continue;
                }
                let (skip, count) = (usize::from(right < 0), side - isize::unsigned_abs(right));
                let first = row * side + skip;
                let second = (first + below * side).wrapping_add_signed(right);
                line(rows, sums, first, second, count, rest, STIFFNESS[kind]);
            }
        }
        let [x, y, z, u, v, w] = rows;
        for ((x, v), f) in [(x, u), (y, v), (z, w)].into_iter().zip(sums) {
            for (((x, v), f), m) in x.iter_mut().zip(v).zip(f).zip(&*inverse_mass) {
                *v += *f * (m * DT);
                *x += *v * DT;
            }
        }
    }
}

/// The springs from `count` particles in a row to as many others in a row.
#[target_feature(enable = "avx2")]
#[allow(unsafe_code)]
fn line(
    rows: &[Vec<f32>; 6],
    sums: &mut [Vec<f32>; 3],
    first: usize,
    second: usize,
    count: usize,
    rest: f32,
    k: f32,
) {
    assert!(first.max(second) + count <= rows[0].len());
    // SAFETY: all of them have the length of the first, and eight numbers stand where a whole eight is read.
    let own = |c: usize, l: usize| unsafe { _mm256_loadu_ps(rows[c].as_ptr().add(first + l)) };
    let other = |c: usize, l: usize| unsafe { _mm256_loadu_ps(rows[c].as_ptr().add(second + l)) };
    let (k_all, rest_all, damping) = (_mm256_set1_ps(k), _mm256_set1_ps(rest), _mm256_set1_ps(DAMPING));
    let eights = count / LANES * LANES;
    for l in (0..eights).step_by(LANES) {
        let d = [0, 1, 2].map(|c| _mm256_sub_ps(other(c, l), own(c, l)));
        let [xx, yy, zz] = d.map(|d| _mm256_mul_ps(d, d));
        let length = _mm256_sqrt_ps(_mm256_add_ps(_mm256_add_ps(xx, yy), zz));
        let tension = _mm256_div_ps(_mm256_mul_ps(k_all, _mm256_sub_ps(length, rest_all)), length);
        let some = _mm256_cmp_ps::<_CMP_GT_OQ>(length, _mm256_setzero_ps());
        let tension = _mm256_and_ps(tension, some);
        for (c, sum) in sums.iter_mut().enumerate() {
            let u = _mm256_sub_ps(other(c + 3, l), own(c + 3, l));
            let pull = _mm256_add_ps(_mm256_mul_ps(d[c], tension), _mm256_mul_ps(u, damping));
            // SAFETY: as above.
            unsafe {
                let to = sum.as_mut_ptr().add(first + l);
                _mm256_storeu_ps(to, _mm256_add_ps(_mm256_loadu_ps(to), pull));
                let to = sum.as_mut_ptr().add(second + l);
                _mm256_storeu_ps(to, _mm256_sub_ps(_mm256_loadu_ps(to), pull));
            }
        }
    }
    for l in eights..count {
        let (i, j) = (first + l, second + l);
        let d = [0, 1, 2].map(|c| rows[c][j] - rows[c][i]);
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let tension = if length > 0.0 { k * (length - rest) / length } else { 0.0 };
        for (c, sum) in sums.iter_mut().enumerate() {
            let pull = d[c] * tension + (rows[c + 3][j] - rows[c + 3][i]) * DAMPING;
            sum[i] += pull;
            sum[j] -= pull;
        }
    }
}

/// The components of eight vectors.
#[target_feature(enable = "avx2")]
#[allow(unsafe_code)]
unsafe fn columns(vectors: &[[f32; 4]], at: &[u32; LANES]) -> [__m256; 4] {
    // SAFETY: the caller's indices are those of particles, and four numbers stand there.
    let vector = |lane: usize| -> __m128 {
        unsafe { _mm_loadu_ps(vectors.get_unchecked(at[lane] as usize).as_ptr()) }
    };
    let two = |lane: usize| _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(vector(lane)), vector(lane + 4));
    transposed([two(0), two(1), two(2), two(3)])
}

/// Two 4 x 4 matrices, each in one half, turned over.
#[target_feature(enable = "avx2")]
fn transposed([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    let (ab, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
    let (cd, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
    [
        _mm256_shuffle_ps::<0x44>(ab, cd),
        _mm256_shuffle_ps::<0xee>(ab, cd),
        _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
        _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
    ]
}

/// A solve of the matrix of projective dynamics, for three right-hand sides, as faer offers it.
pub fn solve(side: u32) -> impl FnMut() {
    let springs = Topology::of(&grid(side, side, 1.0, false)).pairs;
    let n = (side * side) as usize;
    let mut diagonal = vec![1.0 + f64::from(AIR); n];
    let mut entries = Vec::new();
    for (pairs, k) in springs.iter().zip(STIFFNESS) {
        for pair in pairs {
            let [i, j] = pair.map(|p| p as usize);
            diagonal[i] += f64::from(k);
            diagonal[j] += f64::from(k);
            entries.push(Triplet::new(j, i, -f64::from(k)));
        }
    }
    entries.extend(diagonal.iter().enumerate().map(|(i, d)| Triplet::new(i, i, *d)));
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries).unwrap();
    let factor: Llt<usize, f64> = matrix.sp_cholesky(Side::Lower).unwrap();
    let mut right = Mat::from_fn(n, 3, |i, c| (i * (c + 1)) as f64);
    move || {
        factor.solve_in_place_with_conj(Conj::No, right.as_mut());
        right[(0, 0)] += 1.0;
    }
}

/// Conjugate gradients with the matrix of an implicit step as 3x3 blocks, those of a particle side by side.
pub struct Gradients {
    /// End of the blocks of each particle, the column of each, and the blocks.
    ends: Vec<u32>,
    blocks: Vec<(u32, [[f32; 3]; 3])>,
    /// Solution, residual, direction and its image.
    vectors: [Vec<[f32; 3]>; 4],
}

impl Gradients {
    pub fn new(side: u32) -> Self {
        let mesh = grid(side, side, 1.0, false);
        let mut rows = vec![Vec::new(); mesh.positions.len()];
        for (pairs, k) in Topology::of(&mesh).pairs.iter().zip(STIFFNESS) {
            for pair in pairs {
                let [i, j] = pair.map(|p| p as usize);
                let n = (mesh.positions[j] - mesh.positions[i]).normalize().as_vec3().to_array();
                let block = n.map(|a| n.map(|b| -k * a * b));
                rows[i].push((j as u32, block));
                rows[j].push((i as u32, block));
            }
        }
        let (mut ends, mut blocks) = (Vec::new(), Vec::new());
        for (i, mut row) in rows.into_iter().enumerate() {
            let mut own = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            for (_, block) in &row {
                (0..9).for_each(|c| own[c / 3][c % 3] -= block[c / 3][c % 3]);
            }
            row.push((i as u32, own));
            row.sort_by_key(|(column, _)| *column);
            blocks.append(&mut row);
            ends.push(blocks.len() as u32);
        }
        let right: Vec<[f32; 3]> = (0..ends.len()).map(|i| [0.3, (i as f32).sin(), 1.0]).collect();
        let zero = vec![[0.0; 3]; right.len()];
        Self { ends, blocks, vectors: [zero.clone(), right.clone(), right, zero] }
    }

    /// One iteration.
    pub fn iterate(&mut self) {
        let [x, r, d, image] = &mut self.vectors;
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (mut begin, mut curvature, mut before) = (0, 0.0_f64, 0.0_f64);
        for (i, &end) in self.ends.iter().enumerate() {
            let mut sum = [0.0; 3];
            for (column, block) in &self.blocks[begin..end as usize] {
                let v = d[*column as usize];
                (0..3).for_each(|c| sum[c] += dot(block[c], v));
            }
            begin = end as usize;
            image[i] = sum;
            curvature += f64::from(dot(sum, d[i]));
            before += f64::from(dot(r[i], r[i]));
        }
        let (stride, mut size) = ((before / curvature) as f32, 0.0_f64);
        for ((x, r), (d, image)) in x.iter_mut().zip(&mut *r).zip(d.iter().zip(&*image)) {
            for c in 0..3 {
                x[c] += stride * d[c];
                r[c] -= stride * image[c];
            }
            size += f64::from(dot(*r, *r));
        }
        let keep = (size / before) as f32;
        for (d, r) in d.iter_mut().zip(&*r) {
            (0..3).for_each(|c| d[c] = r[c] + keep * d[c]);
        }
        // Far along the residual is no longer a normal number: begin again.
        if size < 1e-9 {
            r.fill([0.3, -1.0, 1.0]);
            d.copy_from_slice(r);
        }
    }
}
