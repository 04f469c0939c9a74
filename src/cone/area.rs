//! The summed-area table of a toroidal texture: the exact mean over any box.
//!
//! Texels are squares of constant value. The integral over a box is a difference of four integrals
//! from the origin, each bilinear between the table's entries. Float64: in float32 the difference of
//! sums of a million texels would have no digits left.

use ndarray::ArrayView2;

use crate::base::error::{Error, zeroed};
use crate::base::real::Real;

/// Integrals of a square texture from the origin, and the texture itself.
pub struct Area {
    size: usize,
    /// (size + 1) x (size + 1): the sum of texels above and to the left.
    sums: Vec<f64>,
    texels: Vec<f64>,
}

/// Splits a coordinate in texels into whole tiles and the rest in [0, size).
#[inline]
fn folded(x: f64, size: f64) -> (f64, f64) {
    let tiles = (x / size).floor();
    let rest = (x - tiles * size).clamp(0.0, size);
    if rest == size { (tiles + 1.0, 0.0) } else { (tiles, rest) }
}

impl Area {
    pub fn of<T: Real>(texture: ArrayView2<T>) -> Result<Self, Error> {
        let (rows, size) = texture.dim();
        if rows != size || size == 0 {
            let message = format!("must be square and not empty, got {rows} x {size}");
            return Err(Error::invalid("tile", message));
        }
        let mut texels = zeroed(size * size)?;
        let mut sums = zeroed((size + 1) * (size + 1))?;
        for (row, line) in texture.rows().into_iter().enumerate() {
            let mut sum = 0.0;
            for (column, &texel) in line.iter().enumerate() {
                let texel = texel.wide();
                texels[row * size + column] = texel;
                sum += texel;
                let above = sums[row * (size + 1) + column + 1];
                sums[(row + 1) * (size + 1) + column + 1] = above + sum;
            }
        }
        Ok(Self { size, sums, texels })
    }

    pub fn size(&self) -> usize {
        self.size
    }

    /// The integral over [0, x) x [0, y), both within the tile.
    #[inline]
    fn inside(&self, x: f64, y: f64) -> f64 {
        let (column, row) = ((x as usize).min(self.size - 1), (y as usize).min(self.size - 1));
        let (across, down) = (x - column as f64, y - row as f64);
        let at = row * (self.size + 1) + column;
        let above = self.sums[at] + across * (self.sums[at + 1] - self.sums[at]);
        let at = at + self.size + 1;
        let below = self.sums[at] + across * (self.sums[at + 1] - self.sums[at]);
        above + down * (below - above)
    }

    /// The integral over the repeated texture from the origin.
    #[inline]
    fn integral(&self, x: (f64, f64), y: (f64, f64)) -> f64 {
        let side = self.size as f64;
        x.0 * y.0 * self.sums[self.sums.len() - 1]
            + x.0 * self.inside(side, y.1)
            + y.0 * self.inside(x.1, side)
            + self.inside(x.1, y.1)
    }

    /// The mean over a box around (x, y), of at least one texel to a side; texels.
    #[inline]
    pub fn mean(&self, x: f64, y: f64, width: f64, height: f64) -> f64 {
        let side = self.size as f64;
        let (width, height) = (width.max(1.0), height.max(1.0));
        // Brought near the origin, so that whole tiles do not cost the digits of the parts.
        let (x, y) = (folded(x, side).1, folded(y, side).1);
        if width == 1.0 && height == 1.0 {
            return self.bilinear(x, y);
        }
        let [left, right] = [x - 0.5 * width, x + 0.5 * width].map(|edge| folded(edge, side));
        let [top, bottom] = [y - 0.5 * height, y + 0.5 * height].map(|edge| folded(edge, side));
        let sum =
            self.integral(right, bottom) - self.integral(left, bottom) - self.integral(right, top)
                + self.integral(left, top);
        sum / (width * height)
    }

    /// A box of one texel: the four texels that it touches, by how much it covers of each.
    #[inline]
    fn bilinear(&self, x: f64, y: f64) -> f64 {
        let size = self.size;
        // The box's left edge lies in the texel before, or in the last one.
        let cut = |edge: f64| {
            let edge = if edge < 0.0 { edge + size as f64 } else { edge };
            let first = (edge as usize).min(size - 1);
            (first, if first + 1 == size { 0 } else { first + 1 }, edge - first as f64)
        };
        let (left, right, across) = cut(x - 0.5);
        let (top, bottom, down) = cut(y - 0.5);
        let row = |row: usize| {
            let line = &self.texels[row * size..][..size];
            line[left] + across * (line[right] - line[left])
        };
        let (above, below) = (row(top), row(bottom));
        above + down * (below - above)
    }
}
