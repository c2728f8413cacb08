//! Numbers that look random and are the same in every run: xorshift64 (Marsaglia, "Xorshift RNGs", Journal of Statistical
//! Software, 2003).

/// The generator.
#[derive(Clone, Debug)]
pub struct Xorshift(u64);

impl Xorshift {
    /// Begins with a seed, which is not 0: nothing would come of that.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, from -0.5 on and below 0.5.
    pub fn centred(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}
