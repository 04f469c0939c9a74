//! Colors that lie between the middles of cells.

use std::cell::Cell;

use ndarray::ArrayView3;

use crate::base::error::Error;
use crate::base::pool;
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

/// Pixels of a row whose colors are asked for at a time: they stay in the first cache.
pub const PIXELS: usize = 256;

impl Grid<'_> {
    /// The cells before and after a pixel, and its place between them.
    fn between(&self, pixel: usize, count: usize) -> ([usize; 2], f32) {
        let last = count.saturating_sub(1);
        let place = ((pixel as f64 + 0.5) / self.cell - 0.5).clamp(0.0, last as f64);
        let first = place.floor() as usize;
        ([first, (first + 1).min(last)], (place - first as f64) as f32)
    }

    /// The cell before each pixel of the layer's rows, and the pixel's place from it to the next.
    pub fn across(&self, width: usize) -> Vec<(u32, f32)> {
        let place = |x| self.between(self.first.1 + x, self.colors.dim().1);
        (0..width).map(place).map(|(cells, part)| (cells[0] as u32, part)).collect()
    }

    pub fn check(&self) -> Result<(), Error> {
        let (rows, columns, channels) = self.colors.dim();
        if rows == 0 || columns == 0 || channels != 3 || self.cell.is_nan() || self.cell <= 0.0 {
            return Err(Error::Internal("no grid of colors looks like that".into()));
        }
        Ok(())
    }
}

/// The colors of a layer's pixels, some of a row at a time.
pub struct Colors<'a, 'b> {
    grid: &'a Grid<'b>,
    across: &'a [(u32, f32)],
    /// Of the row's cells: the color, and what is wanting to the next one's.
    cells: Vec<[f32; 8]>,
    /// Room for one more than are asked for.
    pixels: Vec<[f32; 3]>,
}

impl<'a, 'b> Colors<'a, 'b> {
    pub fn new(grid: &'a Grid<'b>, across: &'a [(u32, f32)]) -> Self {
        let first = [0, 1, 2].map(|c| grid.colors[[0, 0, c]]);
        Self { grid, across, cells: Vec::new(), pixels: vec![first; PIXELS + 1] }
    }

    /// Whether all have the same.
    fn one(&self) -> bool {
        self.grid.colors.len() == 3
    }

    /// Goes to a row.
    pub fn go(&mut self, row: usize) -> Result<(), Error> {
        if self.one() {
            return Ok(());
        }
        let (cells, part) = self.grid.between(self.grid.first.0 + row, self.grid.colors.dim().0);
        let [above, below] = cells.map(|cell| pool::line(self.grid.colors, cell));
        let (above, below) = (above?.as_chunks::<3>().0, below?.as_chunks::<3>().0);
        let color = |cell: usize| {
            [0, 1, 2].map(|c| above[cell][c] + part * (below[cell][c] - above[cell][c]))
        };
        self.cells.clear();
        self.cells.extend((0..above.len()).map(|cell| {
            let ([r, g, b], next) = (color(cell), color((cell + 1).min(above.len() - 1)));
            [r, g, b, 0.0, next[0] - r, next[1] - g, next[2] - b, 0.0]
        }));
        Ok(())
    }

    /// The colors of so many pixels of the row.
    pub fn some(&mut self, from: usize, count: usize) -> &[[f32; 3]] {
        if !self.one() {
            blend(&mut self.pixels, &self.across[from..from + count], &self.cells);
        }
        &self.pixels[..count]
    }
}

/// Colors between those of cells.
#[dispatch]
fn blend<const LEVEL: u8>(out: &mut [[f32; 3]], across: &[(u32, f32)], cells: &[[f32; 8]]) {
    // Four values are a vector: the last is written again as the next pixel's first.
    let out = Cell::from_mut(out.as_flattened_mut()).as_slice_of_cells();
    for (out, &(cell, part)) in out.windows(4).step_by(3).zip(across) {
        let cell = &cells[cell as usize];
        for c in 0..4 {
            out[c].set(cell[c] + part * cell[c + 4]);
        }
    }
}
