//! Particles drawn into a tile a few at a time, each a product of two short vectors.
//!
//! A pixel costs a fused multiply-add, a comparison and another multiply-add for each particle; with
//! one particle at a time as much again went into reading and writing what the pixel lets through.
//! Here a block of pixels stays in registers while all particles of the batch that touch it go over
//! it, front to back: the operations of each pixel and their order are those of one after the other.

#![expect(unsafe_code, reason = "blocks of pixels that stay in registers, by `Lanes`")]
use super::cut::Ground;
use super::footprint::{self, Edge, Scale};
use super::rays::{PART, Rays, Sheet};
use super::sprite::{Form, Look, Sprite};
use crate::base::lanes::Lanes;
use crate::base::normal::Normal;
use crate::base::simd::{AVX2, AVX512};

/// Side of a tile, px.
pub const TILE: usize = 64;

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
pub struct Row<P>(pub [P; TILE]);

/// One tile while it is drawn.
pub struct Tile<'a, P> {
    /// Its corner (x, y), px.
    pub origin: [usize; 2],
    /// What it lets through, 1 at first; 0 beyond the picture's border.
    pub through: &'a mut Plane<P>,
    /// Premultiplied light, three planes; None if all particles have one color.
    pub light: Option<&'a mut [Plane<P>; 3]>,
    pub sheet: Sheet,
    /// Room for the pixels' rays, filled where a particle needs them; None if none does.
    pub rays: Option<&'a mut Rays<P, TILE>>,
    pub ground: Option<&'a Ground<'a, P, TILE>>,
}

/// Particles in a batch.
const MOST: usize = 8;

/// Pixels of a block: one AVX-512 register of float32 across, and a few rows to keep it busy.
const ACROSS: usize = PART;
const DOWN: usize = 4;

/// Particles that wait to be drawn into one tile.
pub struct Batch<P> {
    count: usize,
    across: [Row<P>; MOST],
    /// Times the gain.
    down: [Row<P>; MOST],
    floor: [P; MOST],
    color: [[P; 3]; MOST],
    /// Which particles touch a column of blocks, and which a row of them: a bit for each.
    columns: [u8; TILE / ACROSS],
    rows: [u8; TILE / DOWN],
}

impl<P: Normal> Batch<P> {
    #[inline(always)]
    pub fn empty() -> Self {
        let row = Row([P::zero(); TILE]);
        Self {
            count: 0,
            across: [row; MOST],
            down: [row; MOST],
            floor: [P::zero(); MOST],
            color: [[P::zero(); 3]; MOST],
            columns: [0; TILE / ACROSS],
            rows: [0; TILE / DOWN],
        }
    }

    /// Adds a particle that touches the columns and rows [first, last) of the tile.
    #[inline(always)]
    pub fn add<const LEVEL: u8>(
        &mut self,
        tile: &mut Tile<'_, P>,
        sprite: &Sprite,
        look: &Look,
        [columns, rows]: [[usize; 2]; 2],
        color: [P; 3],
    ) {
        let place = self.count;
        let (across, mut down, scale) = vectors::<P, LEVEL>(tile, sprite, look, [columns, rows]);
        let Scale { gain, floor } = scale;
        for value in &mut down.0 {
            *value = gain * *value;
        }
        self.across[place] = across;
        self.down[place] = down;
        self.floor[place] = floor;
        self.color[place] = color;
        for block in columns[0] / ACROSS..columns[1].div_ceil(ACROSS) {
            self.columns[block] |= 1 << place;
        }
        for block in rows[0] / DOWN..rows[1].div_ceil(DOWN) {
            self.rows[block] |= 1 << place;
        }
        self.count += 1;
        if self.count == MOST {
            self.draw::<LEVEL>(tile);
        }
    }

    #[inline(always)]
    pub fn draw<const LEVEL: u8>(&mut self, tile: &mut Tile<'_, P>) {
        if self.count == 0 {
            return;
        }
        match LEVEL {
            AVX512 => self.blocks::<P::Avx512, 4>(tile),
            AVX2 => self.blocks::<P::Avx2, 2>(tile),
            _ => self.blocks::<P::Portable, 1>(tile),
        }
        self.count = 0;
        self.columns = [0; TILE / ACROSS];
        self.rows = [0; TILE / DOWN];
    }

    #[inline(always)]
    fn blocks<V: Lanes<P>, const ROWS: usize>(&self, tile: &mut Tile<'_, P>) {
        // What the reads and writes below rely on.
        assert!(ACROSS.is_multiple_of(V::N) && DOWN.is_multiple_of(ROWS));
        let through = tile.through.0.as_mut_ptr().cast::<P>();
        let light = tile.light.as_mut().map(|light| {
            let [red, green, blue] = &mut **light;
            [red, green, blue].map(|plane| plane.0.as_mut_ptr().cast::<P>())
        });
        for (column, &across) in self.columns.iter().enumerate() {
            for (row, &down) in self.rows.iter().enumerate() {
                let which = across & down;
                if which == 0 {
                    continue;
                }
                for left in (column * ACROSS..(column + 1) * ACROSS).step_by(V::N) {
                    for top in (row * DOWN..(row + 1) * DOWN).step_by(ROWS) {
                        // SAFETY: the level has the instructions; `left + V::N` and `top + ROWS` are at
                        // most TILE, and every plane has TILE rows of TILE pixels.
                        unsafe {
                            match light {
                                None => self.dim::<V, ROWS>(which, left, top, through),
                                Some(light) => {
                                    self.lit::<V, ROWS>(which, left, top, through, light);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// alpha = max(0, gain g - floor) of one particle on V::N pixels of a row.
    #[inline(always)]
    unsafe fn alpha<V: Lanes<P>>(&self, place: usize, row: usize, across: V) -> V {
        // SAFETY: the caller has the instructions; `place` is below MOST and `row` below TILE.
        unsafe {
            let gain = V::splat(*self.down.get_unchecked(place).0.get_unchecked(row));
            let floor = V::splat(-*self.floor.get_unchecked(place));
            gain.multiply_add(across, floor).max(V::splat(P::zero()))
        }
    }

    /// T -= T alpha, particle after particle.
    #[inline(always)]
    unsafe fn dim<V: Lanes<P>, const ROWS: usize>(
        &self,
        which: u8,
        left: usize,
        top: usize,
        through: *mut P,
    ) {
        // SAFETY: as the caller says.
        unsafe {
            let at = |row: usize| through.add((top + row) * TILE + left);
            let mut t: [V; ROWS] = std::array::from_fn(|row| V::load(at(row)));
            let mut left_over = which;
            while left_over != 0 {
                let place = left_over.trailing_zeros() as usize;
                left_over &= left_over - 1;
                let across = V::load(self.across.get_unchecked(place).0.as_ptr().add(left));
                for row in 0..ROWS {
                    let alpha = self.alpha(place, top + row, across);
                    t[row] = t[row].product_from(alpha, t[row]);
                }
            }
            for row in 0..ROWS {
                t[row].store(at(row));
            }
        }
    }

    /// The same, and light += T alpha color.
    #[inline(always)]
    unsafe fn lit<V: Lanes<P>, const ROWS: usize>(
        &self,
        which: u8,
        left: usize,
        top: usize,
        through: *mut P,
        light: [*mut P; 3],
    ) {
        // SAFETY: as the caller says.
        unsafe {
            let at = |plane: *mut P, row: usize| plane.add((top + row) * TILE + left);
            let mut t: [V; ROWS] = std::array::from_fn(|row| V::load(at(through, row)));
            let mut light_of: [[V; 3]; ROWS] =
                std::array::from_fn(|row| light.map(|plane| V::load(at(plane, row))));
            let mut left_over = which;
            while left_over != 0 {
                let place = left_over.trailing_zeros() as usize;
                left_over &= left_over - 1;
                let across = V::load(self.across.get_unchecked(place).0.as_ptr().add(left));
                let color = self.color.get_unchecked(place);
                let color = [V::splat(color[0]), V::splat(color[1]), V::splat(color[2])];
                for row in 0..ROWS {
                    let alpha = self.alpha(place, top + row, across);
                    let share = t[row].mul(alpha);
                    t[row] = t[row].sub(share);
                    for channel in 0..3 {
                        light_of[row][channel] =
                            share.multiply_add(color[channel], light_of[row][channel]);
                    }
                }
            }
            for row in 0..ROWS {
                t[row].store(at(through, row));
                for channel in 0..3 {
                    light_of[row][channel].store(at(light[channel], row));
                }
            }
        }
    }
}

/// The two vectors whose product is the footprint: across the tile, and down its rows.
///
/// Only parts that `spans` touch, [first, last) across and down, are filled.
#[inline(always)]
pub fn vectors<P: Normal, const LEVEL: u8>(
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
