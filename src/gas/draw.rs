//! Particles drawn into one tile: T -= T alpha, and light += T alpha color, front to back.
//!
//! Footprints that are products of two short vectors are drawn a few at a time (see [`Batch`]), others
//! row by row. The tile's transmittance stays in the L1 cache. Subtracting T alpha and not multiplying
//! by a rounded 1 - alpha keeps many faint layers right in float32.
//!
//! Loops over lanes are plain loops with a fixed count: a closure would not inherit the instruction
//! set that the function is compiled for, and would run many times slower.

use super::batch::{Batch, TILE, Tile, vectors};
use super::cut::{self, Cut};
use super::ray::{Canvas, Source, finished};
use super::sprite::{Form, Look, Sprite};
use crate::base::error::{Cancel, Error};
use crate::base::normal::Normal;
use crate::base::simd::dispatch;

/// A particle in a band: its place among the sprites, and the columns that it can touch.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub sprite: u32,
    pub left: u32,
    pub right: u32,
}

/// Particles between two looks at what is still let through, and at the cancel flag.
const LOOK: usize = 16;

/// All that is drawn: sprites in no order, the colors of the particles, and how.
pub struct Drawing<'a> {
    pub sprites: &'a [Sprite],
    /// Linear RGB of each particle, by its index; one for all if there is one.
    pub colors: &'a [[f64; 3]],
    pub look: &'a Look,
}

/// Draws the particles of a band's list into one of its tiles, front to back.
#[dispatch]
pub fn draw<const LEVEL: u8, P: Normal>(
    tile: &mut Tile<'_, P>,
    list: &[Entry],
    drawing: &Drawing<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let error = P::of(drawing.look.error);
    let (look, [left, top]) = (drawing.look, tile.origin);
    let ground = tile.ground.map(|ground| ground.range);
    let (mut drawn, mut filled) = (0, false);
    let mut batch = Batch::<P>::empty();
    for entry in list {
        if entry.right as usize <= left || entry.left as usize >= left + TILE {
            continue;
        }
        let sprite = &drawing.sprites[entry.sprite as usize];
        let Some(cut) = cut::cut::<P>(sprite, look, &tile.sheet, TILE - 1, ground) else {
            continue;
        };
        drawn += 1;
        if drawn % LOOK == 0 {
            cancel.check()?;
            batch.draw::<LEVEL>(tile);
            if finished(&tile.through.0, error) {
                break;
            }
        }
        let spans = [within([entry.left, entry.right], left), within(sprite.rows, top)];
        let color = drawing.color::<P>(sprite);
        if sprite.form != Form::Ray && cut == Cut::CLEAR {
            batch.add::<LEVEL>(tile, sprite, look, spans, color);
        } else {
            batch.draw::<LEVEL>(tile);
            if sprite.form == Form::Ray && !filled {
                if let Some(rays) = &mut tile.rays {
                    rays.fill::<LEVEL>(&tile.sheet);
                }
                filled = true;
            }
            alone::<P, LEVEL>(tile, sprite, look, spans, cut, color);
        }
    }
    batch.draw::<LEVEL>(tile);
    Ok(())
}

impl Drawing<'_> {
    #[inline(always)]
    fn color<P: Normal>(&self, sprite: &Sprite) -> [P; 3] {
        self.colors[(sprite.index as usize).min(self.colors.len() - 1)].map(P::of)
    }
}

/// The part of a range that a tile has, from its own border.
#[inline(always)]
fn within(range: [u32; 2], start: usize) -> [usize; 2] {
    let [low, high] = range.map(|v| v as usize);
    [low.max(start) - start, (high - start).min(TILE)]
}

/// One particle that is no product of two vectors, or that is cut off.
#[inline(always)]
fn alone<P: Normal, const LEVEL: u8>(
    tile: &mut Tile<'_, P>,
    sprite: &Sprite,
    look: &Look,
    spans: [[usize; 2]; 2],
    cut: Cut,
    color: [P; 3],
) {
    let vectors =
        (sprite.form != Form::Ray).then(|| vectors::<P, LEVEL>(tile, sprite, look, spans));
    let source = match (&vectors, &tile.rays) {
        (Some((across, down, scale)), _) => Source::Product(&across.0, &down.0, *scale),
        (None, Some(rays)) => Source::Ray(rays),
        (None, None) => return,
    };
    let light =
        tile.light.as_deref_mut().map(|[red, green, blue]| [&mut red.0, &mut green.0, &mut blue.0]);
    let through = &mut tile.through.0;
    let mut canvas = Canvas { sheet: &tile.sheet, ground: tile.ground, through, light };
    canvas.draw::<LEVEL>(&source, sprite, look, spans, cut, color);
}
