//! What the pixels of a layer show besides color, where flakes hide a texture: which flakes are seen, and
//! what they say of themselves written over what the texture says.

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis};

use crate::base::error::{Cancel, Error, layout, zeroed};
use crate::base::pool::{self, line};

const BAND: usize = 32;

/// What is asked of every pixel: the flake that shows most, -1 for none, and opacities.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// (h, w).
    pub numbers: ArrayView2<'a, i32>,
    /// Of the flakes together.
    pub front: ArrayView2<'a, f32>,
    /// Of the texture behind them, if there is one.
    pub behind: Option<ArrayView2<'a, f32>>,
}

impl Shown<'_> {
    fn check(&self) -> Result<(), Error> {
        let shape = self.numbers.dim();
        let alike =
            self.front.dim() == shape && self.behind.is_none_or(|plane| plane.dim() == shape);
        if alike { Ok(()) } else { Err(Error::Internal("planes of different shapes".into())) }
    }

    /// The flakes that are seen in a row, by column: where there is more of one than of the texture behind
    /// all flakes.
    #[inline(always)]
    fn row(&self, row: usize) -> Result<impl Fn(usize) -> Option<usize>, Error> {
        let numbers = line(self.numbers, row)?;
        let front = &line(self.front, row)?[..numbers.len()];
        let behind = self.behind.map(|behind| line(behind, row)).transpose()?;
        let behind = behind.map(|behind| &behind[..numbers.len()]);
        Ok(move |column: usize| {
            let through = behind.map_or(0.0, |behind| behind[column] * (1.0 - front[column]));
            (numbers[column] >= 0 && front[column] > through).then_some(numbers[column] as usize)
        })
    }

    /// The numbers of the flakes that are seen anywhere, in order.
    pub fn seen(&self, cancel: &Cancel) -> Result<Vec<i32>, Error> {
        self.check()?;
        let most = self.numbers.iter().copied().max().unwrap_or(-1);
        let mut met: Vec<u8> = zeroed((most.max(-1) + 1) as usize)?;
        for row in 0..self.numbers.nrows() {
            cancel.check()?;
            let (flake, mut last) = (self.row(row)?, None);
            for column in 0..self.numbers.ncols() {
                let found = flake(column);
                if found != last
                    && let Some(number) = found
                {
                    met[number] = 1;
                }
                last = found;
            }
        }
        let mut seen = zeroed(met.iter().map(|&met| usize::from(met)).sum())?;
        let numbers = (0..).zip(&met).filter(|(_, met)| **met == 1);
        seen.iter_mut().zip(numbers).for_each(|(seen, (number, _))| *seen = number);
        Ok(seen)
    }
}

/// What flakes say of themselves: forward x, y, backward x, y, depth.
const SAID: usize = 5;

/// What a layer says of its pixels, (h, w, 2) and (h, w).
pub struct Passes<'a> {
    /// To the next frame.
    pub forward: ArrayViewMut3<'a, f32>,
    /// To the one before.
    pub backward: ArrayViewMut3<'a, f32>,
    /// World units.
    pub depth: ArrayViewMut2<'a, f32>,
}

/// Flakes that are seen in a layer, by rising numbers, and what each says, (n, 5).
pub struct Flakes<'a> {
    pub shown: Shown<'a>,
    pub seen: &'a [i32],
    pub said: ArrayView2<'a, f32>,
}

/// Finishes what the texture says: flakes say it where they are seen, nothing is said where the layer's
/// `alpha` is 0, and what shows lies before the `scene`.
pub fn finish(
    passes: Passes<'_>,
    alpha: ArrayView2<'_, f32>,
    scene: Option<ArrayView2<'_, f32>>,
    flakes: Option<&Flakes<'_>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (rows, columns) = alpha.dim();
    let Passes { mut forward, mut backward, mut depth } = passes;
    let mut fits = [forward.dim(), backward.dim()] == [(rows, columns, 2); 2]
        && depth.dim() == (rows, columns)
        && scene.is_none_or(|scene| scene.dim() == (rows, columns));
    let mut places: Vec<u32> = Vec::new();
    if let Some(Flakes { shown, seen, said }) = flakes {
        shown.check()?;
        fits = fits
            && shown.numbers.dim() == (rows, columns)
            && said.dim() == (seen.len(), SAID)
            && seen.is_sorted()
            && seen.first().is_none_or(|&first| first >= 0);
        if fits {
            places = zeroed(seen.last().map_or(0, |&last| last as usize + 1))?;
            (0..).zip(*seen).for_each(|(place, &number)| places[number as usize] = place);
        }
    }
    if !fits {
        return Err(Error::Internal("planes or flakes do not fit".into()));
    }
    let ways = forward
        .axis_chunks_iter_mut(Axis(0), BAND)
        .zip(backward.axis_chunks_iter_mut(Axis(0), BAND));
    let bands = ways.zip(depth.axis_chunks_iter_mut(Axis(0), BAND)).enumerate();
    pool::for_each(bands, |(band, ((mut forward, mut backward), mut depth))| {
        cancel.check()?;
        for row in 0..depth.nrows() {
            let at = band * BAND + row;
            let (mut ahead, mut behind) =
                (forward.index_axis_mut(Axis(0), row), backward.index_axis_mut(Axis(0), row));
            let mut depth = depth.row_mut(row);
            let (Some(ahead), Some(behind), Some(depth)) =
                (ahead.as_slice_mut(), behind.as_slice_mut(), depth.as_slice_mut())
            else {
                return Err(layout());
            };
            let (ahead, behind) = (ahead.as_chunks_mut::<2>().0, behind.as_chunks_mut::<2>().0);
            // First, since a flake may be too faint for the layer's alpha and still have its number.
            let alpha = line(alpha, at)?;
            if alpha.iter().filter(|&&alpha| alpha <= 0.0).count() > 0 {
                let pixels = ahead.iter_mut().zip(&mut *behind).zip(&mut *depth);
                for (((ahead, behind), depth), &alpha) in pixels.zip(alpha) {
                    if alpha <= 0.0 {
                        (*ahead, *behind, *depth) = ([0.0; 2], [0.0; 2], f32::INFINITY);
                    }
                }
            }
            if let Some(Flakes { shown, said, .. }) = flakes {
                let flake = shown.row(at)?;
                for (column, ((ahead, behind), depth)) in
                    ahead.iter_mut().zip(&mut *behind).zip(&mut *depth).enumerate()
                {
                    if let Some(number) = flake(column) {
                        let said = line(*said, places[number] as usize)?;
                        *ahead = [said[0], said[1]];
                        *behind = [said[2], said[3]];
                        *depth = said[4];
                    }
                }
            }
            if let Some(scene) = scene {
                for (depth, &scene) in depth.iter_mut().zip(line(scene, at)?) {
                    *depth = if depth.is_finite() { depth.min(scene) } else { *depth };
                }
            }
        }
        Ok(())
    })
}

/// Writes the layer of an alpha and one color, (h, w, 4), premultiplied.
pub fn rgba(
    mut out: ArrayViewMut3<'_, f32>,
    alpha: ArrayView2<'_, f32>,
    color: [f32; 3],
    cancel: &Cancel,
) -> Result<(), Error> {
    let (rows, columns) = alpha.dim();
    if out.dim() != (rows, columns, 4) {
        return Err(Error::Internal("not a picture of the alpha's shape".into()));
    }
    let [r, g, b] = color;
    pool::for_each(out.outer_iter_mut().zip(alpha.outer_iter()), |(mut line, alpha)| {
        cancel.check()?;
        let (Some(line), Some(alpha)) = (line.as_slice_mut(), alpha.as_slice()) else {
            return Err(layout());
        };
        for (pixel, &alpha) in line.as_chunks_mut().0.iter_mut().zip(alpha) {
            *pixel = [alpha * r, alpha * g, alpha * b, alpha];
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Array3, array};

    #[test]
    fn flakes_that_are_seen_say_what_they_know() {
        let numbers = array![[-1, 70, 3], [3, 500, 70]];
        let front = array![[0.0, 0.5, 0.5], [0.1, 0.4, 0.0_f32]];
        let behind = array![[0.2, 0.4, 0.9], [0.0, 0.7, 0.3_f32]];
        let alpha = array![[0.2, 0.7, 0.95], [0.1, 0.82, 0.0_f32]];
        let shown =
            Shown { numbers: numbers.view(), front: front.view(), behind: Some(behind.view()) };
        let cancel = Cancel::new();
        // At (0, 2) half of 0.9 is left: less than the flake's 0.5. At (1, 1) 0.42 of the texture.
        let seen = shown.seen(&cancel).unwrap();
        assert_eq!(seen, [3, 70]);
        let said = Array2::from_shape_fn((2, SAID), |(row, part)| (10 * row + part) as f32);
        let (mut forward, mut backward) =
            (Array3::from_elem((2, 3, 2), 7.0), Array3::zeros((2, 3, 2)));
        let mut depth = Array2::from_elem((2, 3), 9.0);
        let flakes = Flakes { shown, seen: &seen, said: said.view() };
        let passes = Passes {
            forward: forward.view_mut(),
            backward: backward.view_mut(),
            depth: depth.view_mut(),
        };
        let scene = Array2::from_elem((2, 3), 8.0);
        finish(passes, alpha.view(), Some(scene.view()), Some(&flakes), &cancel).unwrap();
        assert_eq!(depth, array![[8.0, 8.0, 4.0], [4.0, 8.0, f32::INFINITY]]);
        assert_eq!(forward.index_axis(Axis(2), 0), array![[7.0, 10.0, 0.0], [0.0, 7.0, 0.0]]);
        assert_eq!(backward.index_axis(Axis(2), 1), array![[0.0, 13.0, 3.0], [3.0, 0.0, 0.0]]);
    }
}
