//! Where the finished rows of a window go.

use std::ops::Range;

use ndarray::ArrayViewMut2;

use crate::base::aligned::Aligned;
use crate::base::error::Error;

/// Where finished rows go.
pub(super) trait Target<T> {
    /// Room for these rows of the window, one behind the other.
    fn room(&mut self, rows: &Range<usize>) -> &mut [T];

    /// They are complete.
    fn done(&mut self, rows: Range<usize>) -> Result<(), Error>;
}

/// To a worker's rows of the result.
pub(super) struct Direct<'o, T> {
    pub(super) out: &'o mut [T],
    pub(super) first: usize,
    pub(super) width: usize,
}

impl<T> Target<T> for Direct<'_, T> {
    fn room(&mut self, rows: &Range<usize>) -> &mut [T] {
        let (from, to) = (rows.start - self.first, rows.end - self.first);
        &mut self.out[from * self.width..to * self.width]
    }

    fn done(&mut self, _rows: Range<usize>) -> Result<(), Error> {
        Ok(())
    }
}

/// To the result's own rows, behind those that are handed on before them: nothing else is held.
pub(super) struct InPlace<'o, T, O, F> {
    pub(super) row: Aligned<T>,
    pub(super) out: &'o mut [O],
    /// Of the window's row, and of the result's.
    pub(super) widths: (usize, usize),
    pub(super) first: usize,
    pub(super) floats: Floats<T, O>,
    pub(super) finish: F,
}

/// Pixels as values of the field, where they are such.
pub type Floats<T, O> = fn(&mut [O]) -> Option<&mut [T]>;

impl<T: Copy, O, F: FnMut(usize, &[T], &mut [O]) -> Result<(), Error>> Target<T>
    for InPlace<'_, T, O, F>
{
    fn room(&mut self, rows: &Range<usize>) -> &mut [T] {
        let (width, line) = self.widths;
        let pixels = &mut self.out[(rows.start - self.first) * line..][..rows.len() * line];
        // At its end: row i of n is written to w i .. w (i + 1), where w is the line in widths, and the
        // values of later rows stand from (w - 1) n + i + 1 on, which is not before.
        let from = pixels.len() - rows.len() * width;
        (self.floats)(pixels).map_or(&mut [], |values| &mut values[from..])
    }

    fn done(&mut self, rows: Range<usize>) -> Result<(), Error> {
        let Self { row, out, widths: (width, line), first, floats, finish } = self;
        let pixels = &mut out[(rows.start - *first) * *line..][..rows.len() * *line];
        let from = pixels.len() - rows.len() * *width;
        for (i, y) in rows.enumerate() {
            let values = floats(pixels).ok_or_else(layout)?;
            row.copy_from_slice(&values[from + i * *width..][..*width]);
            finish(y, row, &mut pixels[i * *line..][..*line])?;
        }
        Ok(())
    }
}

/// To a strip, from which they are handed on.
pub(super) struct ByRows<'o, T, O, F> {
    pub(super) strip: Aligned<T>,
    pub(super) width: usize,
    pub(super) out: ArrayViewMut2<'o, O>,
    pub(super) first: usize,
    pub(super) finish: F,
}

impl<T, O, F: FnMut(usize, &[T], &mut [O]) -> Result<(), Error>> Target<T> for ByRows<'_, T, O, F> {
    fn room(&mut self, rows: &Range<usize>) -> &mut [T] {
        &mut self.strip[..rows.len() * self.width]
    }

    fn done(&mut self, rows: Range<usize>) -> Result<(), Error> {
        for (y, values) in rows.zip(self.strip.chunks_exact(self.width)) {
            let mut line = self.out.row_mut(y - self.first);
            (self.finish)(y, values, line.as_slice_mut().ok_or_else(layout)?)?;
        }
        Ok(())
    }
}

pub(super) fn layout() -> Error {
    Error::Internal("rows are not contiguous".into())
}
