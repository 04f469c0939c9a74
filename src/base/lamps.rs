//! Lamps and suns: the radiance that a small particle sends to the eye.
//!
//! radiance = albedo * phase(angle) * irradiance * exp(-air's extinction * way), both ways, the phase function of Henyey and Greenstein (1941)
//! per steradian, so that light of radiance L from all sides makes a particle of radiance albedo * L.

use super::error::Error;
use super::normal::{Normal, least};
use super::pixel::{dot, smoothstep};
use super::simd::dispatch;

#[derive(Debug, Clone, Copy)]
pub struct Lamp {
    /// Where it is; of a sun nothing.
    pub place: Option<[f64; 3]>,
    /// The way of a sun's light, or the axis of a spot: a unit vector.
    pub way: [f64; 3],
    /// Radiant intensity, light times square metres; of a sun the irradiance.
    pub color: [f64; 3],
    /// Cosines of the angles up to which a spot is whole, and from which on it is dark; (-1, -1) for
    /// light to all sides.
    pub cone: (f64, f64),
    /// Its radius, metres: nothing is lit more than at its surface.
    pub radius: f64,
    /// Extinction of the air from it to a particle, and from there to the eye, per metre.
    pub air: (f64, f64),
}

/// All lamps of a frame, and what particles do with their light.
#[derive(Debug, Clone)]
pub struct Lamps {
    pub lamps: Vec<Lamp>,
    /// Mean cosine between the ways of light before and after.
    pub asymmetry: f64,
    /// Share of light that goes on.
    pub albedo: f64,
    pub eye: [f64; 3],
}

/// Numbers of a lamp in a row: kind (0 lamp, 1 sun), place, way, color, cosines, radius, air.
pub const ROW: usize = 15;

impl Lamps {
    /// Lamps of rows of numbers.
    pub fn of(rows: &[f64], asymmetry: f64, albedo: f64, eye: [f64; 3]) -> Result<Self, Error> {
        if !rows.len().is_multiple_of(ROW) || rows.iter().any(|v| !v.is_finite()) {
            return Err(Error::Internal("no lamps look like that".into()));
        }
        let three = |row: &[f64], at: usize| [row[at], row[at + 1], row[at + 2]];
        let lamps = rows
            .chunks_exact(ROW)
            .map(|row| Lamp {
                place: (row[0] == 0.0).then(|| three(row, 1)),
                way: three(row, 4),
                color: three(row, 7),
                cone: (row[10], row[11]),
                radius: row[12],
                air: (row[13], row[14]),
            })
            .collect();
        Ok(Self { lamps, asymmetry, albedo, eye })
    }

    /// The phase function per steradian, times the albedo.
    #[inline(always)]
    pub fn phase<P: Normal>(&self, cosine: P) -> P {
        let (g, one) = (P::of(self.asymmetry), P::one());
        let base = one + g * g - (g + g) * cosine;
        P::of(self.albedo / (4.0 * std::f64::consts::PI)) * (one - g * g) / (base * base.sqrt())
    }
}

/// Particles at a time.
const LANES: usize = 8;

/// Fills `out` with the radiances of particles at places.
#[dispatch]
pub fn light<const LEVEL: u8>(lamps: &Lamps, points: &[[f64; 3]], out: &mut [[f64; 3]]) {
    for (points, out) in points.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let part = |k: usize, axis: usize| points.get(k).map_or(1.0, |point| point[axis]);
        let lanes = [0, 1, 2].map(|axis| std::array::from_fn(|k| part(k, axis)));
        let found = block::<LANES, LEVEL>(lamps, &lanes);
        out.iter_mut().enumerate().for_each(|(k, out)| *out = at(&found, k));
    }
}

/// The radiances of N particles: red, green and blue. Loops over lanes are plain ones, which vectorise.
#[inline(always)]
fn block<const N: usize, const LEVEL: u8>(lamps: &Lamps, points: &[[f64; N]; 3]) -> [[f64; N]; 3] {
    let (mut back, mut away) = ([[0.0; N]; 3], [0.0; N]);
    for k in 0..N {
        for axis in 0..3 {
            back[axis][k] = lamps.eye[axis] - points[axis][k];
        }
        away[k] = dot(at(&back, k), at(&back, k)).sqrt();
    }
    let mut sum = [[0.0; N]; 3];
    for lamp in &lamps.lamps {
        let (mut way, mut irradiance) = (lamp.way.map(|part| [part; N]), [1.0; N]);
        if let Some(place) = lamp.place {
            let (inner, outer) = lamp.cone;
            let (soft, least) = ((inner - outer).max(1e-9), lamp.radius * lamp.radius);
            for k in 0..N {
                let from = [0, 1, 2].map(|axis| points[axis][k] - place[axis]);
                let square = dot(from, from);
                let distance = square.sqrt().max(1e-9);
                for axis in 0..3 {
                    way[axis][k] = from[axis] / distance;
                }
                let part = (dot(at(&way, k), lamp.way) - outer) / soft;
                let inside = if inner <= -1.0 { 1.0 } else { smoothstep(part) };
                irradiance[k] =
                    inside / square.max(least) * left::<f64, LEVEL>(lamp.air.0 * distance);
            }
        }
        for k in 0..N {
            let along = dot(at(&way, k), at(&back, k)) / away[k];
            let cosine = if away[k] > 0.0 { along } else { 1.0 };
            let radiance = lamps.phase(cosine) * irradiance[k];
            let radiance = radiance * left::<f64, LEVEL>(lamp.air.1 * away[k]);
            for (sum, color) in sum.iter_mut().zip(lamp.color) {
                sum[k] += radiance * color;
            }
        }
    }
    sum
}

/// What air of an optical depth leaves of light.
#[inline(always)]
pub fn left<P: Normal, const LEVEL: u8>(thick: P) -> P {
    P::exp_at::<LEVEL>(-least(thick, P::of(80.0)))
}

#[inline(always)]
fn at<const N: usize>(lanes: &[[f64; N]; 3], k: usize) -> [f64; 3] {
    [lanes[0][k], lanes[1][k], lanes[2][k]]
}
