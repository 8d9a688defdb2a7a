//! Choices without chance: by shares of a sum, and by numbers that fill the interval from 0 to 1 evenly.

/// The first of some numbers up to which all sum to a share of the whole.
pub fn at_share(values: impl Iterator<Item = f64> + Clone, share: f64) -> Option<usize> {
    let mut left = share * values.clone().sum::<f64>();
    let last = values.clone().count().checked_sub(1)?;
    let found = values.into_iter().position(|value| {
        left -= value;
        left < 0.0
    });
    Some(found.unwrap_or(last))
}

/// Number `k` of a sequence that fills (0, 1) evenly, another for each dimension: multiples of the roots of primes, less whole
/// numbers (Richtmyer 1951).
pub fn spread(k: usize, dimension: usize) -> f64 {
    const PRIMES: [f64; 26] = [
        2., 3., 5., 7., 11., 13., 17., 19., 23., 29., 31., 37., 41., 43., 47., 53., 59., 61., 67.,
        71., 73., 79., 83., 89., 97., 101.,
    ];
    (0.5 + k as f64 * PRIMES[dimension % PRIMES.len()].sqrt()).fract()
}
