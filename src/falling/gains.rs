//! Clumps of far flakes: factors of layers' optical depths at the nodes of a lattice, linear between them.

use ndarray::ArrayView3;

use super::bent::APART;
use crate::base::error::Error;

/// Factors of optical depths by place, for groups of layers one after the other.
#[derive(Clone, Copy)]
pub struct Gains<'a> {
    /// Of each group, (groups, rows, columns), at the nodes of a lattice over the whole picture.
    pub nodes: ArrayView3<'a, f32>,
    /// Layers of each group.
    pub counts: &'a [usize],
    /// The picture's row and column of the first pixel.
    pub corner: (usize, usize),
}

impl Gains<'_> {
    pub fn check(&self, (height, width): (usize, usize), layers: usize) -> Result<(), Error> {
        let (groups, rows, cols) = self.nodes.dim();
        let fits = groups == self.counts.len()
            && self.counts.iter().sum::<usize>() == layers
            && rows >= (self.corner.0 + height) / APART + 3
            && cols >= (self.corner.1 + width) / APART + 3;
        if fits { Ok(()) } else { Err(Error::Internal("no gains look like that".into())) }
    }

    /// Adds a group's sums along a row, each times the factor of its place.
    #[inline(always)]
    pub fn add(&self, group: usize, at: (usize, usize), out: &mut [f32], sums: &[f32]) {
        let (y, x) = (self.corner.0 + at.0, self.corner.1 + at.1);
        let down = (y % APART) as f32 / APART as f32;
        let node = |col: usize| {
            let [low, high] = [1, 2].map(|row| self.nodes[[group, y / APART + row, col]]);
            low + down * (high - low)
        };
        let mut done = 0;
        while done < out.len() {
            let (col, from) = ((x + done) / APART, (x + done) % APART);
            let run = (APART - from).min(out.len() - done);
            let (low, high) = (node(col + 1), node(col + 2));
            let slope = (high - low) / APART as f32;
            let pixels = out[done..done + run].iter_mut().zip(&sums[done..]);
            for (step, (out, sum)) in (from as i32..).zip(pixels) {
                *out += sum * (low + slope * step as f32);
            }
            done += run;
        }
    }
}
