//! Lamps and suns: the radiance that a small particle sends to the eye.
//!
//! radiance = albedo * phase(angle) * irradiance, the phase function of Henyey and Greenstein (1941)
//! per steradian, so that light of radiance L from all sides makes a particle of radiance albedo * L.

use super::error::Error;

/// A lamp in the eye's axes.
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
}

/// All lamps of a frame, and what particles do with their light.
#[derive(Debug, Clone)]
pub struct Lamps {
    /// The lamps.
    pub lamps: Vec<Lamp>,
    /// Mean cosine between the ways of light before and after.
    pub asymmetry: f64,
    /// Share of light that goes on.
    pub albedo: f64,
    /// The eye.
    pub eye: [f64; 3],
}

/// Numbers of a lamp in a row: kind (0 lamp, 1 sun), place, way, color, cosines, radius.
pub const ROW: usize = 13;

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
            })
            .collect();
        Ok(Self { lamps, asymmetry, albedo, eye })
    }

    /// The radiance of a particle at a place.
    #[inline]
    pub fn at(&self, point: [f64; 3]) -> [f64; 3] {
        let back: [f64; 3] = std::array::from_fn(|axis| self.eye[axis] - point[axis]);
        let away = dot(back, back).sqrt();
        let g = self.asymmetry;
        let top = self.albedo * (1.0 - g * g) / (4.0 * std::f64::consts::PI);
        let mut sum = [0.0; 3];
        for lamp in &self.lamps {
            let (way, irradiance) = match lamp.place {
                None => (lamp.way, 1.0),
                Some(place) => {
                    let from: [f64; 3] = std::array::from_fn(|axis| point[axis] - place[axis]);
                    let square = dot(from, from);
                    let distance = square.sqrt().max(1e-9);
                    let way = from.map(|part| part / distance);
                    let (inner, outer) = lamp.cone;
                    let inside = if inner <= -1.0 {
                        1.0
                    } else {
                        let part = (dot(way, lamp.way) - outer) / (inner - outer).max(1e-9);
                        super::smooth::smoothstep(part)
                    };
                    (way, inside / square.max(lamp.radius * lamp.radius))
                }
            };
            if irradiance == 0.0 {
                continue;
            }
            let cosine = if away > 0.0 { dot(way, back) / away } else { 1.0 };
            let base = 1.0 + g * g - 2.0 * g * cosine;
            let radiance = top / (base * base.sqrt()) * irradiance;
            (0..3).for_each(|c| sum[c] += radiance * lamp.color[c]);
        }
        sum
    }
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
