//! A window of the texture from the top down, band by band, each tile made once.
//!
//! Columns of tiles are shared out among workers; each keeps what its last row of tiles left to the
//! next, and the rows that are finished and not yet asked for.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, Array3, Array4, ArrayViewMut2, Axis};

use super::frame::{Finish, Frame, Strip, Terms};
use super::prepared::Prepared;
use crate::base::error::{Cancel, Error, zeroed};
use crate::base::normal::Normal;
use crate::base::pool;
use crate::base::real::Real;
use crate::spectral::field::Window;
use crate::spectral::stripes::runs;
use crate::spectral::tiles::Row;

/// Terms with arrays of their own.
struct Stored {
    pattern: Array3<i32>,
    gain: Array3<f64>,
    shift: Array4<f64>,
    streak: Option<Array4<f64>>,
    mean: Array2<f64>,
}

impl Stored {
    fn of(terms: &Terms<'_>) -> Self {
        Self {
            pattern: terms.pattern.to_owned(),
            gain: terms.gain.to_owned(),
            shift: terms.shift.to_owned(),
            streak: terms.streak.as_ref().map(|streak| streak.to_owned()),
            mean: terms.mean.to_owned(),
        }
    }

    fn terms(&self) -> Terms<'_> {
        Terms {
            pattern: self.pattern.view(),
            gain: self.gain.view(),
            shift: self.shift.view(),
            streak: self.streak.as_ref().map(|streak| streak.view()),
            mean: self.mean.view(),
        }
    }
}

/// One worker's columns, and the rows of them that wait to be asked for.
struct Columns<T: Real> {
    width: usize,
    strip: Strip<T>,
    waiting: Vec<T>,
    rows: Range<usize>,
}

impl<T: Normal> Columns<T> {
    fn take(
        &mut self,
        frame: &Frame<'_, '_, T>,
        rows: Range<usize>,
        mut out: ArrayViewMut2<'_, T>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let mut y = rows.start;
        while y < rows.end {
            if y >= self.rows.end {
                if self.strip.ended() {
                    return Err(Error::Internal("a texture has no more rows".into()));
                }
                let made = self.strip.next_rows();
                let room = &mut self.waiting[..made.len() * self.width];
                self.strip.row_of_tiles(frame, room, None, cancel)?;
                self.rows = made;
                continue;
            }
            let from = (y - self.rows.start) * self.width;
            let line = out.row_mut(y - rows.start).into_slice();
            line.ok_or_else(|| Error::Internal("rows are not contiguous".into()))?
                .copy_from_slice(&self.waiting[from..from + self.width]);
            y += 1;
        }
        Ok(())
    }
}

/// The rows of a window that have not been taken yet.
pub struct Bands<T: Real> {
    shape: (usize, usize),
    overlap: usize,
    patterns: Arc<Prepared<T>>,
    stored: Stored,
    finish: Finish,
    rows: Range<usize>,
    width: usize,
    columns: Vec<Columns<T>>,
}

impl<T: Normal> Bands<T> {
    /// The rows of a window of a frame.
    pub fn new(
        shape: (usize, usize),
        overlap: usize,
        patterns: Arc<Prepared<T>>,
        terms: &Terms<'_>,
        opacity: bool,
        window: &Window,
    ) -> Result<Self, Error> {
        let finish = Finish { opacity, add: false };
        let mut columns = Vec::new();
        {
            let frame = Frame::new(shape, overlap, &patterns, terms, finish)?;
            frame.fits(window)?;
            let across = Row { length: shape.1, tile: patterns.tile, overlap };
            let (rows, start) = (window.rows.clone(), window.rows.start);
            for cols in runs(&across, &window.cols) {
                let width = cols.len();
                columns.push(Columns {
                    width,
                    strip: Strip::new(&frame, rows.clone(), cols)?,
                    waiting: zeroed(patterns.tile.min(rows.len()) * width)?,
                    rows: start..start,
                });
            }
        }
        Ok(Self {
            shape,
            overlap,
            patterns,
            stored: Stored::of(terms),
            finish,
            rows: window.rows.clone(),
            width: window.cols.len(),
            columns,
        })
    }

    /// Size of a tile, pixels.
    pub fn tile(&self) -> usize {
        self.patterns.tile
    }

    /// Writes image rows from `first` on, as many as `out` (h, width) has; those before it are skipped.
    /// After an error the rest is of no use.
    pub fn take(
        &mut self,
        first: usize,
        out: ArrayViewMut2<'_, T>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (height, width) = out.dim();
        let rows = first..first.saturating_add(height);
        if first < self.rows.start || rows.end > self.rows.end || width != self.width {
            let (left, wanted) = (&self.rows, &rows);
            return Err(Error::Internal(format!(
                "rows {left:?} of {} px are left, not {wanted:?} of {width}",
                self.width
            )));
        }
        let terms = self.stored.terms();
        let frame = Frame::new(self.shape, self.overlap, &self.patterns, &terms, self.finish)?;
        let mut tasks = Vec::new();
        let mut rest = out;
        for columns in &mut self.columns {
            let (part, right) = rest.split_at(Axis(1), columns.width);
            rest = right;
            tasks.push((columns, part));
        }
        pool::for_each(tasks, |(columns, part)| columns.take(&frame, rows.clone(), part, cancel))?;
        self.rows.start = rows.end;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::flakes::choice::choice;
    use crate::spectral::flakes::twin;
    use ndarray::s;

    #[test]
    fn windows_and_bands_have_the_bits_of_the_whole() {
        for (tile, overlap) in [(16, 3), (16, 15), (11, 7), (50, 0)] {
            let shape = (70, 83);
            let patterns =
                Arc::new(Prepared::<f32>::new(twin::spectra(6, tile).view(), 0.382).unwrap());
            let down = Row { length: shape.0, tile, overlap };
            let (rows, cols) = (down.count(), Row { length: shape.1, ..down }.count());
            let found = |row, col, layer| choice(3, layer, (row, col), 0, 3, tile);
            let stored = Stored {
                pattern: Array3::from_shape_fn((rows, cols, 2), |(row, col, layer)| {
                    // Here and there none.
                    let index = 3 * layer + found(row, col, layer).pattern;
                    if (row + 2 * col).is_multiple_of(5) { -1 } else { index as i32 }
                }),
                gain: Array3::from_elem((1, 1, 2), 9.0),
                shift: Array4::from_shape_fn((rows, cols, 2, 2), |(row, col, layer, i)| {
                    found(row, col, layer).shift[i]
                }),
                streak: Some(Array4::from_elem((1, 1, 2, 2), 1.5)),
                mean: Array2::from_shape_fn((rows, 1), |(row, _)| 0.01 * (1 + row) as f64),
            };
            let terms = stored.terms();
            for opacity in [false, true] {
                let finish = Finish { opacity, add: false };
                let frame = Frame::new(shape, overlap, &patterns, &terms, finish).unwrap();
                let whole = Window { rows: 0..70, cols: 0..83 };
                let mut all = Array2::from_elem(shape, f32::NAN);
                let cancel = Cancel::new();
                frame.render(&whole, all.view_mut(), None, &cancel).unwrap();
                assert!(all.iter().all(|&x| x >= 0.0) && all.iter().any(|&x| x > 0.0));
                for window in [
                    whole,
                    Window { rows: 9..61, cols: 20..80 },
                    Window { rows: 33..34, cols: 5..6 },
                ] {
                    let want = all.slice(s![window.rows.clone(), window.cols.clone()]);
                    let mut out = Array2::from_elem(want.dim(), f32::NAN);
                    frame.render(&window, out.view_mut(), None, &cancel).unwrap();
                    assert_eq!(out, want);
                    for step in [1, 7, 40, 100] {
                        let patterns = Arc::clone(&patterns);
                        let mut bands =
                            Bands::new(shape, overlap, patterns, &terms, opacity, &window).unwrap();
                        for top in (0..want.nrows()).step_by(step) {
                            let bottom = (top + step).min(want.nrows());
                            if step == 7 && top == 7 {
                                continue;
                            }
                            let mut out = Array2::from_elem((bottom - top, want.ncols()), f32::NAN);
                            let first = window.rows.start + top;
                            bands.take(first, out.view_mut(), &cancel).unwrap();
                            assert_eq!(out, want.slice(s![top..bottom, ..]));
                        }
                        let mut more = Array2::zeros((1, want.ncols()));
                        assert!(bands.take(window.rows.end, more.view_mut(), &cancel).is_err());
                        assert!(bands.take(window.rows.start, more.view_mut(), &cancel).is_err());
                    }
                }
            }
        }
    }

    #[test]
    fn a_mask_and_what_stands_there_count() {
        let patterns = Prepared::<f64>::new(twin::spectra(1, 8).view(), 0.2).unwrap();
        let stored = Stored {
            pattern: Array3::zeros((1, 1, 1)),
            gain: Array3::from_elem((1, 1, 1), 3.0),
            shift: Array4::zeros((1, 1, 1, 2)),
            streak: None,
            mean: Array2::from_elem((1, 1), 0.2),
        };
        let terms = stored.terms();
        let window = Window { rows: 0..20, cols: 0..13 };
        let mask = Array2::from_shape_fn((20, 13), |(y, x)| ((3 * y + x) % 4) as f64 / 4.0);
        let made = |opacity, add, mask: Option<&Array2<f64>>| {
            let frame =
                Frame::new((20, 13), 3, &patterns, &terms, Finish { opacity, add }).unwrap();
            let mut out = Array2::from_elem((20, 13), 0.125);
            let mask = mask.map(|mask| mask.view());
            frame.render(&window, out.view_mut(), mask, &Cancel::new()).unwrap();
            out
        };
        let depth = made(false, false, None);
        assert_eq!(made(false, false, Some(&mask)), &depth * &mask);
        assert_eq!(made(false, true, Some(&mask)), &depth * &mask + 0.125);
        for (got, depth) in made(true, true, Some(&mask)).iter().zip(&(&depth * &mask)) {
            assert!((got - (1.0 - (-0.125 - depth).exp())).abs() < 1e-15);
        }
        let small = Array2::zeros((19, 13));
        let frame =
            Frame::new((20, 13), 3, &patterns, &terms, Finish { opacity: true, add: false });
        let mut out = Array2::zeros((20, 13));
        let render =
            frame.unwrap().render(&window, out.view_mut(), Some(small.view()), &Cancel::new());
        assert!(render.is_err());
    }
}
