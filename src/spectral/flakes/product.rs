//! The spectrum of one tile: the sum over its layers of a pattern, moved and blurred.
//!
//! A wave (a, b) of a pattern that is moved by s px turns by -(a u + b v) / M cycles, u = s_x - shear s_y
//! and v = s_y: a product of two small tables. A shutter multiplies it by sinc of the cycles that it
//! moves by meanwhile.
//!
//! All is conjugate and folded, as [`Prepared`] has it: with c + i s the turn of b, and E and O the sum
//! and the difference of a pattern, the tile's are the turn of a times c E + s O and c O - s E.

use super::blur::Blur;
use super::prepared::{PARTS, Prepared};
use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::real::Real;
use crate::base::simd::{dispatch, multiply_add};
use crate::spectral::dense::{Work, passes_on};

/// One pattern in a tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    pub pattern: usize,
    pub gain: f64,
    /// Pixels (x, y) that it is moved by.
    pub shift: [f64; 2],
    /// Pixels (x, y) that it moves by while the shutter is open.
    pub streak: [f64; 2],
}

/// Buffers of one worker.
pub struct Scratch<T> {
    /// Of each term: the turns of a, cosines and sines apart, times the gain.
    across: Aligned<T>,
    /// Of each term: the cosine and sine of b.
    down: Aligned<T>,
    blur: Blur<T>,
    work: Work<T>,
}

impl<T: Real> Scratch<T> {
    /// For tiles of at most so many terms.
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

/// Cycles, whole ones taken off.
#[inline(always)]
fn reduced(cycles: f64) -> f64 {
    cycles - cycles.round_ties_even()
}

/// Writes exp(2 pi i k cycles) * gain for k = 0, 1, ..
#[inline(always)]
pub(super) fn turns<T: Real, const LEVEL: u8>(cos: &mut [T], sin: &mut [T], cycles: f64, gain: T) {
    let cycles = reduced(cycles);
    for (k, (cos, sin)) in cos.iter_mut().zip(sin).enumerate() {
        let turn = T::turn::<LEVEL>(T::of(reduced(k as f64 * cycles)));
        *cos = gain * turn.re;
        *sin = gain * turn.im;
    }
}

/// Fills `pixels` with the tile of some terms, without their mean.
#[inline(always)]
fn render_with<T: Real, const LEVEL: u8>(
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
    sum::<T, LEVEL>(patterns, terms, blurred, scratch);
    let turns = (patterns.shear != 0.0).then_some(&patterns.turns[..]);
    passes_on::<T, LEVEL>(&patterns.dense, &mut scratch.work, turns, pixels);
}

/// The folded spectrum of a tile.
#[inline(always)]
fn sum<T: Real, const LEVEL: u8>(
    patterns: &Prepared<T>,
    terms: &[Term],
    blurred: bool,
    scratch: &mut Scratch<T>,
) {
    let (half, stride) = (patterns.half, patterns.dense.stride());
    let Scratch { across, down, blur, work } = scratch;
    let add = multiply_add::<T, LEVEL>;
    for b in 0..half {
        if blurred {
            blur.row::<LEVEL>(b, terms.len(), (stride, half));
        }
        let cos = &mut work.cos[2 * stride * b..][..2 * stride];
        let sin = &mut work.sin[2 * stride * b..][..2 * stride];
        cos.fill(T::zero());
        sin.fill(T::zero());
        let ((cos_re, cos_im), (sin_re, sin_im)) =
            (cos.split_at_mut(stride), sin.split_at_mut(stride));
        for (i, term) in terms.iter().enumerate() {
            let folded = &patterns.pattern(term.pattern)[PARTS * stride * b..][..PARTS * stride];
            let ((e_re, e_im), (o_re, o_im)) = {
                let (sums, differences) = folded.split_at(2 * stride);
                (sums.split_at(stride), differences.split_at(stride))
            };
            let (turn_re, turn_im) = across[2 * stride * i..][..2 * stride].split_at(stride);
            let (c, s) = (down[2 * half * i + b], down[2 * half * i + half + b]);
            for a in 0..stride {
                let (e, o) = ([e_re[a], e_im[a]], [o_re[a], o_im[a]]);
                let mut x = [0, 1].map(|part| add(c, e[part], s * o[part]));
                let mut y = [0, 1].map(|part| add(-s, e[part], c * o[part]));
                if blurred {
                    // What blur leaves of the waves b and -b: half their sum, half their difference.
                    let rows = &blur.rows[2 * stride * i..][..2 * stride];
                    let (kept, mixed) = (rows[a], rows[stride + a]);
                    (x, y) = (
                        [add(-mixed, y[1], kept * x[0]), add(mixed, y[0], kept * x[1])],
                        [add(mixed, x[1], kept * y[0]), add(-mixed, x[0], kept * y[1])],
                    );
                }
                let turn = [turn_re[a], turn_im[a]];
                cos_re[a] = add(-x[1], turn[1], add(x[0], turn[0], cos_re[a]));
                cos_im[a] = add(x[1], turn[0], add(x[0], turn[1], cos_im[a]));
                sin_re[a] = add(-y[1], turn[1], add(y[0], turn[0], sin_re[a]));
                sin_im[a] = add(y[1], turn[0], add(y[0], turn[1], sin_im[a]));
            }
        }
    }
}

dispatch! {
    /// [`render_with`] on the best instructions.
    pub fn render<T: Real>(
        patterns: &Prepared<T>,
        terms: &[Term],
            scratch: &mut Scratch<T>,
        pixels: &mut [T],
    ) = render_with
}
