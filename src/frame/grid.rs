//! Colors that lie between the middles of cells.

use ndarray::ArrayView3;

use crate::base::error::Error;
use crate::base::simd::dispatch;

/// Colors at the middles of cells of a frame.
pub struct Grid<'a> {
    /// (rows, columns, 3), in the light of the mix.
    pub colors: ArrayView3<'a, f32>,
    /// Side of a cell, px.
    pub cell: f64,
    /// The frame's pixel (row, column) that the layer begins at.
    pub first: (usize, usize),
}

/// Pixels between the same two cells: these, and how far each is from the first to the second.
pub struct Run {
    cells: [usize; 2],
    parts: Vec<f32>,
}

impl Grid<'_> {
    /// The cells before and after a pixel, and its place between them.
    fn between(&self, pixel: usize, count: usize) -> ([usize; 2], f32) {
        let last = count.saturating_sub(1);
        let place = ((pixel as f64 + 0.5) / self.cell - 0.5).clamp(0.0, last as f64);
        let first = place.floor() as usize;
        ([first, (first + 1).min(last)], (place - first as f64) as f32)
    }

    pub fn across(&self, width: usize) -> Vec<Run> {
        let count = self.colors.dim().1;
        let mut runs: Vec<Run> = Vec::new();
        for x in 0..width {
            let (cells, part) = self.between(self.first.1 + x, count);
            match runs.last_mut() {
                Some(run) if run.cells == cells => run.parts.push(part),
                _ => runs.push(Run { cells, parts: vec![part] }),
            }
        }
        runs
    }

    /// The colors of a row of pixels of the layer.
    pub fn row(&self, row: usize, across: &[Run], line: &mut Vec<[f32; 3]>, out: &mut [[f32; 3]]) {
        let (rows, columns, _) = self.colors.dim();
        if rows == 1 && columns == 1 && !line.is_empty() {
            // One color: that of the row before.
            return;
        }
        let ([above, below], part) = self.between(self.first.0 + row, rows);
        line.clear();
        line.extend((0..columns).map(|column| {
            std::array::from_fn(|channel| {
                let low = self.colors[[above, column, channel]];
                low + part * (self.colors[[below, column, channel]] - low)
            })
        }));
        blend(out, across, line);
    }

    pub fn check(&self) -> Result<(), Error> {
        let (rows, columns, channels) = self.colors.dim();
        if rows == 0 || columns == 0 || channels != 3 || self.cell.is_nan() || self.cell <= 0.0 {
            return Err(Error::Internal("no grid of colors looks like that".into()));
        }
        Ok(())
    }
}

/// Colors between those of cells.
#[dispatch]
fn blend<const LEVEL: u8>(out: &mut [[f32; 3]], across: &[Run], line: &[[f32; 3]]) {
    let mut rest = out;
    for run in across {
        let (pixels, after) = rest.split_at_mut(run.parts.len());
        let [low, high] = run.cells.map(|cell| line[cell]);
        let step = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
        for (out, &part) in pixels.iter_mut().zip(&run.parts) {
            for c in 0..3 {
                out[c] = low[c] + part * step[c];
            }
        }
        rest = after;
    }
}
