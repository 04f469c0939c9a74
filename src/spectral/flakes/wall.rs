//! What of a tile is seen before a scene: groups of layers, each as far as its pixels see.
//!
//! In most tiles most groups lie wholly before the scene or wholly behind it. The first are one sum of
//! waves, the second are nothing; only a group that the scene cuts is transformed by itself.

use ndarray::{ArrayView1, ArrayView2, ArrayView3};

use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::normal::{Normal, least, most};
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// A scene's depth, and how terms of a tile are grouped before it.
#[derive(Debug, Clone)]
pub struct Wall<'a> {
    /// (H, W) of the whole frame.
    pub depth: ArrayView2<'a, f32>,
    /// (n,): the group of each term.
    pub group: ArrayView1<'a, i32>,
    /// (E,): rising depths.
    pub edges: ArrayView1<'a, f64>,
    /// (G, E): the share of a group's depth that lies before these: even between two, constant beyond.
    pub shares: ArrayView2<'a, f64>,
    /// (rows, cols, G), or (1, 1, G): mean optical depth of each group.
    pub mean: ArrayView3<'a, f64>,
}

/// How a group is seen in a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// By no pixel.
    Never,
    /// By some pixels, or in part.
    Partly,
    /// Wholly, by all of them.
    Wholly,
}

impl Wall<'_> {
    /// Refuses arrays that don't fit each other, the frame, its tiles and so many terms.
    pub fn checked(
        &self,
        shape: (usize, usize),
        tiles: (usize, usize),
        terms: usize,
    ) -> Result<(), Error> {
        let groups = self.groups();
        let known = |&group: &i32| (0..groups as i32).contains(&group);
        let fits = |(rows, cols, count): (usize, usize, usize)| {
            (rows == 1 || rows == tiles.0) && (cols == 1 || cols == tiles.1) && count == groups
        };
        let rising = self.edges.iter().zip(self.edges.iter().skip(1)).all(|(a, b)| a < b);
        for (name, fine, wanted) in [
            ("depth", self.depth.dim() == shape, "must have the shape of the frame"),
            ("group", self.group.len() == terms, "must be one for each term"),
            ("group", self.group.iter().all(known), "must be one of the groups"),
            ("edges", !self.edges.is_empty() && rising, "must be rising depths"),
            ("shares", self.shares.ncols() == self.edges.len(), "must have a column for each edge"),
            ("mean", fits(self.mean.dim()), "must be of the tiles and the groups"),
        ] {
            if !fine {
                return Err(Error::invalid(name, wanted));
            }
        }
        Ok(())
    }

    /// How many groups there are.
    pub fn groups(&self) -> usize {
        self.shares.nrows()
    }

    /// A group's mean in a tile.
    pub fn mean(&self, tile: (usize, usize), group: usize) -> f64 {
        let (rows, cols, _) = self.mean.dim();
        self.mean[(tile.0.min(rows - 1), tile.1.min(cols - 1), group)]
    }

    /// The share of a group that lies before a depth.
    fn before(&self, group: usize, depth: f64) -> f64 {
        let (edges, shares) = (&self.edges, self.shares.row(group));
        let above = edges.iter().take_while(|&&edge| edge <= depth).count();
        if above == 0 || above == edges.len() {
            return shares[above.saturating_sub(1)];
        }
        let part = (depth - edges[above - 1]) / (edges[above] - edges[above - 1]);
        shares[above - 1] + part * (shares[above] - shares[above - 1])
    }
}

/// A worker's buffers for the depths of a tile.
pub struct Depths<T> {
    depth: Aligned<T>,
    shares: Aligned<T>,
    /// The pixels of one group.
    pub part: Aligned<T>,
    nearest: f64,
    farthest: f64,
}

impl<T: Normal> Depths<T> {
    /// For so many pixels; `margin` more of a part can be read.
    pub fn new(count: usize, margin: usize) -> Result<Self, Error> {
        Ok(Self {
            depth: Aligned::zeroed(count)?,
            shares: Aligned::zeroed(count)?,
            part: Aligned::zeroed(count + margin)?,
            nearest: 0.0,
            farthest: 0.0,
        })
    }

    /// Reads the depths of a tile of so many pixels a side; what lies outside the frame is as far as the
    /// nearest pixel.
    pub fn read(&mut self, wall: &Wall<'_>, (top, left): (usize, usize), tile: usize) {
        let (height, width) = wall.depth.dim();
        let (rows, cols) = (tile.min(height - top), tile.min(width - left));
        let (mut nearest, mut farthest) = (f32::INFINITY, f32::NEG_INFINITY);
        for y in 0..rows {
            let line = &mut self.depth[y * tile..][..cols];
            for (x, pixel) in line.iter_mut().enumerate() {
                let depth = wall.depth[(top + y, left + x)];
                (nearest, farthest) = (nearest.min(depth), farthest.max(depth));
                *pixel = T::of(f64::from(depth));
            }
        }
        let outside = T::of(f64::from(nearest));
        for y in 0..tile {
            let from = if y < rows { cols } else { 0 };
            self.depth[y * tile..][from..tile].fill(outside);
        }
        (self.nearest, self.farthest) = (f64::from(nearest), f64::from(farthest));
    }

    /// How a group is seen in the tile: shares rise with depth.
    pub fn seen(&self, wall: &Wall<'_>, group: usize) -> Seen {
        match (wall.before(group, self.nearest), wall.before(group, self.farthest)) {
            (_, most) if most <= 0.0 => Seen::Never,
            (least, _) if least >= 1.0 - 1e-9 => Seen::Wholly,
            _ => Seen::Partly,
        }
    }

    /// Adds what the pixels see of a group that lies in `part`.
    pub fn add_seen(&mut self, wall: &Wall<'_>, group: usize, pixels: &mut [T]) {
        let count = pixels.len();
        let shares = &mut self.shares[..count];
        shares.fill(T::of(wall.before(group, self.nearest)));
        for (k, (&low, &high)) in wall.edges.iter().zip(wall.edges.iter().skip(1)).enumerate() {
            let slope = (wall.shares[(group, k + 1)] - wall.shares[(group, k)]) / (high - low);
            let (low, high) = (low.max(self.nearest), high.min(self.farthest));
            if low < high && slope != 0.0 {
                climb(shares, &self.depth, (T::of(low), T::of(high)), T::of(slope));
            }
        }
        add_product(pixels, shares, &self.part);
    }
}

/// Adds to shares what lies between two depths.
#[inline(always)]
fn climb_with<T: Normal, const LEVEL: u8>(shares: &mut [T], at: &[T], ends: (T, T), slope: T) {
    for (share, &depth) in shares.iter_mut().zip(at) {
        *share += slope * (least(most(depth, ends.0), ends.1) - ends.0);
    }
}

#[inline(always)]
fn add_product_with<T: Real, const LEVEL: u8>(pixels: &mut [T], shares: &[T], part: &[T]) {
    for ((pixel, &share), &part) in pixels.iter_mut().zip(shares).zip(part) {
        *pixel += share * part;
    }
}

dispatch! {
    fn climb<T: Normal>(shares: &mut [T], at: &[T], ends: (T, T), slope: T) = climb_with
}
dispatch! {
    fn add_product<T: Real>(pixels: &mut [T], shares: &[T], part: &[T]) = add_product_with
}
