//! Particles drawn into one tile: T -= T alpha, and light += T alpha color, front to back.
//!
//! Footprints that are products of two short vectors are drawn a few at a time (see [`Batch`]), others
//! row by row. The tile's transmittance stays in the L1 cache. Subtracting T alpha and not multiplying
//! by a rounded 1 - alpha keeps many faint layers right in float32.
//!
//! Loops over lanes are plain loops with a fixed count: a closure would not inherit the instruction
//! set that the function is compiled for, and would run many times slower.

#![expect(
    clippy::needless_range_loop,
    reason = "an index over lanes of a fixed count is what vectorises without closures"
)]

use super::batch::Batch;
use super::bins::Entry;
use super::footprint::{self, Edge, Scale};
use super::ray::{self, Cut, Forms, Ground, Rays};
use super::sprite::{Form, Look, Sprite};
use crate::base::error::{Cancel, Error};
use crate::base::normal::{Normal, most};
use crate::base::simd::{dispatch, multiply_add};

/// Side of a tile, px.
pub const TILE: usize = 64;

/// Pixels of a tile.
pub const PIXELS: usize = TILE * TILE;

/// A number for each pixel of a tile, row by row.
///
/// A particle that touches a row of a tile is computed for the whole of it: loops of one fixed length
/// have no ends to look after, which costs more than what they leave out.
///
/// Aligned to cache lines: a vector's store that crosses one costs twice.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Plane<P>(pub [[P; TILE]; TILE]);

/// A row of a tile on the stack, aligned likewise.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Row<P>(pub(super) [P; TILE]);

/// Particles between two looks at what is still let through, and at the cancel flag.
const LOOK: usize = 16;

/// All that is drawn: sprites in no order, the colors of the particles, and how.
pub struct Drawing<'a> {
    /// The images.
    pub sprites: &'a [Sprite],
    /// Linear RGB of each particle, by its index; one for all if there is one.
    pub colors: &'a [[f64; 3]],
    /// How.
    pub look: &'a Look,
}

/// One tile while it is drawn.
pub struct Tile<'a, P> {
    /// Its corner (x, y), px.
    pub origin: [usize; 2],
    /// What it lets through, 1 at first; 0 beyond the picture's border.
    pub through: &'a mut Plane<P>,
    /// Premultiplied light, three planes; None if all particles have one color.
    pub light: Option<&'a mut [Plane<P>; 3]>,
    /// The pixels' rays, where a particle needs them.
    pub rays: Option<&'a Rays>,
    /// What stands in the picture.
    pub ground: Option<&'a Ground<'a, P>>,
}

dispatch! {
    /// Draws the particles of a band's list into one of its tiles, front to back.
    pub fn draw<P: Normal>(
        tile: &mut Tile<'_, P>,
        list: &[Entry],
        drawing: &Drawing<'_>,
        cancel: &Cancel,
    ) -> Result<(), Error> = draw_with
}

#[inline(always)]
fn draw_with<P: Normal, const LEVEL: u8>(
    tile: &mut Tile<'_, P>,
    list: &[Entry],
    drawing: &Drawing<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let [left, top] = tile.origin;
    let mut drawn = 0;
    let mut batch = Batch::<P>::empty();
    for entry in list {
        if entry.right as usize <= left || entry.left as usize >= left + TILE {
            continue;
        }
        let sprite = &drawing.sprites[entry.sprite as usize];
        let look = drawing.look;
        let cut = ray::cut(sprite, look, tile.rays, tile.ground);
        if cut == Cut::Hidden {
            continue;
        }
        drawn += 1;
        if drawn % LOOK == 0 {
            cancel.check()?;
            batch.draw::<LEVEL>(tile);
            if finished(tile.through, P::of(look.error)) {
                break;
            }
        }
        let within = |range: [u32; 2], start: usize| {
            let [low, high] = range.map(|v| v as usize);
            [low.max(start) - start, (high - start).min(TILE)]
        };
        let rows = within(sprite.rows, top);
        let color = drawing.colors[(sprite.index as usize).min(drawing.colors.len() - 1)];
        let color = color.map(P::of);
        if sprite.form != Form::Ray && cut == Cut::Clear {
            let columns = within([entry.left, entry.right], left);
            batch.add::<LEVEL>(tile, sprite, look, [columns, rows], color);
        } else {
            batch.draw::<LEVEL>(tile);
            by_rows::<P, LEVEL>(tile, sprite, look, rows, cut, color);
        }
    }
    batch.draw::<LEVEL>(tile);
    Ok(())
}

/// Whether nothing that comes could add more than `error`.
#[inline(always)]
fn finished<P: Normal>(through: &Plane<P>, error: P) -> bool {
    let mut greatest = [P::zero(); TILE];
    for row in &through.0 {
        for k in 0..TILE {
            greatest[k] = most(row[k], greatest[k]);
        }
    }
    greatest.iter().fold(P::zero(), |a, &b| most(a, b)) <= error
}

/// Pixels of a part of a vector: an exponential costs as much as some pixels of a particle.
pub(super) const PART: usize = 16;

/// The two vectors whose product is the footprint: across the tile, and down its rows.
///
/// Only parts that `spans` touch, [first, last) across and down, are filled.
#[inline(always)]
pub(super) fn vectors<P: Normal, const LEVEL: u8>(
    tile: &Tile<'_, P>,
    sprite: &Sprite,
    look: &Look,
    spans: [[usize; 2]; 2],
) -> (Row<P>, Row<P>, Scale<P>) {
    let mut vectors = [Row([P::zero(); TILE]); 2];
    for axis in 0..2 {
        let first = tile.origin[axis] as f64;
        let (middle, radius) = (sprite.middle[axis], sprite.radius);
        let values = &mut vectors[axis].0;
        match sprite.form {
            Form::Box => footprint::pixel_box(values, first, middle, radius),
            Form::Table => footprint::looked_up(values, first, middle, radius),
            Form::Point | Form::Ray => {
                let step = 3.0 / radius;
                let square = look.edge == Edge::Square;
                let start = (first + 0.5 - middle) * step;
                let [from, to] = spans[axis];
                for part in from / PART..to.div_ceil(PART) {
                    let first = part * PART;
                    let values = &mut values[first..first + PART];
                    let values: &mut [P; PART] = values.try_into().expect("PART of them");
                    footprint::point::<P, PART, LEVEL>(values, first, start, step, square);
                }
            }
        }
    }
    let scale = match sprite.form {
        Form::Box => Scale::of_box(sprite.opacity, look.edge),
        _ => Scale::of(sprite.opacity, look.edge),
    };
    let [across, down] = vectors;
    (across, down, scale)
}

/// T -= T alpha with alpha = max(0, gain g - floor), for one row.
#[inline(always)]
fn dim<P: Normal, const LEVEL: u8>(through: &mut [P; TILE], across: &[P; TILE], gain: P, floor: P) {
    for k in 0..TILE {
        let alpha = most(multiply_add::<P, LEVEL>(gain, across[k], -floor), P::zero());
        through[k] = multiply_add::<P, LEVEL>(-through[k], alpha, through[k]);
    }
}

/// The same, and light += T alpha color.
#[inline(always)]
fn lit<P: Normal, const LEVEL: u8>(
    through: &mut [P; TILE],
    [red, green, blue]: [&mut [P; TILE]; 3],
    across: &[P; TILE],
    gain: P,
    floor: P,
    color: [P; 3],
) {
    for k in 0..TILE {
        let alpha = most(multiply_add::<P, LEVEL>(gain, across[k], -floor), P::zero());
        let share = through[k] * alpha;
        through[k] = through[k] - share;
        red[k] = multiply_add::<P, LEVEL>(share, color[0], red[k]);
        green[k] = multiply_add::<P, LEVEL>(share, color[1], green[k]);
        blue[k] = multiply_add::<P, LEVEL>(share, color[2], blue[k]);
    }
}

/// Everything else: a row of opacities at a time.
#[inline(always)]
fn by_rows<P: Normal, const LEVEL: u8>(
    tile: &mut Tile<'_, P>,
    sprite: &Sprite,
    look: &Look,
    [top, bottom]: [usize; 2],
    cut: Cut,
    color: [P; 3],
) {
    let square = look.edge == Edge::Square;
    let by_ray = sprite.form == Form::Ray;
    let (across, down, scale) = if by_ray {
        let none = Row([P::zero(); TILE]);
        (none, none, Scale::of(sprite.opacity, look.edge))
    } else {
        vectors::<P, LEVEL>(tile, sprite, look, [[0, TILE], [top, bottom]])
    };
    let forms = tile.rays.filter(|_| by_ray).map(|rays| (Forms::of(sprite, rays), rays));
    let mut row_of = Row([P::zero(); TILE]);
    let alpha = &mut row_of.0;
    for row in top..bottom {
        if let Some((forms, rays)) = &forms {
            forms.distance::<P, LEVEL>(sprite.model, rays, row, alpha);
            ray::opacities::<P, LEVEL>(alpha, scale, square);
        } else {
            let gain = scale.gain * down.0[row];
            for k in 0..TILE {
                let value = multiply_add::<P, LEVEL>(gain, across.0[k], -scale.floor);
                alpha[k] = most(value, P::zero());
            }
        }
        if cut != Cut::Clear {
            ray::cut_row(alpha, cut, sprite, look, tile.rays, tile.ground, row);
        }
        let through = &mut tile.through.0[row];
        match &mut tile.light {
            None => dim::<P, LEVEL>(through, alpha, P::one(), P::zero()),
            Some(light) => {
                let [red, green, blue] = &mut **light;
                let planes = [&mut red.0[row], &mut green.0[row], &mut blue.0[row]];
                lit::<P, LEVEL>(through, planes, alpha, P::one(), P::zero(), color);
            }
        }
    }
}
