//! Bytes as linear light, and linear light as bytes, by tables.

use crate::base::error::{Cancel, Error};
use crate::base::pool;
use crate::base::simd::dispatch;

/// How bytes are read as linear light and written again.
pub struct Coding<'a> {
    /// The light of each of the 256 values.
    pub light: &'a [f32],
    /// The least light of each value from 1 to 255.
    pub edges: &'a [f32],
}

/// Steps of light by which a value is looked up: two lie no farther apart than two edges.
const STEPS: usize = 8192;

/// A power of two above it: an index is cut to it, and needs no check.
const ROOM: usize = 2 * STEPS;

/// Added to a float it rounds to a whole number, which then stands in its lower bits: a conversion that
/// asks for overflow takes five times as long.
const WHOLE: f32 = (1 << 23) as f32;

/// Bits below the value in an entry of the table; a part of a step takes one less.
const PART_BITS: u32 = 24;

impl Coding<'_> {
    /// Tables to look bytes up in.
    pub fn tables(&self) -> Result<Tables, Error> {
        let apart = 1.001 / STEPS as f32;
        let sorted = self.edges.windows(2).all(|pair| pair[1] - pair[0] > apart);
        let sorted = sorted && self.edges.first().is_some_and(|&edge| edge > apart);
        let (Ok(light), 255, true) = (self.light.try_into(), self.edges.len(), sorted) else {
            return Err(Error::Internal("no coding of bytes looks like that".into()));
        };
        let (mut starts, mut level) = ([0; ROOM], 0);
        for (step, start) in starts.iter_mut().take(STEPS + 1).enumerate() {
            let from = step as f32 - 0.5;
            while level < 255 && self.edges[level] * STEPS as f32 <= from {
                level += 1;
            }
            // Floats above 1 / STEPS have no finer parts than this.
            let edge = self.edges.get(level).map_or(2.0, |edge| edge * STEPS as f32 - from);
            let part = (edge.min(1.5) * WHOLE) as u32;
            *start = ((level as u32) << PART_BITS) + ((1 << PART_BITS) - part);
        }
        Ok(Tables { light, starts })
    }
}

/// Tables to look bytes up in.
pub struct Tables {
    light: [f32; 256],
    /// For each step of light the value at its beginning, and what is wanting to the next from the part
    /// of the step where that begins: with the part of a light added, the upper bits are its value.
    starts: [u32; ROOM],
}

/// The light of bytes.
#[dispatch]
pub fn decode<const LEVEL: u8>(out: &mut [f32], bytes: &[u8], tables: &Tables) {
    for (out, &byte) in out.iter_mut().zip(bytes) {
        *out = tables.light[usize::from(byte)];
    }
}

/// The bytes of light: clipped, NaN is 0.
#[dispatch]
pub fn encode<const LEVEL: u8>(out: &mut [u8], light: &[f32], tables: &Tables) {
    for (out, &light) in out.iter_mut().zip(light) {
        let light = if light > 0.0 { light } else { 0.0 };
        let steps = if light < 1.0 { light * STEPS as f32 } else { STEPS as f32 };
        let step = steps + WHOLE;
        let part = (steps - (step - WHOLE) + 1.5).to_bits() - 1.0_f32.to_bits();
        let start = tables.starts[step.to_bits() as usize & (ROOM - 1)];
        *out = ((start + part) >> PART_BITS) as u8;
    }
}

/// Writes linear light as bytes.
pub fn bytes(
    out: &mut [u8],
    light: &[f32],
    coding: &Coding<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    if out.len() != light.len() {
        return Err(Error::Internal("bytes and light differ in number".into()));
    }
    let tables = coding.tables()?;
    let tasks: Vec<_> = out.chunks_mut(1 << 16).zip(light.chunks(1 << 16)).collect();
    pool::for_each(tasks, |(out, light)| {
        cancel.check()?;
        encode(out, light, &tables);
        Ok(())
    })
}
