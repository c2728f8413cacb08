//! What the machine can do at best on one thread, measured in the same run: reading, and taking roots.

use std::collections::HashMap;
use std::hint::black_box;
use std::time::Instant;

/// What a step has to do, whatever its kernels are like.
pub struct Work {
    pub particles: f64,
    pub springs: f64,
    /// Looks at springs that ask for a length.
    pub visits: f64,
    /// Looks at springs that multiply by a matrix.
    pub products: f64,
    /// Bytes of a number: 4 or 8.
    pub size: usize,
}

/// Measures as it is asked.
#[derive(Default)]
pub struct Machine {
    roots: HashMap<usize, f64>,
    reading: HashMap<usize, f64>,
}

impl Machine {
    /// The least time of a step, ns: the larger of what a root and a division for each length take, and of reading and writing
    /// positions and velocities once a step, and once in every pass over the springs a vector a particle, with one number a
    /// spring for a length and four for a matrix, at the speed at which as much as all of this lies is read again and again.
    pub fn bound(&mut self, work: &Work) -> f64 {
        let Work { particles, springs, visits, products, size } = *work;
        let passes = (visits + products) / springs;
        let numbers = particles * (12.0 + 3.0 * passes) + visits + 4.0 * products;
        let each = if products > 0.0 { 5.0 } else { 1.0 };
        let held = (6.0 * particles + each * springs) * size as f64;
        f64::max(self.root(size) * visits, self.read(held as usize) * numbers * size as f64)
    }

    /// A root and a division, ns.
    fn root(&mut self, size: usize) -> f64 {
        *self.roots.entry(size).or_insert_with(|| {
            let numbers = 4096 / size;
            let best = if size == 4 {
                let (from, mut to) = (vec![2.0_f32; numbers], vec![0.0; numbers]);
                shortest(|| roots(black_box(&from), &mut to))
            } else {
                let (from, mut to) = (vec![2.0_f64; numbers], vec![0.0; numbers]);
                shortest(|| roots(black_box(&from), &mut to))
            };
            best / numbers as f64
        })
    }

    /// A byte of so many that are read again and again, ns.
    fn read(&mut self, bytes: usize) -> f64 {
        *self.reading.entry(bytes).or_insert_with(|| {
            let words = vec![1_u64; bytes.div_ceil(8)];
            shortest(|| {
                black_box(sum(black_box(&words)));
            }) / bytes as f64
        })
    }
}

/// Of what is done for a tenth of a second, and three times at least, ns.
fn shortest(mut work: impl FnMut()) -> f64 {
    let (begin, mut best, mut turns) = (Instant::now(), f64::INFINITY, 0);
    while turns < 3 || begin.elapsed().as_secs_f64() < 0.1 {
        // As many as take long beside reading the clock.
        let (start, mut count) = (Instant::now(), 0);
        while start.elapsed().as_secs_f64() < 1e-4 {
            (0..16).for_each(|_| work());
            count += 16;
        }
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / f64::from(count));
        turns += 1;
    }
    best
}

/// The compiler's own eights or fours, with the instructions that the library chooses.
#[allow(unsafe_code)]
fn roots<T: Root>(from: &[T], to: &mut [T]) {
    #[target_feature(enable = "avx2")]
    fn run<T: Root>(from: &[T], to: &mut [T]) {
        for (to, from) in to.iter_mut().zip(from) {
            *to = from.root();
        }
    }
    assert!(std::arch::is_x86_feature_detected!("avx2"), "the reference needs AVX2");
    // SAFETY: the instructions are there.
    unsafe { run(from, to) }
}

#[allow(unsafe_code)]
fn sum(words: &[u64]) -> u64 {
    #[target_feature(enable = "avx2")]
    fn run(words: &[u64]) -> u64 {
        // Several chains, or each sum would wait for the one before it.
        let (blocks, _) = words.as_chunks::<32>();
        let mut sums = [0_u64; 32];
        for block in blocks {
            for (sum, word) in sums.iter_mut().zip(block) {
                *sum = sum.wrapping_add(*word);
            }
        }
        sums.into_iter().fold(0, u64::wrapping_add)
    }
    assert!(std::arch::is_x86_feature_detected!("avx2"), "the reference needs AVX2");
    // SAFETY: the instructions are there.
    unsafe { run(words) }
}

trait Root {
    /// 1 / sqrt(x).
    fn root(&self) -> Self;
}

impl Root for f32 {
    fn root(&self) -> Self {
        1.0 / self.sqrt()
    }
}

impl Root for f64 {
    fn root(&self) -> Self {
        1.0 / self.sqrt()
    }
}
