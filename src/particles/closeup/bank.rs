//! Silhouettes of aggregates of snow crystals, made by rule.
//!
//! Crystals are flat six-armed dendrites of random directions. One after the other they stick to the
//! aggregate where a random point of it touches a random point of the crystal: cluster on crystal, as in
//! Westbrook, Ball, Field and Heymsfield 2004 (Geophys. Res. Lett. 31, L15104), whose aggregates have a
//! fractal dimension near 2 and a mean projected aspect ratio of .6; Korolev and Isaac 2003, Brandes et al.
//! 2007 and Garrett et al. 2015 observe .6 to .8 (so compared in J. Atmos. Sci. 76, 2019,
//! JAS-D-19-0066). Which crystals, how many and how opaque is a choice of ours. What a ray passes of ice makes a silhouette
//! translucent where few crystals overlap, and lets finer ice around them make a soft rim. All views of an aggregate have the area of a disc of its diameter.

use std::convert::Infallible;
use std::sync::OnceLock;

use crate::base::pool::kept;
use crate::base::random::Hash;

pub const SHAPES: usize = 8;
/// Views of each around a turn.
pub const VIEWS: usize = 16;

/// Texels along a side of the largest view; each further level has half as many.
pub const SIDE: usize = 64;
const LEVELS: usize = 4;

/// Points of all shapes lie within this share of half a view.
const FILLED: f64 = 0.8;

/// Optical depth of a ray through the middle of a point of a crystal, and the deviation of its blot in
/// texels.
const THICKNESS: f64 = 0.3;
const BLOT: f64 = 0.75;

/// Broken arms and rime too fine to be told: a share of the crystals' ice, spread by a deviation in texels.
const FINE: f64 = 0.15;
const SPREAD: f64 = 2.5;

struct View {
    /// From the largest level down, row by row.
    levels: [Vec<f32>; LEVELS],
    /// Its side in diameters of the flake.
    side: f64,
}

/// A silhouette between two neighbouring views, at one size.
pub struct Silhouette {
    /// Opacities, 0 to 1, row by row; what is behind the last row is not looked at.
    texels: [f32; SIDE * SIDE],
    count: usize,
    /// Diameters along the side.
    pub side: f64,
}

/// Views of all shapes, each made when it is first asked for: a frame of few near flakes waits for few.
static BANK: [OnceLock<View>; SHAPES * VIEWS] = [const { OnceLock::new() }; SHAPES * VIEWS];

fn seen(shape: usize, view: usize) -> &'static View {
    let Ok(found) = kept(&BANK[shape * VIEWS + view], || {
        let points = aggregate(shape);
        let far = points.iter().map(length).fold(0.0, f64::max);
        let turn = std::f64::consts::TAU * view as f64 / VIEWS as f64;
        Ok::<_, Infallible>(View::of(&points, far, turn))
    });
    found
}

/// An aggregate seen from an angle, in turns; texels are at least `texel` diameters wide, or the
/// finest.
#[inline]
pub fn look(shape: usize, turns: f64, texel: f64) -> Silhouette {
    let place = (turns - turns.floor()) * VIEWS as f64;
    let first = (place as usize).min(VIEWS - 1);
    let part = place - first as f64;
    let [a, b] = [first, (first + 1) % VIEWS].map(|view| seen(shape % SHAPES, view));
    let side = a.side + part * (b.side - a.side);
    let mut level = 0;
    while level + 1 < LEVELS && side / ((SIDE >> (level + 1)) as f64) <= texel {
        level += 1;
    }
    let mut seen = Silhouette { texels: [0.0; SIDE * SIDE], count: SIDE >> level, side };
    let views = a.levels[level].iter().zip(&b.levels[level]);
    for (texel, (a, b)) in seen.texels.iter_mut().zip(views) {
        *texel = a + part as f32 * (b - a);
    }
    seen
}

impl Silhouette {
    /// Its opacity, 0 to 1, at a place in diameters from its middle. Without branches, and with indices that
    /// need no look at their bounds, so that it is asked for a vector of places.
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> f32 {
        let scale = self.count as f32 / self.side as f32;
        let half = 0.5 * self.count as f32 - 0.5;
        let (u, v) = (x * scale + half, y * scale + half);
        let last = (self.count - 1) as f32;
        let inside = (u >= 0.0) & (v >= 0.0) & (u < last) & (v < last);
        let (u, v) = if inside { (u, v) } else { (0.0, 0.0) };
        let (column, row) = (u as i32, v as i32);
        let (a, b) = (u - column as f32, v - row as f32);
        let at = (row * self.count as i32 + column) as usize;
        let texel = |at: usize| self.texels[at & (SIDE * SIDE - 1)];
        let upper = texel(at) + a * (texel(at + 1) - texel(at));
        let lower = texel(at + self.count);
        let lower = lower + a * (texel(at + self.count + 1) - lower);
        if inside { upper + b * (lower - upper) } else { 0.0 }
    }
}

fn length(point: &[f64; 3]) -> f64 {
    libm::sqrt(point.iter().map(|v| v * v).sum())
}

/// A turn around an axis of the cube by random angles.
fn turned(point: [f64; 3], angles: [f64; 3]) -> [f64; 3] {
    let mut point = point;
    for (axis, angle) in angles.into_iter().enumerate() {
        let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        (point[a], point[b]) =
            (cosine * point[a] - sine * point[b], sine * point[a] + cosine * point[b]);
    }
    point
}

/// The points of a dendrite in a plane: six arms with side branches at 60 degrees.
fn dendrite(reach: f64, branches: usize) -> Vec<[f64; 3]> {
    let mut points = vec![[0.0; 3]];
    let sixth = std::f64::consts::FRAC_PI_3;
    for arm in 0..6 {
        let ray = |angle: f64, r: f64| [r * libm::cos(angle), r * libm::sin(angle), 0.0];
        let main = sixth * f64::from(arm);
        let steps = 9;
        points.extend((1..=steps).map(|k| ray(main, reach * f64::from(k) / f64::from(steps))));
        for branch in 1..=branches {
            let from = branch as f64 / (branches as f64 + 1.0);
            let long = 0.45 * reach * (1.0 - from);
            let base = ray(main, reach * from);
            for side in [-1.0, 1.0] {
                for k in 1..=3 {
                    let tip = ray(main + side * sixth, long * f64::from(k) / 3.0);
                    points.push([base[0] + tip[0], base[1] + tip[1], 0.0]);
                }
            }
        }
    }
    points
}

/// The points of an aggregate around its middle.
fn aggregate(shape: usize) -> Vec<[f64; 3]> {
    let unit = |word: usize| Hash::seeded(0x5EED).word(shape as i64).word(word as i64).unit();
    let crystals = 6 + shape % SHAPES;
    let mut points: Vec<[f64; 3]> = Vec::new();
    for crystal in 0..crystals {
        let draw = |k: usize| unit(100 * crystal + k);
        let angles = [0, 1, 2].map(|k| std::f64::consts::TAU * draw(k));
        let arms = dendrite(0.6 + 0.8 * draw(3), 1 + (3.0 * draw(4)) as usize);
        let arms: Vec<[f64; 3]> = arms.into_iter().map(|point| turned(point, angles)).collect();
        if points.is_empty() {
            points = arms;
            continue;
        }
        let pick = |points: &[[f64; 3]], draw: f64| points[(draw * points.len() as f64) as usize];
        let (of, to) = (pick(&points, draw(5)), pick(&arms, draw(6)));
        let shift: [f64; 3] = std::array::from_fn(|axis| of[axis] - to[axis]);
        points
            .extend(arms.into_iter().map(|p| [p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]]));
    }
    let count = points.len() as f64;
    let middle: [f64; 3] =
        std::array::from_fn(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / count);
    for point in &mut points {
        (0..3).for_each(|axis| point[axis] -= middle[axis]);
    }
    points
}

impl View {
    /// The view of points within `far` of the middle, turned around the vertical axis.
    fn of(points: &[[f64; 3]], far: f64, turn: f64) -> Self {
        let scale = FILLED * 0.5 * SIDE as f64 / far;
        let mut depth = vec![0.0_f64; SIDE * SIDE];
        for &point in points {
            let [x, y, _] = turned(point, [0.0, turn, 0.0]);
            let [x, y] = [x, y].map(|v| v * scale + 0.5 * SIDE as f64 - 0.5);
            let (left, top) = (libm::round(x) as isize - 3, libm::round(y) as isize - 3);
            let blots = |first: isize, middle: f64| {
                let away = [0, 1, 2, 3, 4, 5, 6].map(|k| ((first + k) as f64 - middle) / BLOT);
                away.map(|away| libm::exp(-0.5 * away * away))
            };
            let across = blots(left, x);
            for (row, tall) in (top..).zip(blots(top, y)) {
                for (column, wide) in (left..).zip(across) {
                    if row.min(column) >= 0 && row.max(column) < SIDE as isize {
                        depth[row as usize * SIDE + column as usize] += THICKNESS * tall * wide;
                    }
                }
            }
        }
        let fine = spread(&spread(&depth));
        let both = depth.iter().zip(&fine);
        let whole: Vec<f32> = both.map(|(d, f)| -libm::expm1(-(d + FINE * f)) as f32).collect();
        let area: f64 = whole.iter().map(|&v| f64::from(v)).sum();
        // The area of a disc of diameter 1 in units of a texel's side.
        let side = SIDE as f64 * libm::sqrt(std::f64::consts::FRAC_PI_4 / area);
        let mut levels: [Vec<f32>; LEVELS] = Default::default();
        levels[0] = whole;
        for level in 1..LEVELS {
            let (count, finer) = (SIDE >> level, &levels[level - 1]);
            let texel = |k: usize| {
                let at = 2 * (k / count) * 2 * count + 2 * (k % count);
                0.25 * [0, 1, 2 * count, 2 * count + 1].map(|k| finer[at + k]).iter().sum::<f32>()
            };
            levels[level] = (0..count * count).map(texel).collect();
        }
        Self { levels, side }
    }
}

/// Rows of a view spread along themselves, as columns.
fn spread(rows: &[f64]) -> Vec<f64> {
    let reach = (3.0 * SPREAD) as usize;
    let bell = |k: usize| libm::exp(-0.5 * (k as f64 / SPREAD) * (k as f64 / SPREAD));
    let weights: Vec<f64> = (0..2 * reach + 1).map(|k| bell(k.abs_diff(reach))).collect();
    let whole: f64 = weights.iter().sum();
    let mut columns = vec![0.0; SIDE * SIDE];
    for (at, &value) in rows.iter().enumerate().filter(|(_, value)| **value > 0.0) {
        let (row, column) = (at / SIDE, at % SIDE);
        for (weight, to) in weights.iter().zip(column as isize - reach as isize..) {
            if (0..SIDE as isize).contains(&to) {
                columns[to as usize * SIDE + row] += value * weight / whole;
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area in squared diameters, and aspect ratio by second moments, of a look.
    fn measured(look: &Silhouette) -> (f64, f64) {
        let (n, reach) = (160, 1.6_f32);
        let (mut sums, step) = ([0.0_f64; 4], 2.0 * reach / n as f32);
        for i in 0..n * n {
            let [x, y] = [i % n, i / n].map(|k| (k as f32 + 0.5) * step - reach);
            let v = f64::from(look.at(x, y));
            let (x, y) = (f64::from(x), f64::from(y));
            for (sum, part) in sums.iter_mut().zip([1.0, x * x, y * y, x * y]) {
                *sum += v * part;
            }
        }
        let [area, xx, yy, xy] = sums;
        let root = (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt();
        let (long, short) = ((xx + yy) / 2.0 + root, (xx + yy) / 2.0 - root);
        (area * f64::from(step).powi(2), (short / long).sqrt())
    }

    #[test]
    fn aggregates_have_the_area_of_a_disc_and_their_aspect() {
        let mut aspects = Vec::new();
        for shape in 0..SHAPES {
            for view in 0..VIEWS {
                for (texel, error) in [(0.0, 0.01), (0.15, 0.02)] {
                    let turns = (view as f64 + 0.25) / VIEWS as f64;
                    let (area, aspect) = measured(&look(shape, turns, texel));
                    let wanted = std::f64::consts::FRAC_PI_4;
                    assert!((area / wanted - 1.0).abs() < error + 0.02, "{shape} {view} {area}");
                    aspects.push(aspect);
                }
            }
        }
        let mean = aspects.iter().sum::<f64>() / aspects.len() as f64;
        assert!((0.5..0.85).contains(&mean), "{mean}");
    }
}
