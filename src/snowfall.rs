//! A texture, drawn flakes and a veil of one colour over a picture, in one pass.
//!
//! Field, opacity, joint opacity and composite go block by block through the first cache, so that a
//! frame costs little more than reading the picture and writing it. The arithmetic is that of
//! [`crate::spectral::opacity`], [`crate::frame::composite::join`] and
//! [`crate::frame::composite::snow`] one after another, to the bit.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3};

use crate::error::{Cancel, Error};
use crate::frame::mix::{OneColour, joint};
use crate::frame::sample::Sample;
use crate::spectral::field::{Ready, Window};
use crate::spectral::opacity::Opacity;
use crate::spectral::stripes::Mapped;

/// What lies over the picture, all of one colour.
pub struct Snowfall<'a, 'f, 'b> {
    /// The texture's field, made ready for the window.
    pub texture: &'a Ready<'f, 'b, f32>,
    /// The part of the frame that the picture shows.
    pub window: &'a Window,
    /// The field's map to opacity.
    pub map: Opacity,
    /// Whether the mean opacity that blur takes is given back.
    pub preserve_mean: bool,
    /// Opacity of the drawn flakes, of the window's shape.
    pub flakes: Option<ArrayView2<'a, f32>>,
    /// Opacity of an even veil.
    pub haze: f64,
    /// The colour, one entry per channel, as a fraction of full scale.
    pub intensity: &'a [f64],
}

/// Pixels that are worked on at once; what lies between two steps stays in the first cache.
const BLOCK: usize = 1024;

impl Snowfall<'_, '_, '_> {
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
        if self.flakes.is_some_and(|flakes| flakes.dim() != shape) {
            return Err(Error::invalid("flakes", format!("must have shape {shape:?}")));
        }
        if !(0.0..=1.0).contains(&self.haze) {
            return Err(Error::invalid("haze", format!("must be from 0 to 1, got {}", self.haze)));
        }
        let layout = || Error::Internal("rows are not contiguous".into());
        if self.flakes.is_some_and(|flakes| flakes.row(0).to_slice().is_none()) {
            return Err(layout());
        }
        let colour = OneColour::<S>::new(self.intensity, channels)?;
        let background = background.to_slice().ok_or_else(layout)?;
        let lines = out.into_shape_with_order((height, width * channels)).map_err(|_| layout())?;
        let clear = (1.0 - self.haze) as f32;
        let mapped = Some(Mapped { map: self.map, preserve_mean: self.preserve_mean });
        let rows = &self.window.rows;
        self.texture.render_rows(self.window, lines, mapped, cancel, |y, alpha, line| {
            let row = y - rows.start;
            let back = &background[row * width * channels..][..width * channels];
            let flakes = self.flakes.as_ref().and_then(|flakes| flakes.row(row).to_slice());
            let mut cover = [0.0; BLOCK];
            for start in (0..width).step_by(BLOCK) {
                let run = start..(start + BLOCK).min(width);
                let cover = &mut cover[..run.len()];
                joint(cover, clear, &alpha[run.clone()], flakes.map(|flakes| &flakes[run.clone()]));
                let run = run.start * channels..run.end * channels;
                colour.over(&mut line[run.clone()], &back[run], cover);
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::composite::{join, snow};
    use crate::spectral::band::Band;
    use crate::spectral::field::Field;
    use crate::spectral::filter::{Alias, TemporalFilter};
    use crate::spectral::tiles::Blend;
    use ndarray::{Array2, Array3, Array4, s};

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
            filter: TemporalFilter { alias: Alias::Soft, soft_from: 0.4, shutter: 0.5 },
            shortest: None,
        };
        let window = Window { rows: 11..83, cols: 40..590 };
        let shape = (window.rows.len(), window.cols.len());
        let map = Opacity { mean: 0.2, spread: 2.0, power: 2.0, amount: 0.8 };
        let flakes = Array2::from_shape_fn(shape, |(y, x)| ((y * 7 + x) % 11) as f32 / 11.0);
        let back = Array3::from_shape_fn((shape.0, shape.1, 3), |(y, x, c)| (y + 3 * x + c) as u8);
        let ready = field.ready::<f32>().unwrap();
        for flakes in [None, Some(flakes.view())] {
            let mut alpha = Array2::zeros(shape);
            let mapped = Some(Mapped { map, preserve_mean: true });
            ready.render(&window, alpha.view_mut(), mapped, &Cancel::new()).unwrap();
            let mut joint = Array2::zeros(shape);
            let layers: Vec<_> = [Some(alpha.view()), flakes].into_iter().flatten().collect();
            join(joint.view_mut(), &layers, 0.1, None, &Cancel::new()).unwrap();
            let intensity = [0.9, 0.8, 1.0];
            let mut wanted = Array3::zeros(back.dim());
            snow(wanted.view_mut(), back.view(), joint.view(), &intensity, &Cancel::new()).unwrap();
            let snowfall = Snowfall {
                texture: &ready,
                window: &window,
                map,
                preserve_mean: true,
                flakes,
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
