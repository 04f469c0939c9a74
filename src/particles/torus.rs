//! Where the flakes are: a box that wraps, moving with whoever looks (Langer 2004, section 6).
//!
//! p = c + wrap(B u + v t - c), wrap(x) = x - B floor(x / B + 1/2). No flake is born or dies, nothing
//! runs from frame to frame, and the density is the same everywhere in the box at every time.

use ndarray::{ArrayView1, ArrayView2, ArrayViewMut1, ArrayViewMut2, Axis, aview1};

use crate::base::error::{Cancel, Error, finite};
use crate::base::pixel::smoothstep;
use crate::base::pool;
use crate::base::random::Hash;

/// Separates the flakes' numbers from every other use of the seed.
const STREAM: i64 = i64::from_be_bytes(*b"flakebox");

/// Words after the flake's index: 0, 1, 2 are the axes of the position, these the sway's phases.
const SWAY_X: i64 = 3;
const SWAY_Z: i64 = 4;

const RUN: usize = 4096;

/// The fade begins at this share of the way from the centre to a wall.
const FADE_FROM: f64 = 0.85;

/// A box whose opposite walls are one: sides B, around a centre (the viewer, or the world's origin).
#[derive(Debug, Clone, Copy)]
pub struct Torus {
    pub sides: [f64; 3],
    pub center: [f64; 3],
}

impl Torus {
    /// A box; its sides within reason, so that nothing here can overflow.
    pub fn new(sides: [f64; 3], center: [f64; 3]) -> Result<Self, Error> {
        for side in sides {
            if !(1e-100..=1e100).contains(&side) {
                let message = format!("sides must be from 1e-100 to 1e100, got {side}");
                return Err(Error::invalid("box", message));
            }
        }
        center.into_iter().try_for_each(|value| finite("center", value).map(|_| ()))?;
        Ok(Self { sides, center })
    }
}

/// A gentle swing from side to side: `a` (sin(w t + phi1), 0, sin(w t + phi2)), of a in world units and w in radians per
/// unit of time.
pub type Sway = (f64, f64);

/// wrap(x) in [-side/2, side/2), for x within a few sides of 0, as all callers have reduced it.
///
/// Where x / side + 0.5 rounds up to a whole number the formula alone is below the interval by an ulp;
/// adding the side is then exact. It never is above: `side` times a whole number of up to 4 rounds by
/// less than a step of the quotient. Farther away it can be.
#[inline(always)]
fn wrap(x: f64, side: f64) -> f64 {
    let folded = x - side * (x / side + 0.5).floor();
    if folded < -0.5 * side { folded + side } else { folded }
}

/// The exact product rate * time as a rounded value and what rounding took away.
fn product(argument: &'static str, rate: f64, time: f64) -> Result<(f64, f64), Error> {
    let rounded = rate * time;
    if !rounded.is_finite() {
        let message = format!("times time must be finite, got {rate} times {time}");
        return Err(Error::invalid(argument, message));
    }
    Ok((rounded, rate.mul_add(time, -rounded)))
}

/// rate * time modulo `side`. The remainder of a float is exact and the product's rounding error is
/// added back, so at any time the error is an ulp of `side` and not an ulp of the distance travelled.
fn reduced(rate: f64, time: f64, side: f64) -> Result<f64, Error> {
    let (rounded, rest) = product("velocity", rate, time)?;
    Ok(rounded % side + rest % side)
}

/// The positions of the first n flakes, (n, 3), at `time`, sway included.
///
/// `velocity` is flake minus world, one row for all flakes or one per flake. The offset from the
/// centre lies in [-B/2, B/2) before the sway is added and before the sum with c is rounded.
pub fn positions(
    mut out: ArrayViewMut2<f64>,
    torus: &Torus,
    seed: i64,
    velocity: ArrayView2<f64>,
    time: f64,
    sway: Option<Sway>,
    cancel: &Cancel,
) -> Result<(), Error> {
    finite("time", time)?;
    let count = out.nrows();
    if velocity.ncols() != 3 || ![1, count].contains(&velocity.nrows()) {
        return Err(Error::invalid("velocity", "must be (3,) or one row for each flake"));
    }
    let common =
        if velocity.nrows() == 1 { Some(drift(velocity.row(0), time, torus)?) } else { None };
    let angle = sway.map(|sway| sway_angle(sway, time)).transpose()?;
    // Exact, so that a centre far away loses nothing but its own last digits.
    let center: [f64; 3] = std::array::from_fn(|axis| torus.center[axis] % torus.sides[axis]);
    let stream = Hash::seeded(seed).word(STREAM);
    let runs = out.axis_chunks_iter_mut(Axis(0), RUN).enumerate();
    pool::for_each(runs, |(run, mut rows): (usize, ArrayViewMut2<f64>)| {
        cancel.check()?;
        for (i, mut row) in rows.rows_mut().into_iter().enumerate() {
            let index = run * RUN + i;
            let drift = match common {
                Some(drift) => drift,
                None => drift(velocity.row(index), time, torus)?,
            };
            let flake = stream.word(index as i64);
            for axis in 0..3 {
                let side = torus.sides[axis];
                let start = side * flake.word(axis as i64).unit();
                let offset = wrap(start + (drift[axis] - center[axis]), side);
                row[axis] = torus.center[axis] + offset;
            }
            if let (Some(sway), Some(angle)) = (sway, angle) {
                let [x, z] = swing(flake, sway, angle);
                row[0] += x;
                row[2] += z;
            }
        }
        Ok(())
    })
}

fn drift(velocity: ArrayView1<f64>, time: f64, torus: &Torus) -> Result<[f64; 3], Error> {
    let mut drift = [0.0; 3];
    for axis in 0..3 {
        drift[axis] = reduced(finite("velocity", velocity[axis])?, time, torus.sides[axis])?;
    }
    Ok(drift)
}

/// Where the sway stands at `time`, (n, 3): what `positions` adds after the wrap.
///
/// The difference over an exposure is the sway's part of a flake's streak.
pub fn sway_offsets(
    mut out: ArrayViewMut2<f64>,
    seed: i64,
    time: f64,
    sway: Sway,
    cancel: &Cancel,
) -> Result<(), Error> {
    finite("time", time)?;
    let angle = sway_angle(sway, time)?;
    let stream = Hash::seeded(seed).word(STREAM);
    let runs = out.axis_chunks_iter_mut(Axis(0), RUN).enumerate();
    pool::for_each(runs, |(run, mut rows): (usize, ArrayViewMut2<f64>)| {
        cancel.check()?;
        for (i, mut row) in rows.rows_mut().into_iter().enumerate() {
            let [x, z] = swing(stream.word((run * RUN + i) as i64), sway, angle);
            row.assign(&aview1(&[x, 0.0, z]));
        }
        Ok(())
    })
}

/// w t in [-pi, pi], with the product's rounding error added back.
fn sway_angle(sway: Sway, time: f64) -> Result<f64, Error> {
    finite("sway", sway.0)?;
    let (rounded, rest) = product("sway", finite("sway", sway.1)?, time)?;
    // libm rather than std: the same bits with every C library.
    Ok(libm::atan2(libm::sin(rounded), libm::cos(rounded)) + rest)
}

#[inline(always)]
fn swing(flake: Hash, sway: Sway, angle: f64) -> [f64; 2] {
    [SWAY_X, SWAY_Z].map(|word| {
        let phase = std::f64::consts::TAU * flake.word(word).unit();
        sway.0 * libm::sin(angle + phase)
    })
}

/// How much of a flake is shown, (n,): the product over the axes of
/// 1 - smoothstep(0.85, 1, 2 |p - c| / B), so that nothing pops where the box wraps.
pub fn edge_fade(
    mut out: ArrayViewMut1<f64>,
    points: ArrayView2<f64>,
    torus: &Torus,
    cancel: &Cancel,
) -> Result<(), Error> {
    if points.dim() != (out.len(), 3) {
        return Err(Error::invalid("points", "must be (n, 3)"));
    }
    let runs = out.axis_chunks_iter_mut(Axis(0), RUN).zip(points.axis_chunks_iter(Axis(0), RUN));
    pool::for_each(runs, |(mut fades, points): (ArrayViewMut1<f64>, ArrayView2<f64>)| {
        cancel.check()?;
        for (fade, point) in fades.iter_mut().zip(points.rows()) {
            let left = |axis: usize| {
                let reach = 2.0 * (point[axis] - torus.center[axis]).abs() / torus.sides[axis];
                1.0 - smoothstep((reach - FADE_FROM) / (1.0 - FADE_FROM))
            };
            *fade = (0..3).map(left).product();
        }
        Ok(())
    })
}
