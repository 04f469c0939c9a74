//! The waves of a tile that take part: the leaders of the band, with what each needs for its phase.

use super::band::{Band, Sum};
use super::grid::{Role, direction, magnitude, odd_frequency, role, tile_hash};
use crate::base::error::{Error, pushed};
use crate::base::random::Hash;

/// One pair of bins (k, -k), by its leader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    pub ky: i64,
    /// Signed index along x; never negative here, since the band holds no Nyquist bin.
    pub kx: i64,
    /// Unit vector (y, x) that the tent uses.
    pub direction: (f64, f64),
    /// Cycles per pixel, (y, x).
    pub frequency: (f64, f64),
    /// Amplitude of each of the two bins.
    pub amplitude: f64,
    /// Pixels.
    pub wavelength: f64,
    /// Which entry of the drift applies.
    pub ring: usize,
}

/// The leaders of a band on a tile, sorted by column (kx), then by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Waves {
    /// Tile size (rows, cols).
    pub tile: (usize, usize),
    pub list: Vec<Wave>,
    /// Columns kx = 0 .. columns hold all of them.
    pub columns: usize,
    /// Largest |ky|.
    pub reach: usize,
}

impl Waves {
    /// All leaders of the band. `ring_edges` are increasing wavelengths; waves beyond the outer edges
    /// join the outer rings.
    pub fn new(tile: (usize, usize), band: Band, ring_edges: &[f64]) -> Result<Self, Error> {
        let band = band.checked()?;
        let mut list: Vec<Wave> = Vec::new();
        let mut squares = Sum::default();
        let inner = ring_edges.get(1..ring_edges.len().saturating_sub(1)).unwrap_or(&[]);
        // Leaders of the band lie within |k| < 1 / shortest, kx >= 0.
        let reach = |n: usize| (n as f64 / band.shortest).ceil().min(n as f64 / 2.0) as i64;
        for kx in 0..=reach(tile.1) {
            for ky in -reach(tile.0)..=reach(tile.0) {
                if role(ky, kx, tile) != Role::Leader || !band.holds(ky, kx, tile) {
                    continue;
                }
                let weight = band.weight(ky, kx, tile);
                squares.add(2.0 * weight * weight);
                let wavelength = 1.0 / magnitude(ky, kx, tile);
                let wave = Wave {
                    ky,
                    kx,
                    direction: direction(ky, kx, tile),
                    frequency: odd_frequency(ky, kx, tile),
                    amplitude: weight,
                    wavelength,
                    // Ring r holds edges[r] < wavelength <= edges[r + 1].
                    ring: inner.iter().filter(|&&edge| wavelength > edge).count(),
                };
                pushed(&mut list, wave)?;
            }
        }
        let factor = band.normaliser(squares.value(), tile)?;
        list.iter_mut().for_each(|wave| wave.amplitude *= factor);
        let columns = list.iter().map(|wave| wave.kx as usize + 1).max().unwrap_or(0);
        let reach = list.iter().map(|wave| wave.ky.unsigned_abs() as usize).max().unwrap_or(0);
        Ok(Self { tile, list, columns, reach })
    }

    /// The same waves with amplitudes multiplied by their ring's gain; squares sum to 1 again.
    pub fn weighted(mut self, gains: &[f64]) -> Result<Self, Error> {
        if gains.is_empty() {
            return Ok(self);
        }
        if let Some(bad) = gains.iter().find(|&&gain| !(gain >= 0.0 && gain.is_finite())) {
            let message = format!("must be finite and not negative, got {bad}");
            return Err(Error::invalid("ring_gains", message));
        }
        // A common factor means nothing; without it, no square overflows.
        let largest = gains.iter().fold(0.0_f64, |most, &gain| most.max(gain));
        let mut squares = Sum::default();
        for wave in &mut self.list {
            let few = || format!("must have one number for each ring, got {}", gains.len());
            let gain = gains.get(wave.ring);
            let gain = gain.ok_or_else(|| Error::invalid("ring_gains", few()))?;
            wave.amplitude *= if largest > 0.0 { gain / largest } else { 0.0 };
            squares.add(2.0 * wave.amplitude * wave.amplitude);
        }
        if squares.value() <= 0.0 {
            return Err(Error::invalid("ring_gains", "leave no wave of the tile any power"));
        }
        let factor = 1.0 / squares.value().sqrt();
        self.list.iter_mut().for_each(|wave| wave.amplitude *= factor);
        Ok(self)
    }
}

/// The random state of one tile: phases, and the directions of the jittered tent.
#[derive(Debug, Clone, Copy)]
pub struct Draw {
    hash: Hash,
    /// Whether directions are spread over the bin's cell.
    pub jitter: bool,
}

impl Draw {
    /// The draw of tile (row, col) for a seed.
    pub const fn new(seed: i64, tile: (usize, usize), jitter: bool) -> Self {
        Self { hash: tile_hash(seed, tile.0 as i64, tile.1 as i64), jitter }
    }

    /// The tile's hash, to which each wave adds ky and kx.
    pub const fn bits(&self) -> u64 {
        self.hash.bits()
    }

    /// The unit vector (y, x) that the jittered tent uses: towards a random place of the bin's cell.
    ///
    /// Exactly across the motion the tent's rate is 0, so that on a lattice a share of the power
    /// would stand still; this spreads it.
    #[inline]
    pub fn direction(&self, ky: i64, kx: i64, tile: (usize, usize)) -> (f64, f64) {
        let hash = self.hash.word(ky).word(kx);
        let place =
            |k: i64, n: usize, word: i64| (k as f64 + hash.word(word).unit() - 0.5) / n as f64;
        let (y, x) = (place(ky, tile.0, 2), place(kx, tile.1, 1));
        let length = (y * y + x * x).sqrt();
        (y / length, x / length)
    }
}
