//! A population of flakes: classes of size that fall each at its own speed, seen by one camera.
//!
//! Each class fills a box of its own, as deep as its largest flakes are drawn. Nothing fades at the
//! walls: the view ends inside them, and what lies beyond a class's depth is the texture's.

use std::ops::Range;

use super::block::{Eye, each_seen};
use super::splat::Source;
use super::sprite::Flake;
use super::torus::Carried;
use super::view::View;
use crate::base::error::Error;
use crate::base::random::Hash;
use crate::base::smooth::smoothstep;

/// Stream of the numbers that sizes are.
const SIZES: i64 = i64::from_be_bytes(*b"crowdsiz");

/// Over this share of the amount the last flakes fade in, so that none pops.
const FADE_IN: f64 = 0.1;

/// The exponential law of diameters, exp(-slope D) between two of them.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    range: (f64, f64),
    slope: f64,
    // exp(-slope times their difference) less 1, or 0 where they are as many of all.
    whole: f64,
}

impl Law {
    /// The law between the smallest and the largest diameter, world units; `slope` per world unit.
    pub fn new(range: (f64, f64), slope: f64) -> Self {
        let whole = slope * (range.1 - range.0);
        // libm rather than std: the same bits with every C library.
        Self { range, slope, whole: if whole.abs() < 1e-9 { 0.0 } else { libm::expm1(-whole) } }
    }

    /// The diameter that a share of them is smaller than.
    #[inline(always)]
    fn quantile(&self, share: f64) -> f64 {
        let (low, high) = self.range;
        if self.whole == 0.0 {
            return low + share * (high - low);
        }
        let inside = -libm::log1p(share * self.whole) / self.slope;
        (low + inside).clamp(low, high)
    }
}

/// The flakes of one class.
pub struct Class {
    /// How many the box holds.
    pub count: usize,
    /// Where they are, in the box's axes.
    pub carried: Carried,
    /// Their sizes are hashed with it.
    pub seed: i64,
    /// Of their diameters.
    pub law: Law,
    /// How far they move during the exposure, in the eye's axes, world units.
    pub travel: [f64; 3],
    /// Depths between which they fade in, and between which they fade out again.
    pub shown: [f64; 4],
    /// Shares of them that are there, 0 to 1, by [`Heights`].
    pub amounts: Vec<f64>,
}

/// The height of places below the eye, by which the amounts of flakes differ.
#[derive(Debug, Clone, Copy)]
pub struct Heights {
    /// Down, in the box's axes.
    pub down: [f64; 3],
    /// Heights of the first and the last amount, world units.
    pub range: (f64, f64),
}

impl Heights {
    /// The amount at a place: linear between those of even steps, or one for all heights.
    #[inline(always)]
    fn amount(&self, amounts: &[f64], point: [f64; 3]) -> f64 {
        if let [amount] = amounts {
            return *amount;
        }
        let height: f64 = (0..3).map(|axis| self.down[axis] * point[axis]).sum();
        let last = (amounts.len() - 1) as f64;
        let place = (height - self.range.0) / (self.range.1 - self.range.0) * last;
        let place = place.clamp(0.0, last);
        let first = (place.floor() as usize).min(amounts.len() - 2);
        let part = place - first as f64;
        amounts[first] + part * (amounts[first + 1] - amounts[first])
    }
}

/// What all classes share.
pub struct Crowd {
    /// Class after class; their flakes are numbered in this order.
    pub classes: Vec<Class>,
    /// Of a resting flake's middle, 0 to 1.
    pub opacity: f64,
    /// From the box's axes to the eye's.
    pub turn: [[f64; 3]; 3],
    /// What a place adds to the travel: the camera's turning and its zoom.
    pub spread: [[f64; 3]; 3],
    /// What the amounts of classes go by.
    pub heights: Heights,
    /// What the eye sees.
    pub view: View,
    /// What another eye sees.
    pub aside: Option<View>,
}

/// Of a flake whose image has the diameter d, sigma is d / sqrt(8), and a third of the radius.
const RADIUS_OF_DIAMETER: f64 = 3.0 * std::f64::consts::FRAC_1_SQRT_2 / 2.0;

/// The share of a flake that is there: those of low rank are, and the last ones fade in. The mean over
/// all ranks is the amount.
#[inline(always)]
fn there(rank: f64, amount: f64) -> f64 {
    let fade = FADE_IN * amount.min(2.0 * (1.0 - amount));
    if fade <= 0.0 {
        return if rank < amount { 1.0 } else { 0.0 };
    }
    ((amount + 0.5 * fade - rank) / fade).clamp(0.0, 1.0)
}

/// 0 below the first number and 1 above the second, smooth between; a step where they are one.
#[inline(always)]
fn ramp(low: f64, high: f64, x: f64) -> f64 {
    if low < high { smoothstep((x - low) / (high - low)) } else { f64::from(u8::from(x >= high)) }
}

#[inline(always)]
fn turned(matrix: &[[f64; 3]; 3], point: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| (0..3).map(|axis| matrix[row][axis] * point[axis]).sum())
}

impl Crowd {
    /// The room that the view's planes need beside them: for the swing, the streak and the size.
    pub fn room(classes: &[Class], most_travel: f64) -> f64 {
        classes.iter().map(|each| each.carried.reach() + 2.0 * each.law.range.1).fold(0.0, f64::max)
            + most_travel
    }

    /// Refuses what no caller means.
    pub fn checked(self) -> Result<Self, Error> {
        let sound = self.classes.iter().all(|each| {
            let (low, high) = each.law.range;
            0.0 < low
                && low <= high
                && high.is_finite()
                && each.law.slope.is_finite()
                && each.travel.iter().all(|v| v.is_finite())
                && each.shown.iter().all(|v| !v.is_nan())
                && !each.amounts.is_empty()
                && each.amounts.iter().all(|v| (0.0..=1.0).contains(v))
        }) && (0.0..=1.0).contains(&self.opacity)
            && self.heights.range.0 < self.heights.range.1
            && self.turn.iter().chain(&self.spread).flatten().all(|v| v.is_finite());
        if sound { Ok(self) } else { Err(Error::Internal("no crowd looks like that".into())) }
    }

    /// A flake of a class, at its place before the sway, unless it does not show.
    #[inline(always)]
    fn flake(&self, class: &Class, index: usize, [x, y, z]: [f64; 3]) -> Option<Flake> {
        // The view has room for the swing.
        let [aside, ahead] = class.carried.swing(class.carried.flake(index));
        let place = [x + aside, y, z + ahead];
        let point = turned(&self.turn, place);
        let rank = (index as f64 + 0.5) / class.count as f64;
        let [near, in_full, from, far] = class.shown;
        let depth = point[2];
        let shown = ramp(near, in_full, depth) * (1.0 - ramp(from, far, depth));
        let weight = shown * there(rank, self.heights.amount(&class.amounts, place));
        if weight <= 0.0 {
            return None;
        }
        let share = Hash::seeded(class.seed).word(SIZES).word(index as i64).unit();
        let grown = turned(&self.spread, point);
        Some(Flake {
            point,
            radius: RADIUS_OF_DIAMETER * class.law.quantile(share),
            opacity: weight * self.opacity,
            travel: std::array::from_fn(|axis| class.travel[axis] + grown[axis]),
        })
    }

    /// The class of a flake, and its number in it.
    #[inline(always)]
    fn class(&self, mut index: usize) -> Option<(&Class, usize)> {
        for class in &self.classes {
            if index < class.count {
                return Some((class, index));
            }
            index -= class.count;
        }
        None
    }
}

impl Source for Crowd {
    fn len(&self) -> usize {
        self.classes.iter().map(|class| class.count).sum()
    }

    #[inline(always)]
    fn get(&self, index: usize) -> Option<Flake> {
        let (class, index) = self.class(index)?;
        let place = class.carried.place(index);
        self.sees(place).then(|| self.flake(class, index, place))?
    }

    #[inline(always)]
    fn each(
        &self,
        range: Range<usize>,
        see: &mut impl FnMut(usize, Flake) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut start = 0;
        for class in &self.classes {
            let end = range.end.min(start + class.count).saturating_sub(start);
            let own = range.start.saturating_sub(start).min(end)..end;
            each_seen(&class.carried, self, own, |index, place| {
                match self.flake(class, index, place) {
                    Some(flake) => see(start + index, flake),
                    None => Ok(()),
                }
            })?;
            start += class.count;
        }
        Ok(())
    }
}

impl Eye for Crowd {
    #[inline(always)]
    fn sees(&self, place: [f64; 3]) -> bool {
        let point = turned(&self.turn, place);
        self.view.sees(point) | self.aside.as_ref().is_some_and(|view| view.sees(point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_what_is_there_is_the_amount() {
        for amount in [0.0, 1e-3, 0.07, 0.5, 0.9, 0.999, 1.0] {
            let n = 200_000;
            let sum: f64 = (0..n).map(|i| there((f64::from(i) + 0.5) / f64::from(n), amount)).sum();
            assert!((sum / f64::from(n) - amount).abs() < 1e-5, "{amount} {sum}");
        }
        assert_eq!(there(0.999_999, 1.0), 1.0);
    }

    #[test]
    fn sizes_follow_their_law() {
        let law = Law::new((0.002, 0.03), 300.0);
        let n = 100_000;
        let mean = (0..n).map(|i| law.quantile((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>()
            / f64::from(n);
        // 1/slope + low - (high - low) / (exp(slope (high - low)) - 1)
        let wanted = 1.0 / 300.0 + 0.002 - 0.028 / (8.4_f64.exp() - 1.0);
        assert!((mean - wanted).abs() < 1e-8, "{mean} {wanted}");
        let even = Law::new((0.01, 0.03), 0.0);
        assert!((even.quantile(0.25) - 0.015).abs() < 1e-15);
    }

    #[test]
    fn amounts_are_linear_between_heights() {
        let heights = Heights { down: [0.0, 1.0, 0.0], range: (-2.0, 2.0) };
        for (y, wanted) in [(-9.0, 0.0), (-1.0, 0.5), (0.0, 1.0), (1.0, 0.75), (9.0, 0.5)] {
            assert_eq!(heights.amount(&[0.0, 1.0, 0.5], [3.0, y, 1.0]), wanted);
        }
    }
}
