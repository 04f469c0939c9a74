//! Colors that lie between the middles of cells.

use std::cell::Cell;

use ndarray::ArrayView3;

use crate::base::error::{Error, collected};
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
pub const PIXELS: usize = 512;

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

    /// Each column's color in a row of cells, and what is wanting to the next one's.
    fn cells(&self, row: usize) -> Result<Vec<[f32; 8]>, Error> {
        let colors = pool::line(self.colors, row)?.as_chunks::<3>().0;
        collected((0..colors.len()).map(|cell| {
            let ([r, g, b], next) = (colors[cell], colors[(cell + 1).min(colors.len() - 1)]);
            [r, g, b, 0.0, next[0] - r, next[1] - g, next[2] - b, 0.0]
        }))
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
    /// The rows of cells above and below, pixel by pixel. Few are new.
    sides: [(usize, Vec<[f32; 3]>); 2],
    part: f32,
    pixels: Vec<[f32; 3]>,
}

impl<'a, 'b> Colors<'a, 'b> {
    pub fn new(grid: &'a Grid<'b>, across: &'a [(u32, f32)]) -> Self {
        let first = [0, 1, 2].map(|c| grid.colors[[0, 0, c]]);
        let side = || (usize::MAX, vec![[0.0; 3]; across.len() + 1]);
        let (sides, pixels) = ([side(), side()], vec![first; PIXELS]);
        Self { grid, across, sides, part: 0.0, pixels }
    }

    /// Goes to a row.
    pub fn go(&mut self, row: usize) -> Result<(), Error> {
        // One color is that of all.
        if self.grid.colors.len() == 3 {
            return Ok(());
        }
        let (rows, part) = self.grid.between(self.grid.first.0 + row, self.grid.colors.dim().0);
        self.part = part;
        if self.sides[1].0 == rows[0] {
            self.sides.swap(0, 1);
        }
        for ((held, colors), row) in self.sides.iter_mut().zip(rows) {
            if *held != row {
                blend(colors, self.across, &self.grid.cells(row)?);
                *held = row;
            }
        }
        Ok(())
    }

    /// The colors of so many pixels of the row.
    pub fn some(&mut self, from: usize, count: usize) -> &[[f32; 3]] {
        let pixels = &mut self.pixels[..count];
        if self.grid.colors.len() > 3 {
            let [above, below] = self.sides.each_ref().map(|side| side.1[from..].as_flattened());
            lerp(pixels.as_flattened_mut(), above, below, self.part);
        }
        pixels
    }
}

#[dispatch]
fn lerp<const LEVEL: u8>(out: &mut [f32], above: &[f32], below: &[f32], part: f32) {
    for ((out, above), below) in out.iter_mut().zip(above).zip(below) {
        *out = above + part * (below - above);
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
