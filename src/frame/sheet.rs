//! What falls before a picture by itself: sheets of its texture, read from a random place on, with what
//! is drawn and a veil, as one opacity.
//!
//! A sheet is an optical depth without its mean that goes on at its ends, kept as small integers: to
//! read one costs a hundredth of making it.

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, zeroed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::simd::dispatch;

/// Beyond this optical depth nothing is left to see.
const OPAQUE: f32 = 80.0;

/// Pixels whose powers are taken together, which stay in registers.
const BLOCK: usize = 64;

/// Part of a texture.
#[derive(Debug, Clone, Copy)]
pub struct Sheet<'a> {
    /// It goes on at its ends.
    pub values: ArrayView2<'a, i16>,
    /// Row and column of the picture's first pixel.
    pub place: [usize; 2],
    /// Whether rows, and columns, are read backwards.
    pub back: [bool; 2],
    /// Optical depth of 1.
    pub unit: f32,
    /// Optical depth of 0.
    pub mean: f32,
    /// The share that lies before what is seen, (H, W); None for all.
    pub mask: Option<ArrayView2<'a, f32>>,
}

/// What lies over the picture.
#[derive(Debug, Clone)]
pub struct Falling<'a> {
    /// Their optical depths add up, and are taken as 0 where they are less.
    pub sheets: Vec<Sheet<'a>>,
    /// Opacities, and how often they are squared: so many copies lie over each other.
    pub drawn: Option<(ArrayView2<'a, f32>, u32)>,
    /// Opacities of a veil.
    pub veil: Option<ArrayView2<'a, f32>>,
    /// Opacity of an even one.
    pub haze: f32,
}

/// Writes the opacity of all of it, (H, W).
pub fn fall(
    mut out: ArrayViewMut2<'_, f32>,
    law: &Falling<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let layout = || Error::Internal("sheets and planes must be contiguous and fit".into());
    let (height, width) = out.dim();
    let masks = law.sheets.iter().filter_map(|sheet| sheet.mask);
    for plane in masks.chain(law.drawn.map(|drawn| drawn.0)).chain(law.veil) {
        if plane.dim() != (height, width) || !plane.is_standard_layout() {
            return Err(layout());
        }
    }
    if law.sheets.iter().any(|sheet| sheet.values.is_empty() || !sheet.values.is_standard_layout())
    {
        return Err(layout());
    }
    let mut tasks = Vec::new();
    for run in pool::split(height, pool::threads()) {
        let (part, rest) = out.split_at(Axis(0), run.len());
        out = rest;
        tasks.push((run, part));
    }
    pool::for_each(tasks, |(run, mut part): (std::ops::Range<usize>, ArrayViewMut2<'_, f32>)| {
        let alone = matches!(law.sheets[..], [Sheet { mask: None, .. }]);
        let mut line = zeroed::<f32>(if alone { 0 } else { width })?;
        for (row, mut out) in run.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            if alone {
                law.sheets[0].read(row, out);
            } else {
                out.fill(0.0);
                for sheet in &law.sheets {
                    sheet.read(row, &mut line);
                    add(out, &line, sheet.mask.as_ref().and_then(|mask| mask.row(row).to_slice()));
                }
            }
            let times = law.drawn.map_or(0, |drawn| drawn.1);
            let drawn = law.drawn.as_ref().and_then(|drawn| drawn.0.row(row).to_slice());
            let veil = law.veil.as_ref().and_then(|veil| veil.row(row).to_slice());
            close(out, drawn, times, veil, 1.0 - law.haze);
        }
        Ok(())
    })
}

impl Sheet<'_> {
    /// The optical depth along a row of the picture.
    fn read(&self, row: usize, mut out: &mut [f32]) {
        let (rows, cols) = self.values.dim();
        let from = self.place[0] % rows;
        let row =
            if self.back[0] { (from + rows - row % rows) % rows } else { (from + row) % rows };
        let Some(values) = self.values.row(row).to_slice() else { return };
        let mut at = self.place[1] % cols;
        while !out.is_empty() {
            let room = if self.back[1] { at + 1 } else { cols - at };
            let (now, later) = out.split_at_mut(room.min(out.len()));
            if self.back[1] {
                scale_back(now, &values[at + 1 - now.len()..=at], self.unit, self.mean);
                at = cols - 1;
            } else {
                scale(now, &values[at..at + now.len()], self.unit, self.mean);
                at = 0;
            }
            out = later;
        }
    }
}

#[inline(always)]
fn scale_with<const LEVEL: u8>(out: &mut [f32], values: &[i16], unit: f32, mean: f32) {
    for (out, &value) in out.iter_mut().zip(values) {
        *out = mean + unit * f32::from(value);
    }
}

#[inline(always)]
fn scale_back_with<const LEVEL: u8>(out: &mut [f32], values: &[i16], unit: f32, mean: f32) {
    for (out, &value) in out.iter_mut().zip(values.iter().rev()) {
        *out = mean + unit * f32::from(value);
    }
}

#[inline(always)]
fn add_with<const LEVEL: u8>(out: &mut [f32], line: &[f32], mask: Option<&[f32]>) {
    match mask {
        Some(mask) => {
            for ((out, &value), &mask) in out.iter_mut().zip(line).zip(mask) {
                *out += mask * value;
            }
        }
        None => {
            for (out, &value) in out.iter_mut().zip(line) {
                *out += value;
            }
        }
    }
}

#[inline(always)]
fn close_with<const LEVEL: u8>(
    depth: &mut [f32],
    drawn: Option<&[f32]>,
    times: u32,
    veil: Option<&[f32]>,
    clear: f32,
) {
    let mut left = [0.0_f32; BLOCK];
    for (block, depth) in depth.chunks_mut(BLOCK).enumerate() {
        let (n, from) = (depth.len(), block * BLOCK);
        let left = &mut left[..n];
        match drawn {
            Some(drawn) => {
                for (left, &drawn) in left.iter_mut().zip(&drawn[from..from + n]) {
                    *left = 1.0 - drawn;
                }
            }
            None => left.fill(1.0),
        }
        for _ in 0..times {
            for left in left.iter_mut() {
                *left *= *left;
            }
        }
        if let Some(veil) = veil {
            for (left, &veil) in left.iter_mut().zip(&veil[from..from + n]) {
                *left *= 1.0 - veil;
            }
        }
        for (depth, &left) in depth.iter_mut().zip(left.iter()) {
            let thin = f32::exp_at::<LEVEL>(-least(most(*depth, 0.0), OPAQUE));
            *depth = 1.0 - clear * left * thin;
        }
    }
}

dispatch! {
    fn scale(out: &mut [f32], values: &[i16], unit: f32, mean: f32) = scale_with
}

dispatch! {
    fn scale_back(out: &mut [f32], values: &[i16], unit: f32, mean: f32) = scale_back_with
}

dispatch! {
    fn add(out: &mut [f32], line: &[f32], mask: Option<&[f32]>) = add_with
}

dispatch! {
    /// Optical depths to opacities, with what is drawn, a veil, and what an even one leaves.
    fn close(
        depth: &mut [f32],
        drawn: Option<&[f32]>,
        times: u32,
        veil: Option<&[f32]>,
        clear: f32,
    ) = close_with
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn it_is_the_product_of_what_each_leaves() {
        let (height, width, rows, cols) = (9, 150, 5, 37);
        let values =
            Array2::from_shape_fn((rows, cols), |(i, j)| ((31 * i + 7 * j) % 90) as i16 - 40);
        let plane = |k: usize| {
            Array2::from_shape_fn((height, width), |(i, j)| ((k * i + j) % 17) as f32 / 20.0)
        };
        let (mask, drawn, veil) = (plane(2), plane(3), plane(5));
        for back in [[false, false], [true, false], [false, true], [true, true]] {
            let sheet = Sheet {
                values: values.view(),
                place: [3, 35],
                back,
                unit: 0.02,
                mean: 0.5,
                mask: None,
            };
            let masked = Sheet { mask: Some(mask.view()), place: [1, 4], ..sheet };
            for sheets in [vec![sheet], vec![masked, sheet], vec![]] {
                let at = |sheet: &Sheet<'_>, i: usize, j: usize| {
                    let along = |axis: usize, k: usize, n: usize| {
                        let (from, k, n) = (sheet.place[axis] as i64, k as i64, n as i64);
                        (if back[axis] { from - k } else { from + k }).rem_euclid(n) as usize
                    };
                    let value = values[(along(0, i, rows), along(1, j, cols))];
                    let part = sheet.mask.map_or(1.0, |mask| f64::from(mask[(i, j)]));
                    part * (0.5 + 0.02 * f64::from(value))
                };
                let law = Falling {
                    sheets: sheets.clone(),
                    drawn: Some((drawn.view(), 3)),
                    veil: Some(veil.view()),
                    haze: 0.1,
                };
                let mut out = Array2::zeros((height, width));
                fall(out.view_mut(), &law, &Cancel::new()).unwrap();
                for ((i, j), &got) in out.indexed_iter() {
                    let depth: f64 = sheets.iter().map(|sheet| at(sheet, i, j)).sum();
                    let left = (1.0 - f64::from(drawn[(i, j)])).powi(8);
                    let wanted = 1.0
                        - 0.9 * left * (1.0 - f64::from(veil[(i, j)])) * (-depth.max(0.0)).exp();
                    assert!((f64::from(got) - wanted).abs() < 2e-6, "{got} {wanted}");
                }
            }
        }
    }
}
