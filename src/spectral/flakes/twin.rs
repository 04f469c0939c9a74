//! The slow twin of the tests: a tile by direct sums over pixels and waves.

use std::f64::consts::TAU;

use ndarray::{Array2, Array3, ArrayView2};
use num_complex::Complex;

use super::product::Term;

/// Spectra (n, M, M/2 + 1) of nothing in particular, but finite.
pub fn spectra(number: usize, tile: usize) -> Array3<Complex<f64>> {
    Array3::from_shape_fn((number, tile, tile / 2 + 1), |(n, b, a)| {
        let hash =
            crate::base::random::Hash::seeded(5).word(n as i64).word(b as i64).word(a as i64);
        Complex::new(hash.word(0).unit() - 0.5, hash.word(1).unit() - 0.5)
    })
}

/// The real part of the sum over all waves but the mean and those of half a cycle, by the definition.
pub fn tile(spectra: &Array3<Complex<f64>>, terms: &[Term], shear: f64) -> Array2<f64> {
    let (_, tile, columns) = spectra.dim();
    let m = tile as f64;
    let one = |pattern: ArrayView2<'_, Complex<f64>>, term: &Term, x: f64, y: f64| {
        let mut sum = 0.0;
        for a in 0..columns {
            for b in 0..tile {
                if 2 * a == tile || 2 * b == tile || (a, b) == (0, 0) {
                    continue;
                }
                let signed = if 2 * b > tile { b as f64 - m } else { b as f64 };
                let (kx, ky) = (a as f64 / m, (signed - shear * a as f64) / m);
                let along = |[x, y]: [f64; 2]| kx * x + ky * y;
                let u = std::f64::consts::PI * along(term.streak);
                let blur = if u == 0.0 { 1.0 } else { u.sin() / u };
                let (sin, cos) = (TAU * (kx * x + ky * y - along(term.shift))).sin_cos();
                let wave = pattern[(b, a)] * Complex::new(cos, sin);
                sum += if a > 0 { 2.0 } else { 1.0 } * blur * wave.re;
            }
        }
        term.gain * sum / (m * m)
    };
    Array2::from_shape_fn((tile, tile), |(y, x)| {
        let each = terms.iter();
        each.map(|term| {
            one(spectra.index_axis(ndarray::Axis(0), term.pattern), term, x as f64, y as f64)
        })
        .sum()
    })
}
