//! The spectrum of one tile: the sum over its layers of a pattern, moved and blurred.
//!
//! A wave (a, b) of a pattern that is moved by s px turns by -(a u + b v) / M cycles, u = s_x - shear s_y
//! and v = s_y: a product of two small tables. A shutter multiplies it by sinc of the cycles that it
//! moves by meanwhile.
//!
//! All is conjugate and folded, as [`Prepared`] has it: with c + i s the turn of b, and E and O the sum
//! and the difference of a pattern, the tile's are the turn of a times c E + s O and c O - s E.

#![expect(unsafe_code, reason = "products of waves by `Lanes`")]

use super::blur::{Blur, turns};
use super::prepared::{PARTS, Prepared};
use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::lanes::Lanes;
use crate::base::real::Real;
use crate::base::simd::{AVX2, AVX512, dispatch};
use crate::spectral::dense::{Work, passes_on};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    pub pattern: usize,
    pub gain: f64,
    /// Pixels (x, y) that it is moved by.
    pub shift: [f64; 2],
    /// Pixels (x, y) that it moves by while the shutter is open.
    pub streak: [f64; 2],
}

pub struct Scratch<T> {
    /// Of each term: the turns of a, cosines and sines apart, times the gain.
    across: Aligned<T>,
    /// Of each term: the cosine and sine of b.
    down: Aligned<T>,
    blur: Blur<T>,
    work: Work<T>,
}

impl<T: Real> Scratch<T> {
    pub fn new(patterns: &Prepared<T>, terms: usize, blurred: bool) -> Result<Self, Error> {
        let (stride, half) = (patterns.dense.stride(), patterns.half);
        Ok(Self {
            across: Aligned::zeroed(2 * stride * terms)?,
            down: Aligned::zeroed(2 * half * terms)?,
            blur: Blur::new(stride, half, if blurred { terms } else { 0 })?,
            work: patterns.dense.work()?,
        })
    }
}

/// Fills `pixels` with the tile of some terms, without their mean.
#[dispatch]
pub fn render<const LEVEL: u8, T: Real>(
    patterns: &Prepared<T>,
    terms: &[Term],
    scratch: &mut Scratch<T>,
    pixels: &mut [T],
) {
    let (tile, half, stride) = (patterns.tile as f64, patterns.half, patterns.dense.stride());
    let slant = |[x, y]: [f64; 2]| [(x - patterns.shear * y) / tile, y / tile];
    // The transform samples half a pixel off.
    let half_pixel = 0.5 / tile;
    let blurred = terms.iter().any(|term| term.streak != [0.0; 2]);
    for (i, term) in terms.iter().enumerate() {
        let [u, v] = slant(term.shift);
        let gain = T::of(term.gain / (tile * tile));
        let (cos, sin) = scratch.across[2 * stride * i..][..2 * stride].split_at_mut(stride);
        turns::<T, LEVEL>(cos, sin, u + half_pixel, gain);
        let (cos, sin) = scratch.down[2 * half * i..][..2 * half].split_at_mut(half);
        turns::<T, LEVEL>(cos, sin, -(v + half_pixel), T::one());
        if blurred {
            scratch.blur.begin::<LEVEL>(i, slant(term.streak), (stride, half));
        }
    }
    match LEVEL {
        AVX512 => sum::<T, T::Avx512, LEVEL>(patterns, terms, blurred, scratch),
        AVX2 => sum::<T, T::Avx2, LEVEL>(patterns, terms, blurred, scratch),
        _ => sum::<T, T::Portable, LEVEL>(patterns, terms, blurred, scratch),
    }
    let turns = (patterns.shear != 0.0).then_some(&patterns.turns[..]);
    passes_on::<T, LEVEL>(&patterns.dense, &mut scratch.work, turns, pixels);
}

/// Real and imaginary parts of a sum and a difference.
#[derive(Clone, Copy)]
struct Pair<V> {
    sum: [V; 2],
    difference: [V; 2],
}

#[inline(always)]
fn sum<T: Real, V: Lanes<T>, const LEVEL: u8>(
    patterns: &Prepared<T>,
    terms: &[Term],
    blurred: bool,
    scratch: &mut Scratch<T>,
) {
    let (half, stride) = (patterns.half, patterns.dense.stride());
    let Scratch { across, down, blur, work } = scratch;
    // What the reads and writes below rely on.
    assert!(
        stride.is_multiple_of(V::N) && terms.iter().all(|term| term.pattern < patterns.count())
    );
    assert!(across.len() >= 2 * stride * terms.len() && down.len() >= 2 * half * terms.len());
    assert!(!blurred || blur.rows.len() >= 2 * stride * terms.len());
    assert!(work.cos.len() >= 2 * stride * half && work.sin.len() >= 2 * stride * half);
    for b in 0..half {
        if blurred {
            blur.row::<LEVEL>(b, terms.len(), (stride, half));
        }
        for at in (0..stride).step_by(V::N) {
            // SAFETY: b is below `half`, `at` + N at most `stride`, and the lengths are those above.
            unsafe {
                let zero = V::splat(T::zero());
                let mut total = Pair { sum: [zero; 2], difference: [zero; 2] };
                for (i, term) in terms.iter().enumerate() {
                    let folded = patterns.pattern(term.pattern).as_ptr();
                    let folded = folded.add(PARTS * stride * b + at);
                    let e = [V::load(folded), V::load(folded.add(stride))];
                    let o = [V::load(folded.add(2 * stride)), V::load(folded.add(3 * stride))];
                    let down = down.as_ptr().add(2 * half * i + b);
                    let (c, s) = (V::splat(*down), V::splat(*down.add(half)));
                    let mut moved = Pair {
                        sum: [c.multiply_add(e[0], s.mul(o[0])), c.multiply_add(e[1], s.mul(o[1]))],
                        difference: [
                            s.product_from(e[0], c.mul(o[0])),
                            s.product_from(e[1], c.mul(o[1])),
                        ],
                    };
                    if blurred {
                        let blur = blur.rows.as_ptr().add(2 * stride * i + at);
                        moved = moved.blurred(V::load(blur), V::load(blur.add(stride)));
                    }
                    let across = across.as_ptr().add(2 * stride * i + at);
                    let turn = [V::load(across), V::load(across.add(stride))];
                    total.sum = plus(total.sum, moved.sum, turn);
                    total.difference = plus(total.difference, moved.difference, turn);
                }
                let place = 2 * stride * b + at;
                let (cos, sin) = (work.cos.as_mut_ptr(), work.sin.as_mut_ptr());
                total.sum[0].store(cos.add(place));
                total.sum[1].store(cos.add(place + stride));
                total.difference[0].store(sin.add(place));
                total.difference[1].store(sin.add(place + stride));
            }
        }
    }
}

impl<V> Pair<V> {
    /// By what blur leaves of the waves b and -b: half their sum, and half their difference.
    #[inline(always)]
    unsafe fn blurred<T: Real>(self, kept: V, mixed: V) -> Self
    where
        V: Lanes<T>,
    {
        let Self { sum: x, difference: y } = self;
        // SAFETY: the caller has the instructions.
        unsafe {
            Self {
                sum: [
                    mixed.product_from(y[1], kept.mul(x[0])),
                    mixed.multiply_add(y[0], kept.mul(x[1])),
                ],
                difference: [
                    mixed.multiply_add(x[1], kept.mul(y[0])),
                    mixed.product_from(x[0], kept.mul(y[1])),
                ],
            }
        }
    }
}

#[inline(always)]
unsafe fn plus<T: Real, V: Lanes<T>>(sum: [V; 2], a: [V; 2], b: [V; 2]) -> [V; 2] {
    // SAFETY: the caller has the instructions.
    unsafe {
        [
            a[1].product_from(b[1], a[0].multiply_add(b[0], sum[0])),
            a[1].multiply_add(b[0], a[0].multiply_add(b[1], sum[1])),
        ]
    }
}
