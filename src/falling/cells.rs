//! The cells of the air, and the flakes in them: hashes, of nothing but a seed and a place.
//!
//! A population is Poisson in space times density: the flakes of a density d are those that arrive below d,
//! so that more density adds flakes and moves none. Cells are cubes of side 2^-level metres. A cell of a level
//! holds the flakes that arrive between the densities 8^level and 8^(level + 1), in three bands in which
//! density doubles, of 1, 2 and 4 flakes on the mean; the coarsest level has one band more, from density 0 on.
//! So the number of cells that are looked at grows as the number of flakes in them, at any density.

use crate::base::random::Hash;

/// The level of the largest cells, 8 m, and of the smallest, 1/64 m.
const COARSEST: i32 = -3;
const FINEST: i32 = 6;

/// The most flakes in a cubic metre that cells hold.
pub const DENSEST: f64 = 2e6;

/// Streams of the numbers.
const CELLS: i64 = i64::from_be_bytes(*b"fallcell");
const PLACES: i64 = 0x706C_6163;
const LOOKS: i64 = 0x6C6F_6F6B;
const PLACED: i64 = 0x706C_6163_6564;

/// Bits of a place along an axis.
const PLACE_BITS: u32 = 21;

#[derive(Debug, Clone, Copy)]
pub struct Born {
    /// The same wherever the flake is seen, 53 bits.
    pub id: u64,
    /// In its cell, 0 to 1.
    pub inside: [f64; 3],
    /// The density from which on the flake is there, 1/m3.
    pub arrival: f64,
    /// Of the flakes that are smaller, 0 to 1.
    pub share: f64,
    /// Phases of its sway, cycles.
    pub phases: [f64; 2],
}

/// The flakes of a class of size.
#[derive(Debug, Clone, Copy)]
pub struct Cells {
    hash: Hash,
}

/// 2^exponent, of normal numbers.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}

pub fn side(level: i32) -> f64 {
    power(-level)
}

/// The levels that hold flakes of a density.
pub fn levels(density: f64) -> std::ops::RangeInclusive<i32> {
    let mut last = COARSEST;
    while last < FINEST && power(3 * (last + 1)) < density {
        last += 1;
    }
    COARSEST..=last
}

/// The mean number of flakes in a cell of a level that arrive below a density.
pub fn mean(level: i32, below: f64) -> f64 {
    let first = if level == COARSEST { 0.0 } else { power(3 * level) };
    (below.min(power(3 * level + 3)) - first).max(0.0) * power(-3 * level)
}

impl Cells {
    /// The cells of a class, by the seed of its population and its number.
    pub fn new(seed: i64, class: i64) -> Self {
        Self { hash: Hash::seeded(seed).word(CELLS).word(class) }
    }

    /// Hands on the flakes of a cell that arrive below a density.
    #[inline]
    pub fn each(&self, level: i32, [x, y, z]: [i64; 3], below: f64, mut see: impl FnMut(Born)) {
        let cell = self.hash.word(i64::from(level)).word(x).word(y).word(z);
        let base = power(3 * level);
        for band in if level == COARSEST { -1 } else { 0 }..3_i64 {
            let first = if band < 0 { 0.0 } else { base * f64::from(1_u32 << band) };
            if first >= below {
                break;
            }
            let hash = cell.word(band);
            let wide = if band < 0 { base } else { first };
            for number in 0..poisson(band.max(0), hash.unit()) {
                let own = hash.word(number as i64);
                let bits = own.word(LOOKS).bits();
                let arrival = first + wide * ((bits >> 32) as f64 + 0.5) * (1.0 / 4_294_967_296.0);
                if arrival >= below {
                    continue;
                }
                see(Self::born(own, arrival, bits));
            }
        }
    }

    /// The flake of a class that has one, put there by hand: it is always there.
    pub fn placed(&self) -> Born {
        let id = self.hash.word(PLACED).bits() >> 11;
        Born { id, inside: [0.0; 3], arrival: 0.0, share: 0.5, phases: [0.0; 2] }
    }

    #[inline]
    fn born(own: Hash, arrival: f64, bits: u64) -> Born {
        let place = own.word(PLACES).bits();
        let unit = |bits: u64, count: u32| {
            ((bits & ((1 << count) - 1)) as f64 + 0.5) / (1_u64 << count) as f64
        };
        // What the sway takes needs few bits: those of the identity do.
        let id = own.bits() >> 11;
        Born {
            id,
            inside: [0, 1, 2].map(|axis| unit(place >> (axis * PLACE_BITS), PLACE_BITS)),
            arrival,
            share: unit(bits, 32),
            phases: [unit(id >> 20, 16), unit(id >> 4, 16)],
        }
    }
}

/// The number of flakes that a uniform number in [0, 1) is, of a mean of two to the power of `band`.
#[inline]
fn poisson(band: i64, unit: f64) -> usize {
    let (mean, none) = match band {
        0 => (1.0, 0.367_879_441_171_442_33),
        1 => (2.0, 0.135_335_283_236_612_7),
        _ => (4.0, 0.018_315_638_888_734_18),
    };
    let (mut part, mut sum, mut count) = (none, none, 0);
    while unit >= sum && count < 40 {
        count += 1;
        part *= mean / f64::from(count);
        sum += part;
    }
    count as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn born(density: f64, cells: i64) -> Vec<(i32, [i64; 3], Born)> {
        let all = Cells::new(7, 0);
        let mut found = Vec::new();
        for level in levels(density) {
            // The same volume at each level.
            let count = (cells as f64 / side(level)) as i64;
            for x in 0..count {
                for y in 0..count {
                    for z in 0..count {
                        all.each(level, [x, y, z], density, |one| {
                            found.push((level, [x, y, z], one))
                        });
                    }
                }
            }
        }
        found
    }

    #[test]
    fn as_many_are_there_as_the_density_says() {
        for density in [0.003, 0.3, 7.0, 8.1, 64.0, 200.0] {
            let side: i64 = if density < 1.0 { 48 } else { 8 };
            let volume = (side * side * side) as f64;
            let found = born(density, side);
            let wanted = density * volume;
            let off = (found.len() as f64 - wanted) / wanted.sqrt();
            assert!(off.abs() < 4.5, "{density} {} {wanted}", found.len());
            // Even in each half of the cells, and in sizes and arrivals.
            for axis in 0..3 {
                let low = found.iter().filter(|(_, _, one)| one.inside[axis] < 0.5).count() as f64;
                assert!((low - 0.5 * wanted).abs() < 4.5 * (0.5 * wanted).sqrt());
            }
            let small = found.iter().filter(|(_, _, one)| one.share < 0.25).count() as f64;
            assert!((small - 0.25 * wanted).abs() < 4.5 * (0.25 * wanted).sqrt());
            let early =
                found.iter().filter(|(_, _, one)| one.arrival < 0.3 * density).count() as f64;
            assert!((early - 0.3 * wanted).abs() < 4.5 * (0.3 * wanted).sqrt());
        }
    }

    #[test]
    fn counts_are_of_poisson_s_law() {
        for (band, mean) in [(0, 1.0), (1, 2.0), (2, 4.0_f64)] {
            let n = 100_000;
            let counts: Vec<f64> =
                (0..n).map(|i| poisson(band, Hash::seeded(3).word(i).unit()) as f64).collect();
            let average = counts.iter().sum::<f64>() / n as f64;
            let square = counts.iter().map(|c| (c - average).powi(2)).sum::<f64>() / n as f64;
            assert!((average - mean).abs() < 5.0 * (mean / n as f64).sqrt(), "{mean} {average}");
            assert!((square / mean - 1.0).abs() < 0.05, "{mean} {square}");
        }
    }
}
