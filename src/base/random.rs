//! Counter-based random numbers: a value is a hash of what it belongs to, never of an order of calls.
//!
//! So a tile, a wave or a flake has the same number whatever the image size, the thread count or the
//! frame that asks (splitmix64's finalizer).

/// Scrambles 64 bits; a bijection.
#[inline(always)]
pub const fn mix64(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A hash that takes its words one after another; copy it to share a prefix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hash(u64);

impl Hash {
    /// The empty hash followed by the seed.
    #[inline(always)]
    pub const fn seeded(seed: i64) -> Self {
        Self(0).word(seed)
    }

    /// The hash with one more word, taken in two's complement.
    #[inline(always)]
    pub const fn word(self, word: i64) -> Self {
        Self(mix64(self.0 ^ word as u64))
    }

    #[inline(always)]
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Uniform in [0, 1), from the upper 53 bits.
    #[inline(always)]
    pub const fn unit(self) -> f64 {
        (self.0 >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }
}

/// A uniform number in [0, 1) for each index, of one `stream` (what the numbers are for).
pub fn uniform(out: &mut [f64], seed: i64, stream: i64) {
    let hash = Hash::seeded(seed).word(stream);
    for (index, value) in out.iter_mut().enumerate() {
        *value = hash.word(index as i64).unit();
    }
}
