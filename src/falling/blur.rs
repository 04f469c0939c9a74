//! Sums of sheets blurred along the ways that their flakes go during the exposure.

use ndarray::{ArrayView2, ArrayViewMut2};

use super::bent::{APART, Group, Nodes};
use crate::base::error::Error;
use crate::base::pool::line;
use crate::base::simd::{dispatch, multiply_add};

/// A way is at most so long along an axis, px, so that its half and the runs beside it fit between two nodes; and
/// one shorter than the second is none.
const LONGEST: f32 = 114.0;
const REST: f32 = 0.3;

/// Taps on whole pixels leave more of the finest waves along a way than its even share does; so much of its length
/// more, and the octave has the power that it should.
const LONGER: f32 = 1.06;

/// Taps of the longest way: three across for each pixel of it and of its ends.
const MOST_TAPS: usize = 3 * (LONGER * LONGEST) as usize + 9;

/// Rows of a cell that have one way.
const TALL: usize = 8;

/// The ways of a group, between two depths.
pub struct Streaks<'a> {
    ways: Nodes<'a, 2>,
    near: f32,
    far: f32,
    slope: f32,
    /// Pixels on each side that the longest way needs.
    pub reach: usize,
}

impl<'a> Streaks<'a> {
    pub fn new(&Group { ways, near, far, .. }: &'a Group<'a>) -> Result<Self, Error> {
        let ways = Nodes::new(ways)?;
        let longest =
            ways.each.as_flattened().iter().fold(0.0_f32, |most, way| most.max(way.abs()));
        if longest > LONGEST {
            return Err(Error::Internal("no ways look like that".into()));
        }
        let reach = if longest < REST { 0 } else { (0.5 * LONGER * longest) as usize + 3 };
        Ok(Self { ways, near, far, slope: 1.0 / (far - near), reach })
    }
}

/// The taps of a way: how many on each side of the middle, the share of an inner one, and of the last.
///
/// Their variance is that of the way, length^2 / 12; as many even taps as have no more, and a part of the next.
#[inline(always)]
fn taps(length: f32) -> (i32, f32, f32) {
    let square = length * length / 12.0;
    let m = (0.5 * ((1.0 + length * length).sqrt() - 1.0)).ceil().max(1.0);
    let inner = (m - 1.0) * m * (2.0 * m - 1.0) / 3.0;
    let end = ((square * (2.0 * m - 1.0) - inner) / (2.0 * (m * m - square))).clamp(0.0, 1.0);
    let share = 1.0 / (2.0 * m - 1.0 + 2.0 * end);
    (m as i32, share, end * share)
}

/// Adds a part of a plane, from a pixel on.
#[inline(always)]
fn tap<const LEVEL: u8>(sums: &mut [f32; APART], plane: &[f32], at: usize, gain: f32) {
    // No way leads beyond the plane, which has room for a cell more than it shows.
    let Some(from) = plane.get(at..).and_then(<[f32]>::first_chunk::<APART>) else { return };
    for i in 0..APART {
        sums[i] = multiply_add::<f32, LEVEL>(from[i], gain, sums[i]);
    }
}

/// Adds a plane, blurred and weighed by the share of the group that lies before a wall: `at` is the first row and
/// column, and `from` where they lie in the plane. Some rows of a cell have one way.
#[dispatch]
pub fn blur<const LEVEL: u8>(
    out: ArrayViewMut2<'_, f32>,
    streaks: &Streaks<'_>,
    plane: (&[f32], usize),
    at: [usize; 2],
    from: (usize, usize),
    depth: Option<ArrayView2<'_, f32>>,
) -> Option<()> {
    let ((plane, width), (rows, columns), mut out) = (plane, out.dim(), out);
    let (mut taps, mut row) = ([(0, 0.0); MOST_TAPS], 0);
    while row < rows {
        let block = (at[0] + row) / TALL * TALL;
        let (end, mut done) = ((block + TALL - at[0]).min(rows), 0);
        while done < columns {
            let col = at[1] + done;
            let run = (APART - col % APART).min(columns - done);
            let ends = [0, 1].map(|more| streaks.ways.at(block + TALL / 2, col / APART + more));
            let count = laid(&mut taps, ends, width);
            for row in row..end {
                let first = (from.0 + row) * width + from.1 + done;
                let mut sums = [0.0; APART];
                for &(off, gain) in &taps[..count] {
                    tap::<LEVEL>(&mut sums, plane, first.wrapping_add_signed(off), gain);
                }
                let out = &mut out.row_mut(row).into_slice()?[done..done + run];
                let Some(depth) = depth else {
                    out.iter_mut().zip(&sums).for_each(|(out, sum)| *out += sum);
                    continue;
                };
                let depth = &line(depth, row).ok()?[done..];
                for ((out, &sum), &depth) in out.iter_mut().zip(&sums).zip(depth) {
                    let share = ((depth - streaks.near) * streaks.slope).clamp(0.0, 1.0);
                    *out += sum * if depth < streaks.far { share } else { 1.0 };
                }
            }
            done += run;
        }
        row = end;
    }
    Some(())
}

/// Lays the taps of a way between those of two nodes: how far each is in a plane of a width, and its share; and
/// returns their number.
#[inline(always)]
fn laid(into: &mut [(isize, f32); MOST_TAPS], ends: [[f32; 2]; 2], width: usize) -> usize {
    let way: [f32; 2] = std::array::from_fn(|i| 0.5 * (ends[0][i] + ends[1][i]));
    let steep = way[1].abs() > way[0].abs();
    let (long, short) = if steep { (way[1], way[0]) } else { (way[0], way[1]) };
    let (along, aside) = if steep { (width as isize, 1) } else { (1, width as isize) };
    into[0] = (0, 1.0);
    if long.abs() < REST {
        return 1;
    }
    let ((most, inner, last), slope) = (taps(LONGER * long.abs()), short / long);
    let mut count = 0;
    for number in -most..=most {
        let gain = if number.abs() == most { last } else { inner };
        let off = slope * number as f32;
        let whole = off.round_ties_even();
        let (at, part) = (number as isize * along + whole as isize * aside, off - whole);
        // Three pixels across that have the place and no width: two would make the streak wider.
        let shares = [0.5 * part * (part - 1.0), 1.0 - part * part, 0.5 * part * (part + 1.0)];
        for (share, across) in shares.into_iter().zip([-aside, 0, aside]) {
            if share != 0.0 {
                into[count % MOST_TAPS] = (at + across, gain * share);
                count += 1;
            }
        }
    }
    count.min(MOST_TAPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_spread_as_the_way_does() {
        for length in [0.3, 1.0, 2.0, 2.83, 3.7, 9.1, 40.0, 120.0_f32] {
            let (most, inner, last) = taps(length);
            let each = |tap: i32| f64::from(if tap.abs() == most { last } else { inner });
            let sum: f64 = (-most..=most).map(each).sum();
            let square: f64 = (-most..=most).map(|tap| f64::from(tap * tap) * each(tap)).sum();
            let want = f64::from(length * length) / 12.0;
            assert!((sum - 1.0).abs() < 1e-5 && (square / want - 1.0).abs() < 1e-4, "{length}");
        }
    }
}
