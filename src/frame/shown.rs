//! What the pixels of a layer show besides color, where flakes hide a texture: what those that are seen say of
//! themselves, written over what the texture says.

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis};

use crate::base::error::{Cancel, Error, layout};
use crate::base::pool::{self, line};

const BAND: usize = 32;

/// Pixels that are looked at together: where none of them has a flake there is nothing to write.
const RUN: usize = 32;

/// A flake's motion forward x, y and backward x, y, its depth, and its identity.
pub type Said = ([f32; 5], i64);

/// Flakes, and what is asked of every pixel: the flake that shows most, -1 for none, and opacities.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// Of all flakes, by their numbers.
    pub said: &'a [Said],
    /// (h, w).
    pub numbers: ArrayView2<'a, i32>,
    /// Of the flakes together.
    pub front: ArrayView2<'a, f32>,
    /// Of the texture behind them, if there is one.
    pub behind: Option<ArrayView2<'a, f32>>,
}

/// What a layer says of its pixels, (h, w, 2) and (h, w).
pub struct Passes<'a> {
    /// To the next frame.
    pub forward: ArrayViewMut3<'a, f32>,
    /// To the one before.
    pub backward: ArrayViewMut3<'a, f32>,
    /// World units.
    pub depth: ArrayViewMut2<'a, f32>,
    /// Of the flakes that show most.
    pub ids: ArrayViewMut2<'a, i64>,
}

/// Finishes what the texture says: flakes say it where there is more of one than of the texture behind all of
/// them, nothing is said where the layer's `alpha` is 0, and what shows lies before the `scene`.
pub fn finish(
    passes: Passes<'_>,
    alpha: ArrayView2<'_, f32>,
    scene: Option<ArrayView2<'_, f32>>,
    flakes: Option<Shown<'_>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (rows, columns) = alpha.dim();
    let Passes { mut forward, mut backward, mut depth, mut ids } = passes;
    let planes = flakes.map(|one| [Some(one.front), one.behind]).into_iter().flatten().flatten();
    let fits = [forward.dim(), backward.dim()] == [(rows, columns, 2); 2]
        && [depth.dim(), ids.dim()] == [(rows, columns); 2]
        && flakes.is_none_or(|one| one.numbers.dim() == (rows, columns))
        && planes.chain(scene).all(|plane| plane.dim() == (rows, columns));
    if !fits {
        return Err(Error::Internal("planes of different shapes".into()));
    }
    let ways = forward
        .axis_chunks_iter_mut(Axis(0), BAND)
        .zip(backward.axis_chunks_iter_mut(Axis(0), BAND));
    let planes =
        depth.axis_chunks_iter_mut(Axis(0), BAND).zip(ids.axis_chunks_iter_mut(Axis(0), BAND));
    pool::for_each(ways.zip(planes).enumerate(), |(band, (mut ways, (mut depth, mut ids)))| {
        cancel.check()?;
        for row in 0..depth.nrows() {
            let at = band * BAND + row;
            let (mut ahead, mut behind) =
                (ways.0.index_axis_mut(Axis(0), row), ways.1.index_axis_mut(Axis(0), row));
            let (mut depth, mut ids) = (depth.row_mut(row), ids.row_mut(row));
            let (Some(ahead), Some(behind), Some(depth), Some(ids)) = (
                ahead.as_slice_mut(),
                behind.as_slice_mut(),
                depth.as_slice_mut(),
                ids.as_slice_mut(),
            ) else {
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
            ids.fill(-1);
            if let Some(Shown { said, numbers, front, behind: texture }) = flakes {
                let (numbers, front) = (line(numbers, at)?, line(front, at)?);
                let texture = texture.map(|texture| line(texture, at)).transpose()?;
                for start in (0..columns).step_by(RUN) {
                    let run = start..columns.min(start + RUN);
                    if numbers[run.clone()].iter().fold(-1, |most, &one| one.max(most)) < 0 {
                        continue;
                    }
                    for column in run {
                        let Some((said, id)) = said.get(numbers[column] as usize) else { continue };
                        ids[column] = *id;
                        let through =
                            texture.map_or(0.0, |texture| texture[column] * (1.0 - front[column]));
                        if front[column] > through {
                            ahead[column] = [said[0], said[1]];
                            behind[column] = [said[2], said[3]];
                            depth[column] = said[4];
                        }
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
        let numbers = array![[-1, 2, 0], [0, 1, 2]];
        let front = array![[0.0, 0.5, 0.5], [0.1, 0.4, 0.0_f32]];
        let behind = array![[0.2, 0.4, 0.9], [0.0, 0.7, 0.3_f32]];
        let alpha = array![[0.2, 0.7, 0.95], [0.1, 0.82, 0.0_f32]];
        let said: [Said; 3] = std::array::from_fn(|flake| {
            (std::array::from_fn(|part| (10 * flake + part) as f32), 70 + flake as i64)
        });
        let (numbers, front, behind) = (numbers.view(), front.view(), Some(behind.view()));
        let shown = Shown { said: &said, numbers, front, behind };
        let (mut forward, mut backward) =
            (Array3::from_elem((2, 3, 2), 7.0), Array3::zeros((2, 3, 2)));
        let (mut depth, mut ids) = (Array2::from_elem((2, 3), 9.0), Array2::zeros((2, 3)));
        let passes = Passes {
            forward: forward.view_mut(),
            backward: backward.view_mut(),
            depth: depth.view_mut(),
            ids: ids.view_mut(),
        };
        let scene = Array2::from_elem((2, 3), 8.0);
        finish(passes, alpha.view(), Some(scene.view()), Some(shown), &Cancel::new()).unwrap();
        // At (0, 2) half of 0.9 is left: less than the flake's 0.5. At (1, 1) 0.42 of the texture.
        assert_eq!(depth, array![[8.0, 8.0, 4.0], [4.0, 8.0, f32::INFINITY]]);
        assert_eq!(forward.index_axis(Axis(2), 0), array![[7.0, 20.0, 0.0], [0.0, 7.0, 0.0]]);
        assert_eq!(backward.index_axis(Axis(2), 1), array![[0.0, 23.0, 3.0], [3.0, 0.0, 0.0]]);
        assert_eq!(ids, array![[-1, 72, 70], [70, 71, 72]]);
    }
}
