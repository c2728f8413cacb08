//! Sorting by particle in linear time: what belongs to a particle is put together first, and then only these few are sorted.

/// Sorts what is ordered by a particle first, which `of` tells and which is below `particles`.
pub(super) fn sort_by_particle<T: Copy + Ord>(
    items: Vec<T>,
    particles: usize,
    of: impl Fn(&T) -> u32,
) -> Vec<T> {
    // Where what belongs to each particle begins, and, once it has been put there, where it ends.
    let mut ends = vec![0_u32; particles];
    for item in &items {
        ends[of(item) as usize] += 1;
    }
    let mut start = 0;
    for end in &mut ends {
        start += std::mem::replace(end, start);
    }
    let mut sorted = items.clone();
    for item in items {
        let end = &mut ends[of(&item) as usize];
        sorted[*end as usize] = item;
        *end += 1;
    }
    let mut start = 0;
    for end in ends {
        sorted[start..end as usize].sort_unstable();
        start = end as usize;
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_sorted_and_none_is_lost() {
        let items: Vec<[u32; 2]> = (0..1000).map(|i| [i * 7 % 31, i * i % 101]).collect();
        let mut sorted = items.clone();
        sorted.sort_unstable();
        assert_eq!(sort_by_particle(items, 31, |pair| pair[0]), sorted);
        assert_eq!(sort_by_particle(Vec::<[u32; 2]>::new(), 0, |pair| pair[0]), Vec::<[u32; 2]>::new());
    }
}
