//! Look-ups for squares of pixels without gathers. Neighbouring pixels look at neighbouring entries of a
//! table: a few of its rows fill registers, and one permutation of bytes takes the four neighbours of
//! sixteen places at once.
//!
//! It computes what [`super::stack`] computes, to the last bit, and where a place lies outside of what
//! was loaded it does gather. Only for processors with AVX-512 VBMI.

use super::chart::BLOCK;
use super::sheet::{Sheet, Table};
use super::square::{Clear, SQUARE, Square, place_of};
use super::stack::RUN;

/// Rows and columns that a table's bytes have more than its entries, so that no window has to wrap.
pub const PAD: usize = 32;

/// Says that the processor has the instructions.
#[derive(Debug, Clone, Copy)]
pub struct Windows(());

impl Windows {
    /// Asks the processor.
    #[cfg(target_arch = "x86_64")]
    pub fn found() -> Option<Self> {
        let level = crate::base::simd::level() == crate::base::simd::Level::Avx512;
        (level && is_x86_feature_detected!("avx512vbmi")).then_some(Self(()))
    }

    /// No other processor has them.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn found() -> Option<Self> {
        None
    }

    /// Draws layers, nearest first, into a run of squares that are shown in full: `first` is the first of
    /// them in the BLOCK rows of `out`, which are `width` wide.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn draw<'a, const LEVEL: u8>(
        self,
        out: &mut [f32],
        width: usize,
        first: usize,
        squares: &[Square],
        layers: impl Iterator<Item = (&'a Sheet, &'a Table<'a>)>,
    ) {
        let mut clear = [Clear::ALL; RUN / BLOCK];
        let clear = &mut clear[..squares.len()];
        for (sheet, table) in layers {
            let plan = Plan::of(&squares[0], sheet, table);
            // SAFETY: the processor has been asked; `Tables::check` has measured the table.
            unsafe { x86::look_up::<LEVEL>(clear, squares, sheet, table, &plan) };
        }
        for (index, clear) in clear.iter().enumerate() {
            let left = (first + index) * BLOCK;
            let columns = (width - left).min(BLOCK);
            let rows = &mut out[left..BLOCK * width];
            // SAFETY: the processor has been asked; that many columns are left in all of the rows.
            unsafe { x86::write(clear, rows, width, columns) };
        }
    }

    /// Is never reached.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn draw<'a, const LEVEL: u8>(
        self,
        _: &mut [f32],
        _: usize,
        _: usize,
        _: &[Square],
        _: impl Iterator<Item = (&'a Sheet, &'a Table<'a>)>,
    ) {
    }
}

/// Asks for squares before they are read.
#[inline(always)]
pub fn fetch(squares: &[Square]) {
    #[cfg(target_arch = "x86_64")]
    for at in (0..size_of_val(squares)).step_by(64) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: within the squares; nothing is read.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(squares.as_ptr().cast::<i8>().add(at)) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = squares;
}

/// 8 rows of 16 bytes.
const SMALL: u8 = 0;
/// 8 rows of 32 bytes.
const WIDE: u8 = 1;
/// 16 rows of 16 bytes.
const HIGH: u8 = 2;
/// None: everything is gathered.
const NONE: u8 = 3;

/// Width and height of the parts of a square that share a window, and the window; those that take the
/// least work come first.
pub(super) const CHOICES: [(usize, usize, u8); 8] = [
    (16, 16, SMALL),
    (16, 8, SMALL),
    (8, 8, SMALL),
    (16, 16, HIGH),
    (8, 4, SMALL),
    (16, 4, WIDE),
    (8, 2, WIDE),
    (8, 2, HIGH),
];

/// The largest column and row of a window that have a neighbour in it.
const fn most(window: u8) -> [u32; 2] {
    match window {
        SMALL => [14, 6],
        WIDE => [30, 6],
        _ => [14, 14],
    }
}

/// How a layer is looked up in a run of squares.
#[derive(Clone, Copy)]
pub struct Plan {
    pub(super) choice: usize,
    /// Whether places grow along a row, and from row to row: across, along.
    grows: [[bool; 2]; 2],
}

impl Plan {
    /// The plan that suits a square.
    pub fn of(square: &Square, sheet: &Sheet, table: &Table<'_>) -> Self {
        let slopes = |plane: &[u32; SQUARE], bits: u32| {
            let first = plane[0];
            let ends = [place_of(BLOCK - 1, 0), place_of(0, BLOCK - 1)];
            let scale = sheet.multiple as f32 * (1_u32 << bits) as f32 / 4_294_967_296.0 / 15.0;
            ends.map(|end| plane[end].wrapping_sub(first) as i32 as f32 * scale)
        };
        let slopes = [slopes(&square.across, table.columns), slopes(&square.along, table.rows)];
        let fits = |&(width, height, window): &(usize, usize, u8)| {
            let sides = [(width - 1) as f32, (height - 1) as f32];
            // A third of an entry for places that are not quite linear.
            slopes.iter().zip(most(window)).all(|(slope, most)| {
                slope[0].abs() * sides[0] + slope[1].abs() * sides[1] < most as f32 - 0.3
            })
        };
        // Fields of bits would reach into the neighbouring number.
        let small = table.columns < 5 || table.rows < 5;
        let choice = if small { None } else { CHOICES.iter().position(fits) };
        Self {
            choice: choice.unwrap_or(CHOICES.len()),
            grows: slopes.map(|slope| slope.map(|slope| slope >= 0.0)),
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86;
