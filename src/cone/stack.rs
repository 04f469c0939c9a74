//! Several layers of one texture, far behind near: alpha = 1 - prod(1 - alpha_i), from one chart.
//!
//! A layer is the first one repeated a whole number of times as often. Its place in the texture is the
//! chart's, multiplied: the overflow is the whole tiles, which do not matter. One word of a filtered
//! table is loaded for each layer and pixel.

#![expect(unsafe_code, reason = "a table's word without a check, or the loop is no vector loop")]

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, Axis};

use super::chart::{self, BLOCK, Chart, Course, FADED, HIDDEN};
use super::sheet::{Sheet, Table, Tables, level};
use super::view::View;
use crate::base::error::{Cancel, Error, layout, zeroed};
use crate::base::pool;
use crate::base::simd::{dispatch, multiply_add};

/// Where a stack finds what its pixels see.
pub enum Source<'a> {
    /// A chart, and how many of the layers, nearest first, stand before what is in the picture, for each of the
    /// chart's pixels.
    Chart(Planes<'a>),
    /// The view itself, without a chart that would be used once.
    View(View, Course),
}

/// The planes of a chart, or of a band of it; see [`super::chart::Chart`].
#[derive(Clone, Copy)]
pub struct Planes<'a> {
    pub across: &'a [u32],
    pub along: &'a [u32],
    pub fade: &'a [f32],
    pub state: &'a [u8],
    pub shown: Option<&'a [u8]>,
}

impl<'a> Planes<'a> {
    fn fits(&self, blocks: usize) -> bool {
        let pixels = blocks * BLOCK;
        [self.across.len(), self.along.len(), self.fade.len()] == [pixels; 3]
            && self.state.len() == blocks
            && self.shown.is_none_or(|shown| shown.len() == pixels)
    }

    /// From one block of a row on to another.
    fn part(&self, blocks: Range<usize>) -> Self {
        let pixels = blocks.start * BLOCK..blocks.end * BLOCK;
        Self {
            across: &self.across[pixels.clone()],
            along: &self.along[pixels.clone()],
            fade: &self.fade[pixels.clone()],
            state: &self.state[blocks],
            shown: self.shown.map(|shown| &shown[pixels]),
        }
    }
}

/// Marks the tables that the layers of a chart look into, (levels, levels).
pub fn needed(
    needed: ArrayViewMut2<'_, u8>,
    footprint: ArrayView3<'_, f32>,
    sheets: &[Sheet],
) -> Result<(), Error> {
    let levels = needed.dim().0;
    let marks = needed.into_slice().ok_or_else(layout)?;
    if levels == 0 || marks.len() != levels * levels || levels > 255 {
        return Err(Error::Internal("levels must be square".into()));
    }
    for row in footprint.outer_iter() {
        for place in places_of(row, sheets, levels)? {
            marks[usize::from(place)] = 1;
        }
    }
    Ok(())
}

/// Most pixels that are handled together: their work space stays in the first cache.
const RUN: usize = 4 * BLOCK;

/// What is taken off before a number of 31 bits becomes a float, and added again: the conversion of a
/// signed number is one vector instruction. A float has all of its digits.
const MIDDLE: i32 = 128 * 256 * 32767;

/// A value over its largest: 255 of a byte, 256 between columns, 32767 between rows.
const UNIT: f32 = 1.0 / (255.0 * 256.0 * 32767.0);

/// Looks up one layer for a run of pixels, and multiplies in what it lets through.
#[inline(always)]
fn look_up<const LEVEL: u8>(
    clear: &mut [f32],
    across: &[u32],
    along: &[u32],
    gains: &[f32],
    sheet: &Sheet,
    table: &Table<'_>,
) {
    let count = clear.len();
    let (across, along, gains) = (&across[..count], &along[..count], &gains[..count]);
    // Entries stand for the middles of their parts: half a part less.
    let (rows, columns) = (table.rows, table.columns);
    let offset_across = sheet.offset[0].wrapping_sub(1 << (31 - columns));
    let offset_along = sheet.offset[1].wrapping_sub(1 << (31 - rows));
    let entries = table.entries;
    let last = (entries.len() - 1) as u32;
    for k in 0..count {
        let u = across[k].wrapping_mul(sheet.multiple).wrapping_add(offset_across);
        let v = along[k].wrapping_mul(sheet.multiple).wrapping_add(offset_along);
        let place = (((v >> (32 - rows)) << columns) | (u >> (32 - columns))).min(last);
        // SAFETY: not beyond the last entry, which is less than 2^31. With a check instead the loop would
        // be no vector loop, and with an unsigned place its loads would take twice as many instructions.
        let word = unsafe { *entries.as_ptr().offset(place as i32 as isize) };
        // Both rows at once, each in half of a word: at most 255 * 256 fits.
        let side = (u << columns) >> 24;
        let left = word & 0x00ff_00ff;
        let right = (word >> 8) & 0x00ff_00ff;
        let both = left * (256 - side) + right * side;
        let part = (v << rows) >> 17;
        // Less than 2^31.
        let value = (both & 0xffff) * (32767 - part) + (both >> 16) * part;
        let value = (value as i32 - MIDDLE) as f32 + MIDDLE as f32;
        let alpha = (value * gains[k]).min(1.0);
        clear[k] = multiply_add::<f32, LEVEL>(-alpha, clear[k], clear[k]);
    }
}

/// One layer's factors over a run of a row.
#[inline(always)]
fn gains_of(
    band: &Planes<'_>,
    run: &Range<usize>,
    state: u8,
    index: usize,
    gain: f32,
) -> [f32; RUN] {
    let mut gains = [gain * UNIT; RUN];
    if state == FADED {
        for (gain, &fade) in gains.iter_mut().zip(&band.fade[run.clone()]) {
            *gain *= fade;
        }
    }
    if let Some(shown) = band.shown {
        for (gain, &count) in gains.iter_mut().zip(&shown[run.clone()]) {
            *gain = if index < usize::from(count) { *gain } else { 0.0 };
        }
    }
    gains
}

/// The joint alpha of a band, run by run and within a run row by row: what a run sees of the textures
/// stays in the first cache.
#[dispatch]
fn stack_band<const LEVEL: u8>(
    out: &mut [f32],
    width: usize,
    band: &Planes<'_>,
    places: &[u16],
    sheets: &[Sheet],
    tables: &Tables<'_>,
) -> bool {
    let (count, blocks) = (sheets.len(), width.div_ceil(BLOCK));
    // For each block the place of each layer's table in the grid.
    let places = |block: usize| &places[block * count..][..count];
    let mut whole = true;
    let mut block = 0;
    while block < blocks {
        let mut end = block + 1;
        while end < blocks && (end - block) * BLOCK < RUN && places(end) == places(block) {
            end += 1;
        }
        // The chart's rows are whole blocks, the picture's may end before.
        let (first, last) = (block * BLOCK, (end * BLOCK).min(width));
        for (row, line) in out.chunks_mut(width).enumerate() {
            let states = &band.state[row * blocks + block..row * blocks + end];
            // Fades differ from block to block only near the cone's ends.
            let state =
                if states.iter().all(|&state| state == states[0]) { states[0] } else { MIXED };
            let line = &mut line[first..last];
            if state == HIDDEN {
                line.fill(0.0);
                continue;
            }
            let at = row * blocks * BLOCK + first;
            let run = at..at + line.len();
            let mut clear = [1.0_f32; RUN];
            let clear = &mut clear[..line.len()];
            for (index, (sheet, &place)) in sheets.iter().zip(places(block)).enumerate() {
                let Some(table) = &tables.grid[usize::from(place)] else {
                    whole = false;
                    continue;
                };
                let mut gains = gains_of(band, &run, state, index, sheet.gain);
                if state == MIXED {
                    for (lane, gain) in gains[..line.len()].iter_mut().enumerate() {
                        *gain *= match states[lane / BLOCK] {
                            HIDDEN => 0.0,
                            FADED => band.fade[at + lane],
                            _ => 1.0,
                        };
                    }
                }
                let (across, along) = (&band.across[run.clone()], &band.along[run.clone()]);
                look_up::<LEVEL>(clear, across, along, &gains, sheet, table);
            }
            for (out, clear) in line.iter_mut().zip(&*clear) {
                *out = 1.0 - clear;
            }
        }
        block = end;
    }
    whole
}

/// A run whose blocks differ in how much of them is shown.
const MIXED: u8 = 255;

/// The places in the grid of each block's and layer's table.
fn places_of(
    footprint: ArrayView2<'_, f32>,
    sheets: &[Sheet],
    levels: usize,
) -> Result<Vec<u16>, Error> {
    let mut places = zeroed(footprint.nrows() * sheets.len())?;
    places.clear();
    let sizes: Vec<f32> =
        sheets.iter().map(|sheet| sheet.texels + (sheet.multiple as f32).log2()).collect();
    for block in footprint.rows() {
        for size in &sizes {
            let [across, along] = [0, 1].map(|axis| level(block[axis] + size, levels));
            places.push((across * levels + along) as u16);
        }
    }
    Ok(places)
}

/// Fills `out` (H, W) with the joint alpha of the layers; `footprint` (blocks down, blocks across, 2) are the logarithms
/// of what a block's pixels see, to the base 2.
pub fn stack(
    out: ArrayViewMut2<'_, f32>,
    source: &Source<'_>,
    footprint: ArrayView3<'_, f32>,
    sheets: &[Sheet],
    tables: &Tables<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    let blocks = width.div_ceil(BLOCK);
    let fits = match source {
        Source::Chart(planes) => planes.fits(height * blocks),
        Source::View(..) => true,
    };
    if !fits || footprint.dim() != (height.div_ceil(BLOCK), blocks, 2) {
        return Err(Error::invalid("mapping", "must be of this shape"));
    }
    tables.check()?;
    let bands = out.into_slice().ok_or_else(layout)?.chunks_mut(BLOCK * width).enumerate();
    pool::for_each(bands, |(index, out)| {
        cancel.check()?;
        let (start, count) = (index * BLOCK * blocks, out.len() / width * blocks);
        let places = places_of(footprint.index_axis(Axis(0), index), sheets, tables.levels)?;
        let whole = match source {
            Source::Chart(planes) => {
                stack_band(out, width, &planes.part(start..start + count), &places, sheets, tables)
            }
            Source::View(view, course) => {
                let pixels = count * BLOCK;
                let (mut across, mut along) = (zeroed(pixels)?, zeroed(pixels)?);
                let (mut fade, mut state) = (zeroed(pixels)?, zeroed(count)?);
                let (across, along, fade, state) =
                    (&mut across[..], &mut along[..], &mut fade[..], &mut state[..]);
                let own = Chart { across, along, fade, state };
                chart::band(own, view, course, course.top + index * BLOCK, blocks);
                let own = Planes { across, along, fade, state, shown: None };
                stack_band(out, width, &own, &places, sheets, tables)
            }
        };
        let missing = || Error::Internal("a table that the chart needs is missing".into());
        whole.then_some(()).ok_or_else(missing)
    })
}
