//! A window of the field from the top down, band by band, each tile made once.
//!
//! A frame that is too large to be held in several copies is made in bands of rows, much lower than a
//! tile. Columns of tiles are shared out among workers; each keeps what its last row of tiles left to
//! the next, and the rows that are finished and not yet asked for.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

use ndarray::{Array2, Array4, ArrayViewMut2, Axis};

use super::band::Band;
use super::field::{Field, Lap, Ready, Window};
use super::filter::TemporalFilter;
use super::parts::Parts;
use super::stripes::{Mapped, Strip, runs};
use super::target::Target;
use super::tiles::{Blend, Row};
use crate::base::error::{Cancel, Error};
use crate::base::pool;
use crate::base::real::Real;

/// A field with arrays of its own.
struct Stored {
    shape: (usize, usize),
    tile: (usize, usize),
    overlap: usize,
    blend: Blend,
    band: Band,
    seed: i64,
    jitter: bool,
    ring_edges: Vec<f64>,
    ring_gains: Vec<f64>,
    vectors: [Array4<f64>; 4],
    filter: TemporalFilter,
    shortest: Option<Array2<f64>>,
    lap: Option<([Array4<f64>; 2], f64)>,
}

impl Stored {
    fn of(field: &Field<'_>) -> Self {
        let vectors = [field.drift, field.shift, field.velocity, field.shift_rate];
        Self {
            shape: field.shape,
            tile: field.tile,
            overlap: field.overlap,
            blend: field.blend,
            band: field.band,
            seed: field.seed,
            jitter: field.jitter,
            ring_edges: field.ring_edges.to_vec(),
            ring_gains: field.ring_gains.to_vec(),
            vectors: vectors.map(|vectors| vectors.to_owned()),
            filter: field.filter,
            shortest: field.shortest.map(|map| map.to_owned()),
            lap: field.lap.map(|lap| ([lap.drift, lap.shift].map(|one| one.to_owned()), lap.part)),
        }
    }

    fn field(&self) -> Field<'_> {
        let [drift, shift, velocity, shift_rate] = &self.vectors;
        Field {
            shape: self.shape,
            tile: self.tile,
            overlap: self.overlap,
            blend: self.blend,
            band: self.band,
            seed: self.seed,
            jitter: self.jitter,
            ring_edges: &self.ring_edges,
            ring_gains: &self.ring_gains,
            drift: drift.view(),
            shift: shift.view(),
            velocity: velocity.view(),
            shift_rate: shift_rate.view(),
            filter: self.filter,
            shortest: self.shortest.as_ref().map(|map| map.view()),
            lap: self.lap.as_ref().map(|([drift, shift], part)| Lap {
                drift: drift.view(),
                shift: shift.view(),
                part: *part,
            }),
        }
    }
}

/// One worker's columns.
struct Columns<T: Real> {
    width: usize,
    strip: Strip<T>,
    waiting: Waiting<T>,
}

/// Rows that are finished and wait to be asked for.
struct Waiting<T> {
    width: usize,
    values: Vec<T>,
    rows: Range<usize>,
}

impl<T: Real> Target<T> for Waiting<T> {
    fn room(&mut self, rows: &Range<usize>) -> &mut [T] {
        &mut self.values[..rows.len() * self.width]
    }

    fn done(&mut self, rows: Range<usize>) -> Result<(), Error> {
        self.rows = rows;
        Ok(())
    }
}

impl<T: Real> Columns<T> {
    fn new(
        ready: &Ready<'_, '_, T>,
        window: &Window,
        cols: Range<usize>,
        mapped: Option<Mapped>,
    ) -> Result<Self, Error> {
        let (start, width) = (window.rows.start, cols.len());
        let most = ready.field.tile.0.min(window.rows.len()) * width;
        let waiting =
            Waiting { width, values: crate::base::error::zeroed(most)?, rows: start..start };
        let strip = Strip::new(ready, window.rows.clone(), cols, mapped)?;
        Ok(Self { width, strip, waiting })
    }

    fn take(
        &mut self,
        ready: &Ready<'_, '_, T>,
        rows: Range<usize>,
        mut out: ArrayViewMut2<'_, T>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let mut y = rows.start;
        while y < rows.end {
            if y >= self.waiting.rows.end {
                if self.strip.ended() {
                    return Err(Error::Internal("a field has no more rows".into()));
                }
                self.strip.row_of_tiles(ready, &mut self.waiting, cancel)?;
                continue;
            }
            let from = (y - self.waiting.rows.start) * self.width;
            let line = out.row_mut(y - rows.start).into_slice();
            line.ok_or_else(|| Error::Internal("rows are not contiguous".into()))?
                .copy_from_slice(&self.waiting.values[from..from + self.width]);
            y += 1;
        }
        Ok(())
    }
}

/// The rows of a window that have not been taken yet.
pub struct TopDown<T: Real> {
    stored: Stored,
    parts: Arc<Parts<T>>,
    lines: (Row, Row),
    rows: Range<usize>,
    width: usize,
    columns: Vec<Columns<T>>,
}

impl<T: Real> TopDown<T> {
    /// The rows of a window of a field, or of its opacity.
    pub fn new(field: &Field<'_>, window: &Window, mapped: Option<Mapped>) -> Result<Self, Error> {
        let ready = field.ready::<T>()?;
        let mut columns = Vec::new();
        for cols in runs(&ready.across, &window.cols) {
            columns.push(Columns::new(&ready, window, cols, mapped)?);
        }
        Ok(Self {
            parts: Arc::clone(&ready.parts),
            lines: (ready.down, ready.across),
            stored: Stored::of(field),
            rows: window.rows.clone(),
            width: window.cols.len(),
            columns,
        })
    }

    /// Image rows that are left.
    pub fn left(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Writes image rows from `first` on, as many as `out` (h, width) has; those before it are skipped.
    /// Returns how many tiles were transformed.
    ///
    /// They have the bits of [`Ready::render`]. After an error the rest is of no use.
    pub fn take(
        &mut self,
        first: usize,
        out: ArrayViewMut2<'_, T>,
        cancel: &Cancel,
    ) -> Result<usize, Error> {
        let (height, width) = out.dim();
        let rows = first..first.saturating_add(height);
        if first < self.rows.start || rows.end > self.rows.end || width != self.width {
            let (left, wanted) = (&self.rows, &rows);
            return Err(Error::Internal(format!(
                "rows {left:?} of {} px are left, not {wanted:?} of {width}",
                self.width
            )));
        }
        let field = self.stored.field();
        let ready = Ready {
            field: &field,
            down: self.lines.0,
            across: self.lines.1,
            parts: Arc::clone(&self.parts),
            transformed: AtomicUsize::new(0),
        };
        let mut tasks = Vec::new();
        let mut rest = out;
        for columns in &mut self.columns {
            let (part, right) = rest.split_at(Axis(1), columns.width);
            rest = right;
            tasks.push((columns, part));
        }
        pool::for_each(tasks, |(columns, part)| columns.take(&ready, rows.clone(), part, cancel))?;
        self.rows.start = rows.end;
        Ok(ready.transformed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::filter::Alias;
    use crate::spectral::opacity::Opacity;
    use ndarray::s;

    #[test]
    fn bands_have_the_bits_of_the_whole() {
        let still = Array4::zeros((1, 1, 1, 2));
        let moved = Array4::from_shape_vec((1, 1, 1, 2), vec![3.0, -7.5]).unwrap();
        let opacity = Opacity { mean: 0.2, spread: 2.0, power: 2.0, amount: 0.8 };
        for (tile, overlap) in [(16, 3), (16, 15), (11, 7), (50, 0)] {
            let field = Field {
                shape: (70, 83),
                tile: (tile, tile),
                overlap,
                blend: Blend::Power,
                band: Band { shortest: 2.0, longest: 8.0, exponent: 1.0 },
                seed: 5,
                jitter: true,
                ring_edges: &[],
                ring_gains: &[],
                drift: moved.view(),
                shift: still.view(),
                velocity: moved.view(),
                shift_rate: still.view(),
                lap: None,
                filter: TemporalFilter { alias: Alias::Soft, soft_from: 0.4, shutter: 0.5 },
                shortest: None,
            };
            let ready = field.ready::<f32>().unwrap();
            for map in [None, Some(Mapped { map: opacity, preserve_mean: true })] {
                for window in
                    [Window { rows: 0..70, cols: 0..83 }, Window { rows: 9..61, cols: 20..80 }]
                {
                    let (height, width) = (window.rows.len(), window.cols.len());
                    let mut whole = Array2::from_elem((height, width), f32::NAN);
                    let cancel = Cancel::new();
                    ready.render(&window, whole.view_mut(), map, &cancel).unwrap();
                    for step in [1, 7, 40, 100] {
                        let mut bands = TopDown::new(&field, &window, map).unwrap();
                        let mut made = 0;
                        for top in (0..height).step_by(step) {
                            let bottom = (top + step).min(height);
                            let mut out = Array2::from_elem((bottom - top, width), f32::NAN);
                            let first = window.rows.start + top;
                            if step == 7 && top == 7 {
                                continue;
                            }
                            made += bands.take(first, out.view_mut(), &cancel).unwrap();
                            assert_eq!(out, whole.slice(s![top..bottom, ..]));
                        }
                        assert!(bands.left().is_empty());
                        let touched =
                            |n: Row, of: &Range<usize>| n.touching(of.start, of.end).len();
                        let (down, across) = (
                            touched(ready.down, &window.rows),
                            touched(ready.across, &window.cols),
                        );
                        // Tiles between two workers are made by both, and no others twice.
                        let twice = (pool::threads() - 1) * tile.div_ceil(tile - overlap);
                        assert!(made <= down * (across + twice), "{made}");
                        let mut more = Array2::zeros((1, width));
                        assert!(bands.take(window.rows.end, more.view_mut(), &cancel).is_err());
                        assert!(bands.take(window.rows.start, more.view_mut(), &cancel).is_err());
                    }
                }
            }
        }
    }
}
