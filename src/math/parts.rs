//! Work on rows of things that threads can share, each with as much as any other.

/// A row of things that can be cut in two. Slices are one, and so are several rows of one length side by side.
pub trait Parts: Sized + Send {
    /// How many things.
    fn count(&self) -> usize;
    /// Those before one of them, and the rest.
    fn split_at(self, at: usize) -> (Self, Self);
}

/// Works on parts of whole `unit`s of things, on so many threads of the current pool.
pub fn share<P: Parts>(parts: P, unit: usize, threads: usize, work: &(impl Fn(P) + Sync)) {
    let units = parts.count().div_ceil(unit);
    if threads < 2 || units < 2 {
        work(parts);
        return;
    }
    let few = threads / 2;
    let (one, other) = parts.split_at(unit * (units * few / threads).max(1));
    rayon::join(|| share(one, unit, few, work), || share(other, unit, threads - few, work));
}

/// Works on every particle of rows of them, on so many threads of the current pool.
pub fn each_particle<P: Parts>(parts: P, threads: usize, work: impl Fn(P) + Sync) {
    /// So few that there is something for every thread, so many that no two write to the same lines of a cache.
    const UNIT: usize = 512;
    share(parts, UNIT, threads, &work);
}

impl<T: Send> Parts for &mut [T] {
    fn count(&self) -> usize {
        self.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl<T: Sync> Parts for &[T] {
    fn count(&self) -> usize {
        self.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        <[T]>::split_at(self, at)
    }
}

macro_rules! side_by_side {
    ($($row:ident $one:ident $other:ident),+) => {
        impl<$($row: Parts),+> Parts for ($($row,)+) {
            fn count(&self) -> usize {
                self.0.count()
            }

            fn split_at(self, at: usize) -> (Self, Self) {
                #[expect(non_snake_case, reason = "rows are named by their types")]
                let ($($row,)+) = self;
                $(let ($one, $other) = $row.split_at(at);)+
                (($($one,)+), ($($other,)+))
            }
        }
    };
}

side_by_side!(A a0 a1, B b0 b1);
side_by_side!(A a0 a1, B b0 b1, C c0 c1);
side_by_side!(A a0 a1, B b0 b1, C c0 c1, D d0 d1);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thing_is_worked_on_once_with_what_stands_beside_it() {
        for (count, unit, threads) in
            [(0, 8, 4), (7, 8, 2), (100, 8, 1), (100, 8, 3), (1000, 1, 7), (1025, 512, 2)]
        {
            let beside: Vec<usize> = (0..count).collect();
            let mut sums = vec![1; count];
            let parts = (&mut sums[..], &beside[..]);
            share(parts, unit, threads, &|(sums, beside): (&mut [usize], &[usize])| {
                assert!(threads == 1 || sums.len() <= unit * count.div_ceil(unit).div_ceil(threads));
                sums.iter_mut().zip(beside).for_each(|(sum, beside)| *sum += beside);
            });
            assert!(sums.into_iter().eq(1..=count));
        }
    }
}
