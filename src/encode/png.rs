//! Rows of a PNG: filtered, deflated on all threads, inflated again and compared.
//!
//! Flakes are noise to a compressor: looking for what is alike far away costs nine tenths of the time
//! and finds a tenth of the bytes. So a byte is the difference from the mean of its left and upper
//! neighbours (PNG's filter 3), and only runs of one byte are looked for (zlib's strategy RLE), with
//! codes made for each block. Stripes of rows are deflated apart and follow each other in one stream.

use ndarray::ArrayView2;
use zlib_rs::adler32::{adler32, adler32_combine};
use zlib_rs::crc32::crc32;
use zlib_rs::{Deflate, DeflateConfig, DeflateFlush, Inflate, InflateFlush, Strategy};

use crate::base::error::{Cancel, Error};
use crate::base::pool;

/// Bytes of a stripe: enough that its codes cost nothing, and few enough for the second cache.
const STRIPE: usize = 1 << 17;

/// PNG's filter "average", the byte before each row.
const AVERAGE: u8 = 3;

/// No preset dictionary, the fastest level: the first bytes of a zlib stream.
const HEADER: [u8; 2] = [0x78, 0x01];

/// Rows of a picture, and what their filter needs to know.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// The bytes of each row as a PNG has them.
    pub rows: ArrayView2<'a, u8>,
    /// The row above the first; zeros above the picture.
    pub above: &'a [u8],
    /// Bytes of a pixel.
    pub pixel: usize,
    /// Whether numbers have two bytes, which stand in the processor's order and not in PNG's.
    pub wide: bool,
}

/// One chunk "IDAT" with rows of a picture, and the checksum of all rows so far.
///
/// `checksum` is that of the rows before, 1 for the first ones; `last` ends the stream.
pub fn chunk(
    rows: Rows<'_>,
    checksum: u32,
    last: bool,
    cancel: &Cancel,
) -> Result<(Vec<u8>, u32), Error> {
    let (count, length) = rows.rows.dim();
    if rows.above.len() != length || rows.pixel == 0 || length == 0 {
        return Err(Error::Internal("rows of different lengths".into()));
    }
    let step = (STRIPE / length).max(1);
    let mut stripes: Vec<(usize, Result<Stripe, Error>)> =
        (0..count).step_by(step).map(|first| (first, Err(Error::Cancelled))).collect();
    pool::for_each(stripes.iter_mut(), |(first, stripe)| {
        cancel.check()?;
        let end = (*first + step).min(count);
        let filtered = filtered(rows, *first..end);
        *stripe = Stripe::of(&filtered, last && end == count);
        Ok(())
    })?;
    let mut data = Vec::from(*b"\0\0\0\0IDAT");
    if checksum == 1 {
        data.extend(HEADER);
    }
    let mut sum = checksum;
    for (_, stripe) in stripes {
        let stripe = stripe?;
        data.extend(stripe.deflated);
        sum = adler32_combine(sum, stripe.checksum, stripe.length as u64);
    }
    if last {
        data.extend(sum.to_be_bytes());
    }
    let length = u32::try_from(data.len() - 8)
        .map_err(|_| Error::invalid("rows", "are too many bytes for a PNG's chunk"))?;
    data[..4].copy_from_slice(&length.to_be_bytes());
    let check = crc32(0, &data[4..]);
    data.extend(check.to_be_bytes());
    Ok((data, sum))
}

/// Rows as their differences from what is left and above, each with its filter before it.
fn filtered(rows: Rows<'_>, wanted: std::ops::Range<usize>) -> Vec<u8> {
    let length = rows.rows.ncols();
    let mut filtered = Vec::with_capacity(wanted.len() * (length + 1));
    let row = |index: usize, row: &mut Vec<u8>| {
        row.clear();
        row.extend(rows.rows.row(index));
        in_order(row, rows.wide);
    };
    let (mut above, mut here) = (Vec::with_capacity(length), Vec::with_capacity(length));
    if wanted.start > 0 {
        row(wanted.start - 1, &mut above);
    } else {
        above.extend(rows.above);
        in_order(&mut above, rows.wide);
    }
    let pixel = rows.pixel;
    for index in wanted {
        row(index, &mut here);
        filtered.push(AVERAGE);
        let first = here.iter().zip(&above).take(pixel);
        filtered.extend(first.map(|(&byte, &up)| byte.wrapping_sub(up / 2)));
        let others = here[pixel..].iter().zip(&here).zip(&above[pixel..]);
        filtered.extend(others.map(|((&byte, &left), &up)| {
            // The mean of two bytes, rounded down, without a wider type.
            byte.wrapping_sub((left & up) + ((left ^ up) >> 1))
        }));
        std::mem::swap(&mut above, &mut here);
    }
    filtered
}

/// Numbers of two bytes, highest byte first, as a PNG has them.
fn in_order(row: &mut [u8], wide: bool) {
    if wide && cfg!(target_endian = "little") {
        row.as_chunks_mut::<2>().0.iter_mut().for_each(|pair| pair.reverse());
    }
}

/// Bytes that were deflated, to follow others.
struct Stripe {
    deflated: Vec<u8>,
    checksum: u32,
    length: usize,
}

impl Stripe {
    fn of(bytes: &[u8], last: bool) -> Result<Self, Error> {
        let broken = |what: &str| Error::Internal(format!("rows of a PNG are not {what}"));
        let config = DeflateConfig {
            level: 1,
            // No header of its own.
            window_bits: -15,
            strategy: Strategy::Rle,
            ..DeflateConfig::default()
        };
        let mut deflate = Deflate::new_with_config(config);
        // Stored blocks, the worst case, add five bytes to 16 KiB; a flush ends with five more.
        let mut deflated = vec![0; bytes.len() + bytes.len() / 1024 + 64];
        let flush = if last { DeflateFlush::Finish } else { DeflateFlush::SyncFlush };
        deflate.compress(bytes, &mut deflated, flush).map_err(|_| broken("deflated"))?;
        if deflate.total_in() != bytes.len() as u64 || deflate.total_out() >= deflated.len() as u64
        {
            return Err(broken("deflated"));
        }
        deflated.truncate(deflate.total_out() as usize);
        let mut again = vec![0; bytes.len()];
        let mut inflate = Inflate::new(false, 15);
        inflate
            .decompress(&deflated, &mut again, InflateFlush::SyncFlush)
            .map_err(|_| broken("inflated"))?;
        if again != bytes {
            return Err(broken("inflated to what they were"));
        }
        Ok(Self { deflated, checksum: adler32(1, bytes), length: bytes.len() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn noise(count: usize, length: usize) -> Array2<u8> {
        let mut state = 1_u32;
        Array2::from_shape_simple_fn((count, length), || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Half of it zeros in runs, half of it noise.
            if state >> 28 < 4 { 0 } else { (state >> 20) as u8 }
        })
    }

    /// PNG's filter 3 undone, from its definition.
    fn undone(filtered: &[u8], length: usize, pixel: usize) -> Vec<u8> {
        let mut rows: Vec<Vec<u8>> = vec![vec![0; length]];
        for row in filtered.chunks(length + 1) {
            assert_eq!(row[0], AVERAGE);
            let mut here = Vec::new();
            for (i, &byte) in row[1..].iter().enumerate() {
                let left = if i < pixel { 0 } else { u16::from(here[i - pixel]) };
                let up = u16::from(rows.last().unwrap()[i]);
                here.push(byte.wrapping_add(((left + up) / 2) as u8));
            }
            rows.push(here);
        }
        rows[1..].concat()
    }

    #[test]
    fn pieces_of_a_picture_are_one_stream() {
        for (count, pixel, width) in [(1, 1, 1), (7, 3, 5), (40, 4, 1999), (3, 3, 70_000)] {
            let length = pixel * width;
            let picture = noise(count, length);
            let (mut stream, mut sum) = (Vec::new(), 1);
            let cut = count / 2;
            for (range, last) in [(0..cut, false), (cut..count, true)] {
                if range.is_empty() {
                    continue;
                }
                let above = match range.start {
                    0 => vec![0; length],
                    start => picture.row(start - 1).to_vec(),
                };
                let view = picture.slice(ndarray::s![range, ..]);
                let rows = Rows { rows: view, above: &above, pixel, wide: false };
                let (data, after) = chunk(rows, sum, last, &Cancel::new()).unwrap();
                assert_eq!(&data[4..8], b"IDAT");
                let size = u32::from_be_bytes(data[..4].try_into().unwrap()) as usize;
                assert_eq!(data.len(), size + 12);
                stream.extend(&data[8..8 + size]);
                sum = after;
            }
            // With its header and its checksum, which are checked here.
            let mut inflated = vec![0; count * (length + 1)];
            let mut inflate = Inflate::new(true, 15);
            let status = inflate.decompress(&stream, &mut inflated, InflateFlush::Finish).unwrap();
            assert_eq!(status, zlib_rs::Status::StreamEnd);
            assert_eq!(undone(&inflated, length, pixel), picture.into_raw_vec_and_offset().0);
        }
    }

    #[test]
    fn two_bytes_stand_highest_first() {
        let native = [0x1234_u16, 0xfedc].map(u16::to_ne_bytes).concat();
        let mut row = native;
        in_order(&mut row, true);
        assert_eq!(row, [0x12, 0x34, 0xfe, 0xdc]);
    }
}
