//! What the flakes of a tile are drawn on: transmittance, alone or with the number of the flake that shows
//! most.

use super::dim::rows;
use super::draw::PIXELS;

/// The number where no flake is.
pub const NONE: i32 = -1;

/// A tile that flakes are drawn on, one after the other.
pub trait Canvas {
    /// Says which flake comes next.
    fn next(&mut self, number: i32);

    /// Takes the flake's alphas at N pixels from `at` on: weight * profile.
    fn take<const N: usize, const LEVEL: u8>(&mut self, at: usize, weight: f64, profile: &[f64; N]);
}

/// T *= 1 - alpha.
impl Canvas for [f64; PIXELS] {
    #[inline(always)]
    fn next(&mut self, _: i32) {}

    #[inline(always)]
    fn take<const N: usize, const LEVEL: u8>(
        &mut self,
        at: usize,
        weight: f64,
        profile: &[f64; N],
    ) {
        rows::<LEVEL>(&mut self[at..at + N], weight, profile);
    }
}

/// Transmittance, and at every pixel the flake whose own alpha is the greatest; of equals the first.
pub struct Numbered {
    /// T, with the bits that it has alone.
    pub through: [f64; PIXELS],
    /// The greatest alpha.
    pub most: [f64; PIXELS],
    /// Whose it is, or [`NONE`].
    pub numbers: [i32; PIXELS],
    drawn: i32,
}

impl Numbered {
    /// An empty tile.
    pub fn new() -> Self {
        Self { through: [1.0; PIXELS], most: [0.0; PIXELS], numbers: [NONE; PIXELS], drawn: NONE }
    }
}

impl Canvas for Numbered {
    #[inline(always)]
    fn next(&mut self, number: i32) {
        self.drawn = number;
    }

    #[inline(always)]
    fn take<const N: usize, const LEVEL: u8>(
        &mut self,
        at: usize,
        weight: f64,
        profile: &[f64; N],
    ) {
        rows::<LEVEL>(&mut self.through[at..at + N], weight, profile);
        let most: &mut [f64; N] =
            (&mut self.most[at..at + N]).try_into().expect("a block in a tile");
        let numbers: &mut [i32; N] =
            (&mut self.numbers[at..at + N]).try_into().expect("a block in a tile");
        for k in 0..N {
            let alpha = weight * profile[k];
            let first = (alpha == most[k]) & (self.drawn < numbers[k]);
            let wins = (alpha > most[k]) | first;
            most[k] = if wins { alpha } else { most[k] };
            numbers[k] = if wins { self.drawn } else { numbers[k] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::error::Cancel;
    use crate::base::random::Hash;
    use crate::particles::sorted::Sorted;
    use crate::particles::splat::{Flakes, splat};
    use crate::particles::sprite::Lens;
    use ndarray::{Array1, Array2, ArrayView2, array, s};

    const LENS: Lens = Lens { focal: 50.0, center: [70.0, 45.0], offset: [0.0; 3], near: 0.1 };

    #[test]
    fn the_strongest_wins_and_the_opacity_keeps_its_bits() {
        let unit = |i: usize, word: i64| Hash::seeded(7).word(i as i64).word(word).unit();
        let count = 30;
        let points = Array2::from_shape_fn((count, 3), |(i, axis)| {
            [3.0 * unit(i, 0) - 1.5, 2.0 * unit(i, 1) - 1.0, 1.0 + unit(i, 2)][axis]
        });
        // The last three are alike, and one of these is so large that every tile looks at it.
        let radius = Array1::from_shape_fn(count, |i| if i > 26 { 9.0 } else { 0.1 * unit(i, 3) });
        let velocity = Array2::from_shape_fn((count, 3), |(i, axis)| {
            if i % 2 == 0 && i < 27 { 0.4 * unit(i, 4 + axis as i64) } else { 0.0 }
        });
        let points = {
            let mut points = points;
            for i in 28..30 {
                let first = points.row(27).to_owned();
                points.row_mut(i).assign(&first);
            }
            points
        };
        let (shape, cancel, none) = ((90, 140), Cancel::new(), None::<ArrayView2<f32>>);
        let (opacity, shutter) = (array![0.6], 0.5);
        let flakes = |rows: std::ops::Range<usize>| Flakes {
            points: points.view().slice_move(s![rows.clone(), ..]),
            radius: radius.view().slice_move(s![rows.clone()]),
            opacity: opacity.view(),
            velocity: velocity.view().slice_move(s![rows, ..]),
            shutter,
        };
        let alone: Vec<Array2<f32>> = (0..count)
            .map(|i| {
                let mut alpha = Array2::zeros(shape);
                splat(alpha.view_mut(), &flakes(i..i + 1), &LENS, none, &cancel).unwrap();
                alpha
            })
            .collect();
        let sorted = Sorted::of(&flakes(0..count), &LENS, shape, &cancel).unwrap();
        let mut whole = Array2::<f32>::zeros(shape);
        sorted.draw(whole.view_mut(), [0, 90, 0, 140], none, &cancel).unwrap();
        for part in [[0, 90, 0, 140], [10, 71, 60, 131]] {
            let [top, bottom, left, right] = part;
            let size = (bottom - top, right - left);
            let (mut alpha, mut most) = (Array2::<f32>::zeros(size), Array2::<f32>::zeros(size));
            let mut numbers = Array2::<i32>::zeros(size);
            let (own, greatest) = (numbers.view_mut(), Some(most.view_mut()));
            sorted.draw_numbered(alpha.view_mut(), own, greatest, part, none, &cancel).unwrap();
            assert_eq!(alpha, whole.slice(s![top..bottom, left..right]));
            for ((row, column), &number) in numbers.indexed_iter() {
                let at = [top + row, left + column];
                let best = alone.iter().map(|alpha| alpha[at]).fold(0.0, f32::max);
                // Of equals the first. What is left of a flake alone is rounded to float32 once more.
                let wanted = alone.iter().position(|alpha| alpha[at] >= best - 1e-7);
                let found = usize::try_from(number).ok();
                assert!((most[[row, column]] - best).abs() <= 1e-7);
                if best > 1e-5 {
                    assert!(found <= Some(27) && alone[found.unwrap()][at] >= best - 1e-7);
                    assert!(found == wanted || alone[wanted.unwrap()][at] < best + 1e-7);
                } else if best == 0.0 {
                    assert!(number == NONE || most[[row, column]] < 1e-7);
                }
            }
        }
    }
}
