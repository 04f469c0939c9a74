//! A texture, filtered for one size of footprint: what a pixel of that size sees, at every place.
//!
//! A word of 32 bits holds four neighbours of 8 bits, so that one load is enough to go between them, and
//! a table of a usual texture fits the second cache. (Sixteen bits with more places to look at, for the
//! nearest one, was slower by four: it waited for memory.) The largest value of the texture is full
//! scale, so that a faint texture keeps its steps.

use ndarray::{ArrayViewMut2, Axis};

use super::area::Area;
use crate::base::error::{Cancel, Error, collected};
use crate::base::pool;

/// Fills `out` (rows, columns), both powers of two. Entry (r, c) holds, from the lowest byte up, the means
/// of the boxes around the places (r, c), (r, c + 1), (r + 1, c) and (r + 1, c + 1), the first and the
/// last two of them in turns: bytes 0 and 2 are column c. A place is the middle of its part of the tile.
pub fn table(
    mut out: ArrayViewMut2<'_, u32>,
    texture: &Area,
    width: f64,
    height: f64,
    peak: f64,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (rows, columns) = out.dim();
    if !rows.is_power_of_two() || !columns.is_power_of_two() {
        return Err(Error::Internal("a table must have powers of two".into()));
    }
    let size = texture.size() as f64;
    let lines = out.axis_iter_mut(Axis(0)).enumerate();
    pool::for_each(lines, |(row, mut line)| {
        cancel.check()?;
        let y = (row as f64 + 0.5) / rows as f64 * size;
        for (column, entry) in line.iter_mut().enumerate() {
            let x = (column as f64 + 0.5) / columns as f64 * size;
            let share = texture.mean(x, y, width, height) / peak;
            *entry = (share.clamp(0.0, 1.0) * 255.0).round() as u32;
        }
        Ok(())
    })?;
    // Each word takes the next column's value, then the next row's two; the first ones are kept.
    for mut line in out.rows_mut() {
        let first = line[0];
        for column in 0..columns {
            let next = if column + 1 == columns { first } else { line[column + 1] };
            line[column] |= (next & 0xff) << 8;
        }
    }
    let top = collected(out.row(0).iter().copied())?;
    for row in 0..rows {
        for column in 0..columns {
            let next = if row + 1 == rows { top[column] } else { out[[row + 1, column]] };
            out[[row, column]] |= (next & 0xffff) << 16;
        }
    }
    Ok(())
}
