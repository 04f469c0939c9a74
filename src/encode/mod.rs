//! Single floats to half floats.

use half::f16;
use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};

use crate::base::error::{Cancel, Error};
use crate::base::pool;

const LARGEST: f32 = 65504.0;

/// Numbers that are bounded while they are in the first cache.
const RUN: usize = 1 << 10;

/// Numbers that are worth a thread of their own.
const SHARE: usize = 1 << 18;

/// Rounds to the nearest half, ties to even; the largest half in place of infinity, NaN stays NaN.
///
/// `out` holds the bits.
pub fn to_half(out: &mut [u16], values: &[f32], cancel: &Cancel) -> Result<(), Error> {
    let pieces = out.chunks_mut(SHARE).zip(values.chunks(SHARE));
    pool::for_each(pieces, |(out, values)| {
        cancel.check()?;
        let mut bounded = [0.0_f32; RUN];
        for (out, values) in out.chunks_mut(RUN).zip(values.chunks(RUN)) {
            let bounded = &mut bounded[..values.len()];
            for (bounded, value) in bounded.iter_mut().zip(values) {
                *bounded = value.clamp(-LARGEST, LARGEST);
            }
            out.reinterpret_cast_mut::<f16>().convert_from_f32_slice(bounded);
        }
        Ok(())
    })
}
