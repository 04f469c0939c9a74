//! The spectrum of one tile: every wave's phase, reduced, and its amplitude after the filter.
//!
//! Waves stand in rows of one ky, so that loops without branches do them all on vector lanes; places
//! of the rows that the band leaves out have amplitude 0.

use super::filter::{Alias, LANES, TemporalFilter, fill_gains};
use super::tent::Motion;
use super::waves::{Draw, Waves};
use crate::base::aligned::Aligned;
use crate::base::error::{Error, collected, zeroed};
use crate::base::random::mix64;
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// Places in a row for so many columns: whole lanes.
pub const fn columns_padded(columns: usize) -> usize {
    columns.div_ceil(LANES) * LANES
}

/// The waves of a band by rows: ky = 0 .. half, then ky = 0, -1 .. -half + 1 (the second row of
/// ky = 0 stays empty); in a row kx = 0 .. stride.
pub struct Columns {
    half: usize,
    stride: usize,
    /// Signed index of each row, cycles per pixel, and cycles that the transform's sampling takes.
    ky: Vec<i64>,
    row_frequency: Vec<f64>,
    row_offset: Vec<f64>,
    kx: Vec<i64>,
    column_frequency: Vec<f64>,
    column_offset: Vec<f64>,
    /// Unit vectors of the tent.
    tent_y: Aligned<f64>,
    tent_x: Aligned<f64>,
    amplitude: Aligned<f64>,
    wavelength: Aligned<f64>,
    ring: Vec<u32>,
    power: f64,
}

/// Buffers that [`Columns::spectrum`] fills: one value for each place.
pub struct Values<T> {
    /// Real part of each leader's bin, and of the mirrors in the column of kx = 0.
    pub re: Aligned<T>,
    pub im: Aligned<T>,
    phase: Aligned<f64>,
    gain: Aligned<f64>,
    rounded: Aligned<T>,
    tent: (Aligned<f64>, Aligned<f64>),
    // Of the last tile, whose phases and gains serve the next one if it moves alike.
    place: Vec<[f64; 2]>,
    rate: Vec<Motion>,
    shortest: f64,
    power: Power,
    // By row: the hash with ky, and the phase's part that depends on ky alone.
    hash: Vec<u64>,
    row_phase: Vec<f64>,
    column_phase: Aligned<f64>,
}

/// What a tile is asked for. Slices have one entry per ring.
#[derive(Clone, Copy)]
pub struct TileMotion<'a> {
    /// Displacements since time 0; one shift for all rings.
    pub place: &'a [Motion],
    /// Of a film that begins again: displacements over all of it, and how much of it has passed.
    pub lap: Option<(&'a [Motion], f64)>,
    /// Displacements per frame.
    pub rate: &'a [Motion],
    pub filter: TemporalFilter,
    /// Waves up to this wavelength are left out (a depth limit); 0 leaves out none.
    pub shortest: f64,
}

/// Power of the waves of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Power {
    /// Of the waves within the depth limit.
    pub present: f64,
    /// What the filter kept of it.
    pub kept: f64,
}

impl Columns {
    /// The rows of a list of waves; `offset(k, n)` is the phase that the transform wants taken off
    /// for an index along an axis of n pixels.
    pub fn new(waves: &Waves, offset: impl Fn(i64, usize) -> f64) -> Result<Self, Error> {
        let (height, width) = waves.tile;
        let (half, stride) = (waves.reach + 1, columns_padded(waves.columns));
        let ky = collected((0..2 * half).map(|row| {
            let k = (row % half) as i64;
            if row < half { k } else { -k }
        }))?;
        let kx = collected((0..stride).map(|k| k as i64))?;
        let size = 2 * half * stride;
        let mut columns = Self {
            half,
            stride,
            row_frequency: collected(ky.iter().map(|&k| k as f64 / height as f64))?,
            row_offset: collected(ky.iter().map(|&k| offset(k, height)))?,
            column_frequency: collected(kx.iter().map(|&k| k as f64 / width as f64))?,
            column_offset: collected(kx.iter().map(|&k| offset(k, width)))?,
            ky,
            kx,
            tent_y: Aligned::zeroed(size)?,
            tent_x: Aligned::zeroed(size)?,
            amplitude: Aligned::zeroed(size)?,
            wavelength: Aligned::zeroed(size)?,
            ring: zeroed(size)?,
            power: waves.list.iter().map(|wave| 2.0 * wave.amplitude * wave.amplitude).sum(),
        };
        for wave in &waves.list {
            let at = columns.place(wave.ky, wave.kx);
            (columns.tent_y[at], columns.tent_x[at]) = wave.direction;
            columns.amplitude[at] = wave.amplitude;
            columns.wavelength[at] = wave.wavelength;
            columns.ring[at] = wave.ring as u32;
        }
        Ok(columns)
    }

    pub const fn len(&self) -> usize {
        2 * self.half * self.stride
    }

    /// Rows of one sign, ky = 0 included, and places in each.
    pub const fn size(&self) -> (usize, usize) {
        (self.half, self.stride)
    }

    pub const fn place(&self, ky: i64, kx: i64) -> usize {
        let row = ky.unsigned_abs() as usize + if ky < 0 { self.half } else { 0 };
        row * self.stride + kx as usize
    }

    /// Completes the column of kx = 0, whose leaders have ky > 0.
    pub fn mirror<T: Real>(&self, re: &mut [T], im: &mut [T]) {
        for row in 1..self.half {
            let (up, down) = (row * self.stride, (self.half + row) * self.stride);
            re[down] = re[up];
            im[down] = -im[up];
        }
    }

    pub fn values<T: Real>(&self) -> Result<Values<T>, Error> {
        let n = self.len();
        Ok(Values {
            re: Aligned::zeroed(n)?,
            im: Aligned::zeroed(n)?,
            phase: Aligned::zeroed(n)?,
            gain: Aligned::zeroed(n)?,
            rounded: Aligned::zeroed(n)?,
            tent: (Aligned::zeroed(n)?, Aligned::zeroed(n)?),
            place: Vec::new(),
            rate: Vec::new(),
            shortest: 0.0,
            power: Power { present: self.power, kept: self.power },
            hash: zeroed(2 * self.half)?,
            row_phase: zeroed(2 * self.half)?,
            column_phase: Aligned::zeroed(self.stride)?,
        })
    }

    /// Fills `values.re` and `values.im` with each leader's bin of a tile.
    pub fn spectrum<T: Real>(
        &self,
        tile: (usize, usize),
        draw: Draw,
        motion: TileMotion<'_>,
        values: &mut Values<T>,
    ) -> Power {
        let drift = motion.place.iter().map(|motion| motion.drift);
        if motion.lap.is_some() {
            // Phases that were bent for another tile serve no other.
            values.place.clear();
        }
        if draw.jitter {
            for (row, &ky) in self.ky.iter().enumerate() {
                for (at, &kx) in (row * self.stride..).zip(&self.kx) {
                    // Places that the band leaves out may have no direction at all.
                    if self.amplitude[at] > 0.0 {
                        let (y, x) = draw.direction(ky, kx, tile);
                        values.tent.0[at] = y;
                        values.tent.1[at] = x;
                    }
                }
            }
            self.steps(motion.place, (&values.tent.0, &values.tent.1), &mut values.phase);
            values.place.clear();
        } else if !drift.clone().eq(values.place.iter().copied()) {
            self.steps(motion.place, (&self.tent_y, &self.tent_x), &mut values.phase);
            values.place.clear();
            values.place.extend(drift);
        }
        if let Some((whole, part)) = motion.lap {
            let Values { tent, phase, .. } = values;
            let own = (&tent.0[..], &tent.1[..]);
            let tent = if draw.jitter { own } else { (&self.tent_y[..], &self.tent_x[..]) };
            self.bend(whole, part, tent, phase);
        }
        if self.gains(draw.jitter, motion, values) {
            let rounded = values.rounded.iter_mut().zip(&values.gain[..]);
            rounded.for_each(|(rounded, &gain)| *rounded = T::of(gain));
        }
        let shift = motion.place.first().map_or([0.0; 2], |motion| motion.shift);
        let rows = values.row_phase.iter_mut().zip(&self.row_frequency).zip(&self.row_offset);
        for ((out, frequency), offset) in rows {
            *out = -(shift[1] * frequency) - offset;
        }
        let columns = values.column_phase.iter_mut().zip(&self.column_frequency);
        for ((out, frequency), offset) in columns.zip(&self.column_offset) {
            *out = -(shift[0] * frequency) - offset;
        }
        for (hash, &ky) in values.hash.iter_mut().zip(&self.ky) {
            *hash = mix64(draw.bits() ^ ky as u64);
        }
        bins::<T>(&self.kx, values);
        self.mirror(&mut values.re, &mut values.im);
        values.power
    }

    /// The tent's phase steps of all places.
    fn steps(&self, motions: &[Motion], tent: (&[f64], &[f64]), out: &mut [f64]) {
        match motions {
            [one] => tent_steps(one.drift, tent.0, tent.1, out),
            rings => {
                for (i, out) in out.iter_mut().enumerate() {
                    *out = rings[self.ring[i] as usize].step((tent.0[i], tent.1[i]), (0.0, 0.0));
                }
            }
        }
    }

    /// Bends phases so that each wave has turned by a whole number of cycles when the film ends: the
    /// nearest one, at one rate.
    fn bend(&self, whole: &[Motion], part: f64, tent: (&[f64], &[f64]), phase: &mut [f64]) {
        let rows = phase.chunks_exact_mut(self.stride).zip(&self.row_frequency);
        for (row, (phases, fy)) in rows.enumerate() {
            for (at, (phase, fx)) in
                (row * self.stride..).zip(phases.iter_mut().zip(&self.column_frequency))
            {
                let motion = &whole[if whole.len() == 1 { 0 } else { self.ring[at] as usize }];
                let cycles = motion.step((tent.0[at], tent.1[at]), (*fy, *fx));
                *phase += part * (cycles.round_ties_even() - cycles);
            }
        }
    }

    /// Amplitudes after the filter and the depth limit, and their power.
    /// Returns whether they are other ones than before.
    fn gains<T: Real>(&self, jitter: bool, motion: TileMotion<'_>, values: &mut Values<T>) -> bool {
        let TemporalFilter { alias, shutter, .. } = motion.filter;
        let open = alias == Alias::Keep && shutter == 0.0 && motion.shortest <= 0.0;
        let shortest = motion.shortest.max(0.0);
        let alike =
            values.shortest == shortest && (open || (!jitter && values.rate[..] == *motion.rate));
        if !values.rate.is_empty() && alike {
            return false;
        }
        values.rate.clear();
        values.rate.extend(motion.rate);
        values.shortest = shortest;
        if open {
            values.gain.copy_from_slice(&self.amplitude);
            values.power = Power { present: self.power, kept: self.power };
            return true;
        }
        let tent = if jitter {
            (&values.tent.0[..], &values.tent.1[..])
        } else {
            (&self.tent_y[..], &self.tent_x[..])
        };
        self.steps(motion.rate, tent, &mut values.gain);
        let shift = motion.rate.first().map_or([0.0; 2], |motion| motion.shift);
        if shift != [0.0; 2] {
            let rows = values.gain.chunks_exact_mut(self.stride).zip(&self.row_frequency);
            for (rates, fy) in rows {
                for (rate, fx) in rates.iter_mut().zip(&self.column_frequency) {
                    *rate -= shift[0] * fx + shift[1] * fy;
                }
            }
        }
        values.power = gain_lanes(
            motion.filter,
            motion.shortest,
            &self.amplitude,
            &self.wavelength,
            &mut values.gain,
        );
        if motion.shortest <= 0.0 {
            values.power.present = self.power;
        }
        true
    }
}

#[dispatch]
fn tent_steps<const LEVEL: u8>(drift: [f64; 2], tent_y: &[f64], tent_x: &[f64], out: &mut [f64]) {
    let motion = Motion { drift, shift: [0.0; 2] };
    for ((out, &ty), &tx) in out.iter_mut().zip(tent_y).zip(tent_x) {
        *out = motion.step((ty, tx), (0.0, 0.0));
    }
}

/// Rates to amplitudes, in place; sums run over lanes, in one order for every level.
#[dispatch]
fn gain_lanes<const LEVEL: u8>(
    filter: TemporalFilter,
    shortest: f64,
    amplitude: &[f64],
    wavelength: &[f64],
    values: &mut [f64],
) -> Power {
    fill_gains::<LEVEL>(filter, values);
    let limited =
        |amplitude: f64, wavelength: f64| if wavelength > shortest { amplitude } else { 0.0 };
    for (value, (amplitude, wavelength)) in values.iter_mut().zip(amplitude.iter().zip(wavelength))
    {
        *value *= limited(*amplitude, *wavelength);
    }
    // One sum after the other: of two in one loop the compiler makes no vectors.
    let (mut present, mut kept) = ([0.0; LANES], [0.0; LANES]);
    for values in values.chunks_exact(LANES) {
        for i in 0..LANES {
            kept[i] += values[i] * values[i];
        }
    }
    let places = amplitude.chunks_exact(LANES).zip(wavelength.chunks_exact(LANES));
    for (amplitude, wavelength) in places {
        for i in 0..LANES {
            let full = limited(amplitude[i], wavelength[i]);
            present[i] += full * full;
        }
    }
    Power { present: 2.0 * present.iter().sum::<f64>(), kept: 2.0 * kept.iter().sum::<f64>() }
}

/// Bins from phases: hash, add, reduce in float64; then turn and scale in the pixels' precision, on
/// twice the lanes if that is float32.
#[dispatch]
fn bins<const LEVEL: u8, T: Real>(kx: &[i64], values: &mut Values<T>) {
    let stride = kx.len();
    let rows = values.re.chunks_exact_mut(stride).zip(values.phase.chunks_exact(stride));
    let by_row = values.hash.iter().zip(&values.row_phase);
    for ((reduced, phase), (&hash, &row_phase)) in rows.zip(by_row) {
        let (phase, column_phase) = (&phase[..stride], &values.column_phase[..stride]);
        let reduced = &mut reduced[..stride];
        for i in 0..stride {
            let hash = mix64(hash ^ kx[i] as u64);
            // 52 of the hash's bits as the fraction of a number in [1, 2): the 53rd is below any
            // pixel's precision, and this conversion has a vector form everywhere.
            let turns = f64::from_bits((hash >> 12) | 0x3FF0_0000_0000_0000)
                + (phase[i] + (row_phase + column_phase[i]));
            reduced[i] = T::of(turns - turns.round_ties_even());
        }
    }
    let n = values.re.len();
    let (re, im, gain) = (&mut values.re[..n], &mut values.im[..n], &values.rounded[..n]);
    for i in 0..n {
        let turn = T::turn::<LEVEL>(re[i]);
        re[i] = turn.re * gain[i];
        im[i] = turn.im * gain[i];
    }
}
