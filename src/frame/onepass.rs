//! A texture, drawn flakes and a veil of one color over a picture, in one pass.
//!
//! Field, opacity, joint opacity and composite go block by block through the first cache, so that a
//! frame costs little more than reading the picture and writing it. The arithmetic is that of
//! [`crate::spectral::opacity`], [`crate::frame::composite::join`] and
//! [`crate::frame::composite::snow`] one after another, to the bit.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3};

use crate::base::error::{Cancel, Error, zeroed};
use crate::frame::mix::{OneColor, joint};
use crate::frame::sample::Sample;
use crate::particles::bins::TILE;
use crate::particles::sorted::Sorted;
use crate::spectral::field::{Ready, Window};
use crate::spectral::opacity::Opacity;
use crate::spectral::stripes::Mapped;

/// Flakes that lie over the texture.
#[derive(Clone, Copy)]
pub enum Drawn<'a> {
    /// None.
    Nothing,
    /// Opacities, of the window's shape.
    Plane(ArrayView2<'a, f32>),
    /// Those of the frame, to be drawn: no plane of them is ever held.
    Sorted(&'a Sorted),
}

/// What lies over the picture, all of one color.
pub struct Snowfall<'a, 'f, 'b, 'd> {
    /// The texture's field, made ready for the window.
    pub texture: &'a Ready<'f, 'b, f32>,
    /// The part of the frame that the picture shows.
    pub window: &'a Window,
    /// The field's map to opacity.
    pub map: Opacity,
    /// Whether the mean opacity that blur takes is given back.
    pub preserve_mean: bool,
    /// Flakes, each opacity drawn as its row comes, or drawn already, of the window's shape.
    pub flakes: Drawn<'d>,
    /// Opacity of an even veil.
    pub haze: f64,
    /// The color, one entry per channel, as a fraction of full scale.
    pub intensity: &'a [f64],
}

/// Pixels that are worked on at once; what lies between two steps stays in the first cache.
const BLOCK: usize = 1024;

impl Snowfall<'_, '_, '_, '_> {
    /// Writes the snow over `background` to `out`, both of the window's shape.
    pub fn over<S: Sample>(
        &self,
        out: ArrayViewMut3<'_, S>,
        background: ArrayView3<'_, S>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let shape = (self.window.rows.len(), self.window.cols.len());
        let (height, width, channels) = background.dim();
        if (height, width) != shape {
            let message = format!("must have shape {shape:?}, got {:?}", (height, width));
            return Err(Error::invalid("background", message));
        }
        let layout = || Error::Internal("rows are not contiguous".into());
        match self.flakes {
            Drawn::Plane(flakes) if flakes.dim() != shape => {
                return Err(Error::invalid("flakes", format!("must have shape {shape:?}")));
            }
            Drawn::Plane(flakes) if flakes.row(0).to_slice().is_none() => return Err(layout()),
            Drawn::Sorted(sorted) if sorted.shape() != self.texture.shape() => {
                return Err(Error::invalid("flakes", "must be those of the texture's frame"));
            }
            _ => {}
        }
        if !(0.0..=1.0).contains(&self.haze) {
            return Err(Error::invalid("haze", format!("must be from 0 to 1, got {}", self.haze)));
        }
        let color = OneColor::<S>::new(self.intensity, channels)?;
        let background = background.to_slice().ok_or_else(layout)?;
        let lines = out.into_shape_with_order((height, width * channels)).map_err(|_| layout())?;
        let clear = (1.0 - self.haze) as f32;
        let mapped = Some(Mapped { map: self.map, preserve_mean: self.preserve_mean });
        let rows = &self.window.rows;
        let all = &self.window.cols;
        let (color, background) = (&color, &background);
        let begin = |cols: &Range<usize>| {
            let (cols, wide) = (cols.clone(), cols.len());
            let inside = cols.start - all.start..cols.end - all.start;
            let mut strip: Vec<f32> = match self.flakes {
                Drawn::Sorted(_) => zeroed(TILE * wide)?,
                _ => Vec::new(),
            };
            // The row of tiles that the strip holds.
            let mut held = usize::MAX;
            Ok(move |y: usize, alpha: &[f32], line: &mut [S]| {
                let row = y - rows.start;
                let first = (row * width + inside.start) * channels;
                let back = &background[first..][..wide * channels];
                let flakes = match &self.flakes {
                    Drawn::Nothing => None,
                    Drawn::Plane(flakes) => {
                        flakes.row(row).to_slice().map(|line| &line[inside.clone()])
                    }
                    Drawn::Sorted(sorted) => {
                        if held != y / TILE {
                            held = y / TILE;
                            sorted.row_of_tiles(held, cols.clone(), &mut strip, cancel)?;
                        }
                        Some(&strip[y % TILE * wide..][..wide])
                    }
                };
                let mut cover = [0.0; BLOCK];
                for start in (0..wide).step_by(BLOCK) {
                    let run = start..(start + BLOCK).min(wide);
                    let cover = &mut cover[..run.len()];
                    let flakes = flakes.map(|flakes| &flakes[run.clone()]);
                    joint(cover, clear, &alpha[run.clone()], flakes);
                    let run = run.start * channels..run.end * channels;
                    color.over(&mut line[run.clone()], &back[run], cover);
                }
                Ok(())
            })
        };
        self.texture.render_rows(self.window, lines, mapped, cancel, S::floats, begin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::composite::{join, snow};
    use crate::particles::splat::Flakes;
    use crate::particles::sprite::Lens;
    use crate::spectral::band::Band;
    use crate::spectral::field::Field;
    use crate::spectral::filter::{Alias, TemporalFilter};
    use crate::spectral::tiles::Blend;
    use ndarray::{Array2, Array3, Array4, array, s};

    #[test]
    fn one_pass_has_the_bits_of_the_steps() {
        let still = Array4::zeros((1, 1, 1, 2));
        let moved = Array4::from_shape_vec((1, 1, 1, 2), vec![3.0, -7.5]).unwrap();
        let field = Field {
            shape: (90, 610),
            tile: (32, 32),
            overlap: 7,
            blend: Blend::Power,
            band: Band { shortest: 2.0, longest: 12.0, exponent: 0.75 },
            seed: 5,
            jitter: false,
            ring_edges: &[],
            ring_gains: &[],
            drift: moved.view(),
            shift: still.view(),
            velocity: moved.view(),
            shift_rate: still.view(),
            lap: None,
            filter: TemporalFilter { alias: Alias::Soft, soft_from: 0.4, shutter: 0.5 },
            shortest: None,
        };
        let window = Window { rows: 11..83, cols: 40..590 };
        let shape = (window.rows.len(), window.cols.len());
        let map = Opacity { mean: 0.2, spread: 2.0, power: 2.0, amount: 0.8 };
        let flakes = Array2::from_shape_fn(shape, |(y, x)| ((y * 7 + x) % 11) as f32 / 11.0);
        let back = Array3::from_shape_fn((shape.0, shape.1, 3), |(y, x, c)| (y + 3 * x + c) as u8);
        let ready = field.ready::<f32>().unwrap();
        let intensity = [0.9, 0.8, 1.0];
        let cancel = Cancel::new();
        let (points, radius) = (array![[0.3, 0.1, 1.0], [-0.5, -0.05, 0.7]], array![0.2, 0.05]);
        let (opacity, velocity) = (array![0.9], array![[0.1, 0.4, 0.0]]);
        let some = Flakes {
            points: points.view(),
            radius: radius.view(),
            opacity: opacity.view(),
            velocity: velocity.view(),
            shutter: 0.2,
        };
        let lens = Lens { focal: 300.0, center: [305.0, 45.0], offset: [0.0; 3], near: 0.1 };
        let sorted = Sorted::of(&some, &lens, field.shape, &cancel).unwrap();
        let mut plane = Array2::zeros(shape);
        let part = [window.rows.start, window.rows.end, window.cols.start, window.cols.end];
        sorted.draw(plane.view_mut(), part, None::<ArrayView2<'_, f32>>, &cancel).unwrap();
        assert!(plane.iter().any(|&alpha: &f32| alpha > 0.5));
        for (drawn, flakes) in [
            (Drawn::Nothing, None),
            (Drawn::Plane(flakes.view()), Some(flakes.view())),
            (Drawn::Sorted(&sorted), Some(plane.view())),
        ] {
            let mut alpha = Array2::zeros(shape);
            let mapped = Some(Mapped { map, preserve_mean: true });
            ready.render(&window, alpha.view_mut(), mapped, &Cancel::new()).unwrap();
            let mut joint = Array2::zeros(shape);
            let layers: Vec<_> = [Some(alpha.view()), flakes].into_iter().flatten().collect();
            join(joint.view_mut(), &layers, 0.1, None, &Cancel::new()).unwrap();
            let mut wanted = Array3::zeros(back.dim());
            snow(wanted.view_mut(), back.view(), joint.view(), &intensity, &Cancel::new()).unwrap();
            let snowfall = Snowfall {
                texture: &ready,
                window: &window,
                map,
                preserve_mean: true,
                flakes: drawn,
                haze: 0.1,
                intensity: &intensity,
            };
            let mut got = Array3::zeros(back.dim());
            snowfall.over(got.view_mut(), back.view(), &Cancel::new()).unwrap();
            assert_eq!(got, wanted);
            assert_ne!(got.slice(s![.., .., 0]), back.slice(s![.., .., 0]));
        }
    }
}
