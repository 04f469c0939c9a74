//! Opacities of one particle along the rays of a sheet, row by row: the models that look at each ray, and
//! what is cut off.

use super::cut::{Cut, Ends, Ground, Share};
use super::footprint::{Edge, RIM, Scale};
use super::rays::{Forms, PART, Part, Passing, Rays, Sheet};
use super::sprite::{Footprint, Look, Sprite};
use crate::base::normal::{Normal, most};
use crate::base::simd::multiply_add;

/// A sheet of N x N samples on which particles are drawn.
pub struct Canvas<'a, P, const N: usize> {
    pub sheet: &'a Sheet,
    pub ground: Option<&'a Ground<'a, P, N>>,
    pub through: &'a mut [[P; N]; N],
    /// Premultiplied light, three planes; None if all particles have one color.
    pub light: Option<[&'a mut [[P; N]; N]; 3]>,
}

/// Where a particle's opacity comes from.
pub enum Source<'a, P, const N: usize> {
    /// From each sample's ray.
    Ray(&'a Rays<P, N>),
    /// The product of two vectors, across and down the sheet, as a scale turns it into opacities.
    Product(&'a [P; N], &'a [P; N], Scale<P>),
}

impl<P: Normal, const N: usize> Canvas<'_, P, N> {
    /// Draws a particle on the rows and columns [first, last) that it can touch.
    #[inline(always)]
    pub fn draw<const LEVEL: u8>(
        &mut self,
        source: &Source<'_, P, N>,
        sprite: &Sprite,
        look: &Look,
        [columns, rows]: [[usize; 2]; 2],
        cut: Cut,
        color: [P; 3],
    ) {
        let scale = Scale::<P>::of(sprite.opacity, look.edge);
        let square = look.edge == Edge::Square;
        let facing = sprite.model == Footprint::Viewpoint;
        let forms = Forms::of(sprite, self.sheet);
        let ends = (cut != Cut::CLEAR).then(|| Ends::<P>::of(sprite, look, cut));
        let rays = if let Source::Ray(rays) = source { Some(*rays) } else { None };
        for row in rows[0]..rows[1] {
            let touched =
                if rays.is_some() { forms.touched(row, columns[1]) } else { Some(columns) };
            let Some([first, last]) = touched else { continue };
            let beside = forms.row::<P>(row);
            for part in first.max(columns[0]) / PART..last.div_ceil(PART) {
                // No closure: it would lose the instructions.
                let mut passing = Passing::<P>::none();
                if let Some(rays) = rays {
                    passing = beside.passing::<N, LEVEL>(rays, row, part, facing);
                }
                let mut share = Share::Whole;
                if let Some(ends) = &ends {
                    let length = rays.map(|rays| rays.lengths(row, part));
                    let ground = self.ground.map(|ground| part_of(&ground.depth[row], part));
                    share = ends.share::<LEVEL>(&passing.lean, length, ground);
                }
                if let Share::Hidden = share {
                    continue;
                }
                let mut alpha = match source {
                    Source::Ray(_) => gauss::<P, LEVEL>(passing.squared, scale, square),
                    Source::Product(across, down, scale) => {
                        product::<P, N, LEVEL>(across, scale.gain * down[row], scale.floor, part)
                    }
                };
                if let Share::Part(share) = &share {
                    for k in 0..PART {
                        alpha[k] *= share[k];
                    }
                }
                let span = part * PART..(part + 1) * PART;
                let through = &mut self.through[row][span.clone()];
                let through = through.try_into().expect("PART of them");
                match &mut self.light {
                    None => dim::<P, LEVEL>(through, &alpha),
                    Some(light) => {
                        let [red, green, blue] = light;
                        let planes = [&mut red[row], &mut green[row], &mut blue[row]]
                            .map(|plane| &mut plane[span.clone()]);
                        lit::<P, LEVEL>(through, planes, &alpha, color);
                    }
                }
            }
        }
    }
}

/// Whether no sample lets through more than `error`: nothing that comes could add more.
#[inline(always)]
pub fn finished<P: Normal, const N: usize>(through: &[[P; N]; N], error: P) -> bool {
    let mut greatest = [P::zero(); N];
    for row in through {
        for k in 0..N {
            greatest[k] = most(row[k], greatest[k]);
        }
    }
    greatest.iter().fold(P::zero(), |a, &b| most(a, b)) <= error
}

#[inline(always)]
fn part_of<P, const N: usize>(row: &[P; N], part: usize) -> &Part<P> {
    row[part * PART..(part + 1) * PART].try_into().expect("PART of them")
}

#[inline(always)]
fn gauss<P: Normal, const LEVEL: u8>(squared: Part<P>, scale: Scale<P>, square: bool) -> Part<P> {
    let mut alpha = [P::zero(); PART];
    for k in 0..PART {
        let g = P::exp_at::<LEVEL>(most(P::of(-0.5) * squared[k], P::of(-80.0)));
        alpha[k] = most(multiply_add::<P, LEVEL>(scale.gain, g, -scale.floor), P::zero());
    }
    if square {
        for k in 0..PART {
            alpha[k] = if squared[k] > P::of(9.0) { P::zero() } else { alpha[k] };
        }
    }
    alpha
}

#[inline(always)]
fn product<P: Normal, const N: usize, const LEVEL: u8>(
    across: &[P; N],
    gain: P,
    floor: P,
    part: usize,
) -> Part<P> {
    let across = part_of(across, part);
    let mut alpha = [P::zero(); PART];
    for k in 0..PART {
        alpha[k] = most(multiply_add::<P, LEVEL>(gain, across[k], -floor), P::zero());
    }
    alpha
}

/// T -= T alpha. Subtracting and not multiplying by a rounded 1 - alpha keeps many faint layers right.
#[inline(always)]
fn dim<P: Normal, const LEVEL: u8>(through: &mut Part<P>, alpha: &Part<P>) {
    for k in 0..PART {
        through[k] = multiply_add::<P, LEVEL>(-through[k], alpha[k], through[k]);
    }
}

/// The same, and light += T alpha color.
#[inline(always)]
fn lit<P: Normal, const LEVEL: u8>(
    through: &mut Part<P>,
    planes: [&mut [P]; 3],
    alpha: &Part<P>,
    color: [P; 3],
) {
    let mut share = [P::zero(); PART];
    for k in 0..PART {
        share[k] = through[k] * alpha[k];
        through[k] = through[k] - share[k];
    }
    for (plane, color) in planes.into_iter().zip(color) {
        let plane: &mut Part<P> = plane.try_into().expect("PART of them");
        for k in 0..PART {
            plane[k] = multiply_add::<P, LEVEL>(share[k], color, plane[k]);
        }
    }
}

/// The tapered Gaussian at a distance q in sigma, float64.
pub fn tapered(q: f64) -> f64 {
    ((libm::exp(-0.5 * q * q) - RIM) / (1.0 - RIM)).max(0.0)
}
