//! Where the flakes are: a box that wraps, moving with whoever looks (Langer 2004, section 6).
//!
//! p = c + wrap(B u + v t - c), wrap(x) = x - B floor(x / B + 1/2). No flake is born or dies, nothing
//! runs from frame to frame, and the density is the same everywhere in the box at every time.

use ndarray::{ArrayView1, ArrayView2, ArrayViewMut1, ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, finite};
use crate::base::pool;
use crate::base::random::Hash;
use crate::base::smooth::smoothstep;

/// Separates the flakes' numbers from every other use of the seed.
const STREAM: i64 = i64::from_be_bytes(*b"flakebox");

/// Words after the flake's index: 0, 1, 2 are the axes of the position, these the sway's phases.
const SWAY_X: i64 = 3;
const SWAY_Z: i64 = 4;

/// Flakes per item of work.
const RUN: usize = 4096;

/// The fade begins at this share of the way from the centre to a wall.
const FADE_FROM: f64 = 0.85;

/// A box whose opposite walls are one: sides B, around a centre (the viewer, or the world's origin).
#[derive(Debug, Clone, Copy)]
pub struct Torus {
    /// B, one per axis.
    pub sides: [f64; 3],
    /// c.
    pub center: [f64; 3],
}

impl Torus {
    /// A box; its sides within reason, so that nothing here can overflow.
    pub fn new(sides: [f64; 3], center: [f64; 3]) -> Result<Self, Error> {
        for side in sides {
            if !(1e-100..=1e100).contains(&side) {
                return Err(Error::invalid(
                    "box",
                    format!("sides must be from 1e-100 to 1e100, got {side}"),
                ));
            }
        }
        for value in center {
            finite("center", value)?;
        }
        Ok(Self { sides, center })
    }
}

/// A gentle swing from side to side: `amplitude` (sin(w t + phi1), 0, sin(w t + phi2)).
#[derive(Debug, Clone, Copy)]
pub struct Sway {
    /// World units.
    pub amplitude: f64,
    /// w, radians per unit of time.
    pub angular_frequency: f64,
}

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
        return Err(Error::invalid(
            argument,
            format!("times time must be finite, got {rate} times {time}"),
        ));
    }
    Ok((rounded, rate.mul_add(time, -rounded)))
}

/// rate * time modulo `side`. The remainder of a float is exact and the product's rounding error is
/// added back, so at any time the error is an ulp of `side` and not an ulp of the distance travelled.
fn reduced(rate: f64, time: f64, side: f64) -> Result<f64, Error> {
    let (rounded, rest) = product("velocity", rate, time)?;
    Ok(rounded % side + rest % side)
}

/// The positions of the flakes of some `numbers`, or of the first n, (n, 3), at `time`, sway included.
///
/// `velocity` is flake minus world, one row for all flakes or one per flake. The offset from the
/// centre lies in [-B/2, B/2) before the sway is added and before the sum with c is rounded.
pub fn positions(
    mut out: ArrayViewMut2<f64>,
    torus: &Torus,
    (seed, numbers): (i64, Option<ArrayView1<i64>>),
    velocity: ArrayView2<f64>,
    time: f64,
    sway: Option<Sway>,
    cancel: &Cancel,
) -> Result<(), Error> {
    finite("time", time)?;
    let count = out.nrows();
    if numbers.is_some_and(|numbers| numbers.len() != count) {
        return Err(Error::invalid("numbers", "must be one for each row"));
    }
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
            let flake = stream.word(numbers.map_or(index as i64, |numbers| numbers[index]));
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
            row[0] = x;
            row[1] = 0.0;
            row[2] = z;
        }
        Ok(())
    })
}

/// w t in [-pi, pi], with the product's rounding error added back.
fn sway_angle(sway: Sway, time: f64) -> Result<f64, Error> {
    finite("sway", sway.amplitude)?;
    finite("sway", sway.angular_frequency)?;
    let (rounded, rest) = product("sway", sway.angular_frequency, time)?;
    // libm rather than std: the same bits with every C library.
    Ok(libm::atan2(libm::sin(rounded), libm::cos(rounded)) + rest)
}

#[inline(always)]
fn swing(flake: Hash, sway: Sway, angle: f64) -> [f64; 2] {
    [SWAY_X, SWAY_Z].map(|word| {
        let phase = std::f64::consts::TAU * flake.word(word).unit();
        sway.amplitude * libm::sin(angle + phase)
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
            *fade = self::fade(torus, [point[0], point[1], point[2]]);
        }
        Ok(())
    })
}

#[inline(always)]
fn fade(torus: &Torus, point: [f64; 3]) -> f64 {
    (0..3)
        .map(|axis| {
            let reach = 2.0 * (point[axis] - torus.center[axis]).abs() / torus.sides[axis];
            1.0 - smoothstep((reach - FADE_FROM) / (1.0 - FADE_FROM))
        })
        .product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array1, Array2, array};

    fn at(count: usize, torus: &Torus, velocity: [f64; 3], time: f64) -> Array2<f64> {
        let mut out = Array2::zeros((count, 3));
        let velocity = Array2::from_shape_vec((1, 3), velocity.to_vec()).unwrap();
        positions(out.view_mut(), torus, (5, None), velocity.view(), time, None, &Cancel::new())
            .unwrap();
        out
    }

    #[test]
    fn wrap_stays_in_the_half_open_interval() {
        let stream = Hash::seeded(11);
        let sides = (0..20_000).map(|i| (16.0 * stream.word(i).unit() - 8.0).exp());
        for side in sides.chain([1.0, 0.1, 3.0, 7.3, 1e-100, 1e100]) {
            let half = 0.5 * side;
            for edge in (-4..4).map(|whole| side * (f64::from(whole) + 0.5)) {
                let near = [edge.next_down().next_down(), edge.next_down(), edge, edge.next_up()];
                for x in near {
                    let folded = wrap(x, side);
                    assert!((-half..half).contains(&folded), "{x} {side} {folded}");
                }
            }
        }
    }

    #[test]
    fn the_formula_without_the_fold_leaves_the_interval() {
        let bare = |x: f64, side: f64| x - side * (x / side + 0.5).floor();
        let outside = (0..1000)
            .map(|i| 0.1 * (f64::from(i) + 0.5))
            .flat_map(|x: f64| [x.next_down(), x, x.next_up()])
            .filter(|&x| !(-0.05..0.05).contains(&bare(x, 0.1)))
            .count();
        assert!(outside > 0);
    }

    #[test]
    fn a_moving_centre_sees_the_same_flakes() {
        // The flake that is in both boxes is at the same place; the others differ by whole boxes.
        let still = Torus::new([4.0; 3], [0.0; 3]).unwrap();
        let moved = Torus::new([4.0; 3], [0.7, -1.9, 1e3]).unwrap();
        let (a, b) = (at(500, &still, [0.1, 0.2, 0.3], 7.0), at(500, &moved, [0.1, 0.2, 0.3], 7.0));
        for (a, b) in a.iter().zip(&b) {
            let boxes = (a - b) / 4.0;
            assert!((boxes - boxes.round()).abs() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn a_late_time_is_as_exact_as_an_early_one() {
        // 3e9 units travelled in a box of 2: the remainder is known exactly, since 3 is.
        let torus = Torus::new([2.0; 3], [0.0; 3]).unwrap();
        let (early, late) = (at(100, &torus, [3.0; 3], 0.0), at(100, &torus, [3.0; 3], 1e9));
        assert_eq!(early, late);
        // The double nearest 0.1 is 0.1 + 5.55e-18, so after 1e9 frames the flake is 5.55e-9 ahead.
        let later = at(100, &torus, [0.1; 3], 1e9);
        for (a, b) in early.iter().zip(&later) {
            let ahead = wrap(b - a, 2.0);
            assert!((ahead - 5.551_115_123e-9).abs() < 1e-15, "{ahead}");
        }
    }

    #[test]
    fn the_sway_is_added_after_the_wrap() {
        let torus = Torus::new([4.0; 3], [0.0; 3]).unwrap();
        let sway = Sway { amplitude: 0.5, angular_frequency: 0.25 };
        let mut swinging = Array2::zeros((64, 3));
        let velocity = array![[0.0, 1.0, 0.0]];
        let cancel = Cancel::new();
        positions(
            swinging.view_mut(),
            &torus,
            (5, None),
            velocity.view(),
            9.0,
            Some(sway),
            &cancel,
        )
        .unwrap();
        let mut offsets = Array2::zeros((64, 3));
        sway_offsets(offsets.view_mut(), 5, 9.0, sway, &cancel).unwrap();
        let still = at(64, &torus, [0.0, 1.0, 0.0], 9.0);
        assert_eq!(swinging, still + &offsets);
        assert!(offsets.column(1).iter().all(|&y| y == 0.0));
        assert!(offsets.column(0).iter().any(|&x| x.abs() > 0.4));
    }

    #[test]
    fn the_fade_is_one_inside_and_zero_at_the_walls() {
        let torus = Torus::new([2.0; 3], [10.0, 0.0, 0.0]).unwrap();
        let points = array![[10.0, 0.84, -0.84], [11.0, 0.0, 0.0], [10.0, 0.925, 0.0]];
        let mut fade = Array1::zeros(3);
        edge_fade(fade.view_mut(), points.view(), &torus, &Cancel::new()).unwrap();
        assert_eq!(fade[0], 1.0);
        assert_eq!(fade[1], 0.0);
        assert!((fade[2] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_overflows_is_refused() {
        let torus = Torus::new([2.0; 3], [0.0; 3]).unwrap();
        let mut out = Array2::zeros((1, 3));
        let velocity = array![[1e200, 0.0, 0.0]];
        let error = positions(
            out.view_mut(),
            &torus,
            (5, None),
            velocity.view(),
            1e200,
            None,
            &Cancel::new(),
        )
        .unwrap_err();
        assert!(error.to_string().starts_with("velocity"), "{error}");
        assert!(Torus::new([0.0, 1.0, 1.0], [0.0; 3]).is_err());
    }
}
