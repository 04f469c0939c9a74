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

/// Even steps of light by which a value is looked up first.
const STEPS: usize = 4096;

/// A power of two above it: an index is cut to it, and needs no check.
const ROOM: usize = 2 * STEPS;

impl Coding<'_> {
    /// Tables to look bytes up in.
    pub fn tables(&self) -> Result<Tables, Error> {
        let sorted = self.edges.windows(2).all(|pair| pair[1] - pair[0] > 1.001 / STEPS as f32);
        if self.light.len() != 256 || self.edges.len() != 255 || !sorted {
            return Err(Error::Internal("no coding of bytes looks like that".into()));
        }
        let (mut light, mut edges) = ([0.0; 256], [f32::INFINITY; 256]);
        light.copy_from_slice(self.light);
        edges[..255].copy_from_slice(self.edges);
        let (mut first, mut level) = ([255_u32; ROOM], 0);
        for (step, first) in first.iter_mut().take(STEPS + 1).enumerate() {
            while level < 255 && edges[level] <= step as f32 / STEPS as f32 {
                level += 1;
            }
            *first = level as u32;
        }
        Ok(Tables { light, first, edges })
    }
}

/// Tables to look bytes up in.
pub struct Tables {
    light: [f32; 256],
    /// The value at which each step of light begins: no step holds two edges, even at black.
    first: [u32; ROOM],
    edges: [f32; 256],
}

impl Tables {
    /// The light of bytes.
    pub fn decode(&self, out: &mut [f32], bytes: &[u8]) {
        read(out, bytes, &self.light);
    }

    /// The bytes of light: clipped, NaN is 0.
    pub fn encode(&self, out: &mut [u8], light: &[f32]) {
        write(out, light, self);
    }
}

#[inline(always)]
fn read_with<const LEVEL: u8>(out: &mut [f32], bytes: &[u8], light: &[f32; 256]) {
    for (out, &byte) in out.iter_mut().zip(bytes) {
        *out = light[usize::from(byte)];
    }
}

dispatch! {
    fn read(out: &mut [f32], bytes: &[u8], light: &[f32; 256]) = read_with
}

#[inline(always)]
fn write_with<const LEVEL: u8>(out: &mut [u8], light: &[f32], tables: &Tables) {
    for (out, &light) in out.iter_mut().zip(light) {
        let light = light.clamp(0.0, 1.0);
        let step = (light * STEPS as f32) as i32 as usize & (ROOM - 1);
        let level = tables.first[step];
        let above = tables.edges[level as usize & 255] <= light;
        *out = (level + u32::from(above)) as u8;
    }
}

dispatch! {
    fn write(out: &mut [u8], light: &[f32], tables: &Tables) = write_with
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
        tables.encode(out, light);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_their_light() {
        let law = |v: f32| if v < 0.04 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        let light: Vec<f32> = (0..256).map(|v| law(v as f32 / 255.0)).collect();
        let edges: Vec<f32> = (0..255).map(|v| law((v as f32 + 0.5) / 255.0)).collect();
        let coding = Coding { light: &light, edges: &edges };
        let mut out = vec![7_u8; 256];
        bytes(&mut out, &light, &coding, &Cancel::new()).unwrap();
        assert!(out.iter().enumerate().all(|(value, &byte)| value == usize::from(byte)));
        let mut found = vec![0.0; 256];
        coding.tables().unwrap().decode(&mut found, &out);
        assert_eq!(found, light);
        let mut odd = vec![9_u8; 3];
        bytes(&mut odd, &[f32::NAN, -1.0, f32::INFINITY], &coding, &Cancel::new()).unwrap();
        assert_eq!(odd, [0, 0, 255]);
    }
}
