//! One whole frame of the field: tiles, their motion, their blend, and what is done with each row.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView4, ArrayViewMut2, Axis};

use super::band::Band;
use super::filter::TemporalFilter;
use super::opacity::Opacity;
use super::phases::{Power, TileMotion};
use super::tent::Motion;
use super::tile::{Choice, Plan};
use super::tiles::{Blend, Row};
use super::waves::{Draw, Waves};
use crate::error::{Cancel, Error, collected, zeroed};
use crate::pool;
use crate::real::Real;
use crate::simd::{dispatch, multiply_add};

/// Vectors (x, y) for all tiles and rings: shape (rows or 1, cols or 1, rings or 1, 2).
pub type Vectors<'a> = ArrayView4<'a, f64>;

/// Everything that defines a frame of the field (api.md, `spectral.field`).
pub struct Field<'a> {
    /// Image size (H, W).
    pub shape: (usize, usize),
    /// Tile size (rows, cols).
    pub tile: (usize, usize),
    /// Pixels shared by neighbouring tiles.
    pub overlap: usize,
    /// How they are mixed.
    pub blend: Blend,
    /// Which waves, how strong.
    pub band: Band,
    /// Random seed.
    pub seed: i64,
    /// Whether tent directions are spread over the bin's cell.
    pub jitter: bool,
    /// Increasing wavelengths; rings + 1 of them, or none for one ring.
    pub ring_edges: &'a [f64],
    /// Relative amplitude of each ring; none leaves them as they are.
    pub ring_gains: &'a [f64],
    /// Displacement of the longest wave, pixels.
    pub drift: Vectors<'a>,
    /// Displacement of all waves alike, pixels.
    pub shift: Vectors<'a>,
    /// Drift per frame.
    pub velocity: Vectors<'a>,
    /// Shift per frame.
    pub shift_rate: Vectors<'a>,
    /// What sampling in time does to the waves.
    pub filter: TemporalFilter,
    /// Per tile, the wavelength up to which waves are left out.
    pub shortest: Option<ArrayView2<'a, f64>>,
}

/// The part of the frame that is wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Window {
    /// Image rows.
    pub rows: Range<usize>,
    /// Image columns.
    pub cols: Range<usize>,
}

/// A field made ready: waves listed, transforms planned, weights computed.
pub struct Ready<'f, 'a, T: Real> {
    field: &'f Field<'a>,
    down: Row,
    across: Row,
    weights: (Vec<T>, Vec<T>),
    plan: Plan<T>,
}

impl<'a> Field<'a> {
    fn rings(&self) -> usize {
        self.ring_edges.len().saturating_sub(1).max(1)
    }

    /// The motions of one tile's rings from a drift and a shift.
    fn motions(
        &self,
        drift: Vectors<'_>,
        shift: Vectors<'_>,
        at: (usize, usize),
        out: &mut [Motion],
    ) {
        // The drift is that of the longest wave; the tent wants it in cycles.
        let cycles = |pixels: f64| pixels / self.band.longest;
        let pick = |v: &Vectors<'_>, ring: usize| {
            let place =
                |index: usize, axis: usize| if v.len_of(Axis(axis)) == 1 { 0 } else { index };
            let (row, col, ring) = (place(at.0, 0), place(at.1, 1), place(ring, 2));
            [v[(row, col, ring, 0)], v[(row, col, ring, 1)]]
        };
        for (ring, motion) in out.iter_mut().enumerate() {
            *motion = Motion { drift: pick(&drift, ring).map(cycles), shift: pick(&shift, ring) };
        }
    }

    /// Checks what the parts cannot check alone, and makes them ready.
    pub fn ready<T: Real>(&self) -> Result<Ready<'_, 'a, T>, Error> {
        let down =
            Row { length: self.shape.0, tile: self.tile.0, overlap: self.overlap }.checked()?;
        let across =
            Row { length: self.shape.1, tile: self.tile.1, overlap: self.overlap }.checked()?;
        self.filter.checked()?;
        if self.ring_edges.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(Error::invalid("ring_edges", "must increase"));
        }
        let grid = (down.count(), across.count());
        let sizes = [
            ("drift", &self.drift),
            ("shift", &self.shift),
            ("velocity", &self.velocity),
            ("shift_rate", &self.shift_rate),
        ];
        for (name, vectors) in sizes {
            let (rows, cols, rings, pair) = vectors.dim();
            let fits = |n: usize, all: usize| n == 1 || n == all;
            if !(fits(rows, grid.0) && fits(cols, grid.1) && fits(rings, self.rings()) && pair == 2)
            {
                let message = format!(
                    "this frame has {} x {} tiles and {} rings, got vectors for {rows} x {cols} and {rings}",
                    grid.0,
                    grid.1,
                    self.rings()
                );
                return Err(Error::invalid(name, message));
            }
        }
        if let Some(shortest) = self.shortest.as_ref().filter(|map| map.dim() != grid) {
            let message = format!("must have shape {grid:?}, got {:?}", shortest.dim());
            return Err(Error::invalid("shortest", message));
        }
        let waves = Waves::new(self.tile, self.band, self.ring_edges)?.weighted(self.ring_gains)?;
        let weights = (down.weights(self.blend)?, across.weights(self.blend)?);
        let plan = Plan::new(&waves, Choice::Cheaper)?;
        Ok(Ready { field: self, down, across, weights, plan })
    }
}

/// The row sums of a stripe of tiles, and of what `preserve_mean` adds to them.
struct Stripe<T> {
    width: usize,
    field: Vec<T>,
    lift: Vec<T>,
}

impl<T: Real> Stripe<T> {
    fn new(height: usize, width: usize, lifted: bool) -> Result<Self, Error> {
        let lift = if lifted { zeroed(height * width)? } else { Vec::new() };
        Ok(Self { width, field: zeroed(height * width)?, lift })
    }

    fn row(&self, y: usize) -> (&[T], Option<&[T]>) {
        let run = y * self.width..(y + 1) * self.width;
        (&self.field[run.clone()], (!self.lift.is_empty()).then(|| &self.lift[run]))
    }

    /// Drops the first `rows` rows and makes room for as many new ones.
    fn advance(&mut self, rows: usize) {
        for buffer in [&mut self.field, &mut self.lift] {
            let done = (rows * self.width).min(buffer.len());
            buffer.copy_within(done.., 0);
            let kept = buffer.len() - done;
            buffer[kept..].fill(T::zero());
        }
    }
}

impl<T: Real> Ready<'_, '_, T> {
    /// Renders the window: `finish(y, field row, lift row, out row)` for every image row y of it.
    ///
    /// `out` has one row per row of the window, of any width that `finish` understands. Each worker
    /// owns a run of rows and adds the tiles that touch it in row-major order, so that the bits of a
    /// pixel depend neither on the threads nor on the window. Tiles across a border between workers
    /// are made by both: fewer than one row of tiles for each worker.
    pub fn render<O: Send>(
        &self,
        window: &Window,
        mut out: ArrayViewMut2<'_, O>,
        lift: Option<&Opacity>,
        cancel: &Cancel,
        finish: impl Fn(usize, &[T], Option<&[T]>, &mut [O]) + Sync + Send,
    ) -> Result<(), Error> {
        let touched = self.down.touching(window.rows.start, window.rows.end);
        let mut tasks = Vec::new();
        for run in pool::split(touched.len(), pool::threads()) {
            let first = touched.start + run.start;
            let last = touched.start + run.end;
            let from = if run.start == 0 { window.rows.start } else { self.down.start(first) };
            let to = if last == touched.end { window.rows.end } else { self.down.start(last) };
            // Many overlapping tiles in a small window: their starts can lie before or behind it.
            let rows = from.clamp(window.rows.start, window.rows.end)
                ..to.clamp(window.rows.start, window.rows.end);
            let (part, rest) = out.split_at(Axis(0), rows.len());
            out = rest;
            if !rows.is_empty() {
                tasks.push((rows, part));
            }
        }
        pool::for_each(tasks, |(rows, part)| {
            self.stripes(rows, &window.cols, part, lift, cancel, &finish)
        })
    }

    fn stripes<O>(
        &self,
        rows: Range<usize>,
        cols: &Range<usize>,
        mut out: ArrayViewMut2<'_, O>,
        lift: Option<&Opacity>,
        cancel: &Cancel,
        finish: &impl Fn(usize, &[T], Option<&[T]>, &mut [O]),
    ) -> Result<(), Error> {
        let rings = self.field.rings();
        let still = || collected((0..rings).map(|_| Motion { drift: [0.0; 2], shift: [0.0; 2] }));
        let (mut place, mut rate) = (still()?, still()?);
        let mut scratch = self.plan.scratch()?;
        let mut stripe = Stripe::new(self.field.tile.0, cols.len(), lift.is_some())?;
        let mut next = rows.start;
        for row in self.down.touching(rows.start, rows.end) {
            for col in self.across.touching(cols.start, cols.end) {
                cancel.check()?;
                let field = self.field;
                field.motions(field.drift, field.shift, (row, col), &mut place);
                field.motions(field.velocity, field.shift_rate, (row, col), &mut rate);
                let motion = TileMotion {
                    place: &place,
                    rate: &rate,
                    filter: field.filter,
                    shortest: field.shortest.as_ref().map_or(0.0, |map| map[(row, col)]),
                };
                let draw = Draw::new(field.seed, (row, col), field.jitter);
                let (pixels, power) = self.plan.render(draw, motion, &mut scratch)?;
                let lift = lift.map(|map| T::of(lost_mean(map, power)));
                self.add(&mut stripe, (row, col), cols, pixels, lift);
            }
            // Rows before the next tile's start are finished.
            let start = self.down.start(row);
            let end = (start + self.down.step()).min(rows.end);
            let end = if row + 1 == self.down.touching(rows.start, rows.end).end {
                rows.end
            } else {
                end
            };
            while next < end {
                let (sum, lift) = stripe.row(next - start);
                let mut line = out.row_mut(next - rows.start);
                let line = line.as_slice_mut().ok_or_else(|| Error::Internal("layout".into()))?;
                finish(next, sum, lift, line);
                next += 1;
            }
            stripe.advance(self.down.step());
        }
        Ok(())
    }

    /// Adds one weighted tile to the stripe that starts at its first row.
    fn add(
        &self,
        stripe: &mut Stripe<T>,
        (row, col): (usize, usize),
        cols: &Range<usize>,
        pixels: &[T],
        lift: Option<T>,
    ) {
        let (tile_height, tile_width) = self.field.tile;
        let start = self.across.start(col);
        // The tile's columns that lie in the window, counted from its own first pixel.
        let from = cols.start.saturating_sub(start);
        let to = (cols.end - start).min(tile_width);
        let offset = start + from - cols.start;
        let wx = &self.weights.1[col * tile_width..][from..to];
        let wy = &self.weights.0[row * tile_height..(row + 1) * tile_height];
        add_rows(&mut stripe.field[offset..], stripe.width, wy, wx, &pixels[from..], tile_width);
        let Some(lift) = lift else { return };
        let linear = self.field.blend == Blend::Linear;
        for (y, &wy) in wy.iter().enumerate() {
            let at = y * stripe.width + offset;
            for (sum, &wx) in stripe.lift[at..at + wx.len()].iter_mut().zip(wx) {
                // Means mix with weights that sum to 1: the squares, in the power law.
                let weight = wy * wx;
                *sum += lift * if linear { weight } else { weight * weight };
            }
        }
    }
}

/// Adds a weighted tile to rows of sums.
#[inline(always)]
fn add_rows_with<T: Real, const LEVEL: u8>(
    sums: &mut [T],
    stride: usize,
    wy: &[T],
    wx: &[T],
    pixels: &[T],
    tile_width: usize,
) {
    for (y, &wy) in wy.iter().enumerate() {
        let sums = &mut sums[y * stride..][..wx.len()];
        let pixels = &pixels[y * tile_width..][..wx.len()];
        for i in 0..wx.len() {
            sums[i] = multiply_add::<T, LEVEL>(wy * wx[i], pixels[i], sums[i]);
        }
    }
}

dispatch! {
    fn add_rows<T: Real>(
        sums: &mut [T],
        stride: usize,
        wy: &[T],
        wx: &[T],
        pixels: &[T],
        tile_width: usize,
    ) = add_rows_with
}

/// The mean opacity that the filter took from a tile.
fn lost_mean(map: &Opacity, power: Power) -> f64 {
    // Nothing lost is the common case, and exactly nothing must be added then.
    if power.kept == power.present {
        return 0.0;
    }
    map.mean_of(power.present) - map.mean_of(power.kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::filter::Alias;
    use ndarray::{Array2, Array4};

    fn with_field<R>(
        shape: (usize, usize),
        tile: usize,
        overlap: usize,
        use_it: impl FnOnce(&Field<'_>) -> R,
    ) -> R {
        let still = Array4::zeros((1, 1, 1, 2));
        let moved = Array4::from_shape_vec((1, 1, 1, 2), vec![3.0, -7.5]).unwrap();
        use_it(&Field {
            shape,
            tile: (tile, tile),
            overlap,
            blend: Blend::Power,
            band: Band { shortest: 2.0, longest: 8.0, exponent: 1.0 },
            seed: 5,
            jitter: false,
            ring_edges: &[],
            ring_gains: &[],
            drift: moved.view(),
            shift: still.view(),
            velocity: still.view(),
            shift_rate: still.view(),
            filter: TemporalFilter { alias: Alias::Keep, soft_from: 0.4, shutter: 0.0 },
            shortest: None,
        })
    }

    fn render(field: &Field<'_>, window: &Window) -> Array2<f64> {
        let mut out = Array2::from_elem((window.rows.len(), window.cols.len()), f64::NAN);
        let ready = field.ready::<f64>().unwrap();
        ready
            .render(window, out.view_mut(), None, &Cancel::new(), |_, row, _, out| {
                out.copy_from_slice(row)
            })
            .unwrap();
        out
    }

    #[test]
    fn a_window_has_the_bits_of_the_whole() {
        for (tile, overlap) in [(16, 3), (16, 15), (11, 7), (50, 0)] {
            with_field((40, 33), tile, overlap, |field| {
                let whole = render(field, &Window { rows: 0..40, cols: 0..33 });
                assert!(whole.iter().all(|z| z.is_finite()));
                for (rows, cols) in [(0..1, 0..1), (7..31, 5..6), (38..40, 20..33), (13..14, 0..33)]
                {
                    let part = render(field, &Window { rows: rows.clone(), cols: cols.clone() });
                    assert_eq!(part, whole.slice(ndarray::s![rows, cols]));
                }
            });
        }
    }

    #[test]
    fn the_frame_is_the_blend_of_its_tiles() {
        use crate::spectral::{band, phase, tent, tiles, transform};
        with_field((40, 33), 16, 5, |field| {
            let whole = render(field, &Window { rows: 0..40, cols: 0..33 });
            let ready = field.ready::<f64>().unwrap();
            let grid = (ready.down.count(), ready.across.count());
            let mut all = Array4::<f64>::zeros((grid.0, grid.1, 16, 16));
            for row in 0..grid.0 {
                for col in 0..grid.1 {
                    let mut amplitude = Array2::zeros((16, 16));
                    band::band_amplitude(amplitude.view_mut(), field.band).unwrap();
                    let mut rest = Array2::zeros((16, 16));
                    phase::random_phase(rest.view_mut(), 5, (row as i64, col as i64));
                    let motion = Motion { drift: [3.0 / 8.0, -7.5 / 8.0], shift: [0.0; 2] };
                    let mut phase = Array2::zeros((16, 16));
                    tent::advance_phase(phase.view_mut(), rest.view(), motion);
                    let tile = all.slice_mut(ndarray::s![row, col, .., ..]);
                    let cancel = Cancel::new();
                    transform::inverse_transform(tile, amplitude.view(), phase.view(), &cancel)
                        .unwrap();
                }
            }
            let mut blended = Array2::zeros((40, 33));
            tiles::blend_tiles(blended.view_mut(), all.view(), 5, Blend::Power).unwrap();
            let worst = (&whole - &blended).iter().fold(0.0_f64, |m, d| m.max(d.abs()));
            assert!(worst < 1e-13, "{worst:e}");
        });
    }
}
