//! The instructions of [`super`].

use std::arch::x86_64::*;

use super::{
    BLOCK, Clear, HIGH, NONE, PAD, Plan, SMALL, SQUARE, Sheet, Square, Table, WIDE, most, place_of,
};
use crate::base::simd::AVX512;
use crate::cone::stack::{MIDDLE, UNIT};

/// Multiplies into `clear` what one layer lets through. Sixteen numbers are eight pixels of a row and
/// the eight below them; two such pieces side by side follow each other.
///
/// # Safety
///
/// The processor has what `Windows::found` asks for, and the table is as large as it says.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
pub unsafe fn look_up<const LEVEL: u8>(
    clear: &mut [Clear],
    squares: &[Square],
    sheet: &Sheet,
    table: &Table<'_>,
    plan: &Plan,
) {
    // SAFETY: the caller answers for it.
    unsafe {
        match plan.choice {
            0 => parts::<LEVEL, SMALL, 16, 16>(clear, squares, sheet, table, plan),
            1 => parts::<LEVEL, SMALL, 16, 8>(clear, squares, sheet, table, plan),
            2 => parts::<LEVEL, SMALL, 8, 8>(clear, squares, sheet, table, plan),
            3 => parts::<LEVEL, HIGH, 16, 16>(clear, squares, sheet, table, plan),
            4 => parts::<LEVEL, SMALL, 8, 4>(clear, squares, sheet, table, plan),
            5 => parts::<LEVEL, WIDE, 16, 4>(clear, squares, sheet, table, plan),
            6 => parts::<LEVEL, WIDE, 8, 2>(clear, squares, sheet, table, plan),
            7 => parts::<LEVEL, HIGH, 8, 2>(clear, squares, sheet, table, plan),
            _ => parts::<LEVEL, NONE, 16, 16>(clear, squares, sheet, table, plan),
        }
    }
}

/// Two rows of 32 bytes.
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
unsafe fn two(from: *const u8, stride: usize) -> __m512i {
    // SAFETY: the caller has that many bytes there.
    unsafe {
        let first = _mm256_loadu_si256(from.cast());
        let second = _mm256_loadu_si256(from.add(stride).cast());
        _mm512_inserti64x4::<1>(_mm512_castsi256_si512(first), second)
    }
}

/// Four rows of 16 bytes.
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
unsafe fn four(from: *const u8, stride: usize) -> __m512i {
    // SAFETY: the caller has that many bytes there.
    unsafe {
        let row = |k: usize| _mm_loadu_si128(from.add(k * stride).cast());
        let mut all = _mm512_castsi128_si512(row(0));
        all = _mm512_inserti32x4::<1>(all, row(1));
        all = _mm512_inserti32x4::<2>(all, row(2));
        _mm512_inserti32x4::<3>(all, row(3))
    }
}

/// For each byte of a pair of numbers the bit at which its field of eight begins.
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
fn fields(bits: [u32; 4]) -> __m512i {
    let mut control = 0;
    for (byte, bit) in bits.into_iter().enumerate() {
        control |= u64::from(bit) << (8 * byte) | u64::from(bit + 32) << (8 * byte + 32);
    }
    _mm512_set1_epi64(control as i64)
}

/// What is the same for all places of a layer.
struct Layer {
    multiple: __m512i,
    /// The first places of a window that have no neighbours in it.
    limits: [__m512i; 2],
    /// Which bits of a place are the column, the row, the weight between columns, that between rows.
    fields: [__m512i; 4],
    /// The bits of an index that are the row.
    row_bits: __m512i,
    /// From an entry to its four neighbours.
    taps: __m512i,
    gain: __m512,
}

impl Layer {
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
    fn of<const WINDOW: u8>(sheet: &Sheet, table: &Table<'_>) -> Self {
        let (columns, rows) = (32 - table.columns, 32 - table.rows);
        let [most_column, most_row] = most(WINDOW);
        // An index is row and column: how wide is the column?
        let bits = if WINDOW == WIDE { 5 } else { 4 };
        let set = |value: u32| _mm512_set1_epi32(value as i32);
        Self {
            multiple: set(sheet.multiple),
            limits: [set((most_column + 1) << columns), set((most_row + 1) << rows)],
            fields: [
                fields([columns; 4]),
                fields([(rows + 32 - bits) % 32; 4]),
                fields([columns - 8; 4]),
                fields([rows - 15, rows - 7, rows - 15, rows - 7]),
            ],
            row_bits: _mm512_set1_epi8((0xff << bits) as u8 as i8),
            taps: set(0x0100 | 1 << (16 + bits) | ((1 << bits) + 1) << 24),
            gain: _mm512_set1_ps(sheet.gain * UNIT),
        }
    }

    /// The opacities of sixteen places of which the neighbours are known, bytes less 128.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
    fn opacities(&self, words: __m512i, u: __m512i, v: __m512i) -> __m512 {
        let set = |value: u32| _mm512_set1_epi32(value as i32);
        // 255 - side for bytes 0 and 2, side for 1 and 3; then the first ones once more: 256 does not fit.
        let side = _mm512_multishift_epi64_epi8(self.fields[2], u);
        let side = _mm512_xor_si512(side, set(0x00ff_00ff));
        let once = _mm512_maddubs_epi16(set(0x0001_0001), words);
        let both = _mm512_add_epi16(_mm512_maddubs_epi16(side, words), once);
        // 15 bits: (part and 32767) xor 32767 for the first row, part and 32767 for the next.
        let part = _mm512_multishift_epi64_epi8(self.fields[3], v);
        let part = _mm512_ternarylogic_epi32::<0x78>(set(0x0000_7fff), part, set(0x7fff_7fff));
        let value = _mm512_cvtepi32_ps(_mm512_madd_epi16(both, part));
        let value = _mm512_add_ps(value, _mm512_set1_ps(MIDDLE as f32));
        _mm512_min_ps(_mm512_mul_ps(value, self.gain), _mm512_set1_ps(1.0))
    }
}

#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
unsafe fn parts<const LEVEL: u8, const WINDOW: u8, const WIDTH: usize, const HEIGHT: usize>(
    clear: &mut [Clear],
    squares: &[Square],
    sheet: &Sheet,
    table: &Table<'_>,
    plan: &Plan,
) {
    let layer = Layer::of::<WINDOW>(sheet, table);
    let [below_column, below_row] = [32 - table.columns, 32 - table.rows];
    // Entries stand for the middles of their parts: half a part less.
    let offset_across = sheet.offset[0].wrapping_sub(1 << (below_column - 1));
    let offset_along = sheet.offset[1].wrapping_sub(1 << (below_row - 1));
    let corner = |grows: [bool; 2]| {
        place_of(if grows[0] { 0 } else { WIDTH - 1 }, if grows[1] { 0 } else { HEIGHT - 1 })
    };
    let [corner_across, corner_along] = plan.grows.map(corner);
    let stride = (1_usize << table.columns) + PAD;
    for (clear, square) in clear.iter_mut().zip(squares) {
        for top in (0..BLOCK).step_by(HEIGHT) {
            for left in (0..BLOCK).step_by(WIDTH) {
                let first = place_of(left, top);
                // The window begins an eighth of an entry before the corner: places are not quite
                // linear.
                let begin = |plane: &[u32; SQUARE], corner: usize, offset: u32, below: u32| {
                    let place = plane[(first + corner) % SQUARE].wrapping_mul(sheet.multiple);
                    place.wrapping_add(offset).wrapping_sub(1 << (below - 3)) >> below
                };
                let column = begin(&square.across, corner_across, offset_across, below_column);
                let row = begin(&square.along, corner_along, offset_along, below_row);
                // SAFETY: not beyond the last row and column, and there are PAD more.
                let window = unsafe {
                    let from = table.bytes.as_ptr().add(row as usize * stride + column as usize);
                    match WINDOW {
                        SMALL => {
                            let (a, b) = (four(from, stride), four(from.add(4 * stride), stride));
                            [a, b, a, b]
                        }
                        WIDE => [0, 2, 4, 6].map(|k| two(from.add(k * stride), stride)),
                        HIGH => [0, 4, 8, 12].map(|k| four(from.add(k * stride), stride)),
                        _ => [_mm512_setzero_si512(); 4],
                    }
                };
                let from_column = offset_across.wrapping_sub(column << below_column);
                let from_column = _mm512_set1_epi32(from_column as i32);
                let from_row =
                    _mm512_set1_epi32(offset_along.wrapping_sub(row << below_row) as i32);
                for y in (top..top + HEIGHT).step_by(2) {
                    for x in (left..left + WIDTH).step_by(8) {
                        let at = place_of(x, y);
                        // SAFETY: pieces of sixteen, each a line of the cache.
                        let (u, v, before) = unsafe {
                            (
                                _mm512_load_si512(square.across.as_ptr().add(at).cast()),
                                _mm512_load_si512(square.along.as_ptr().add(at).cast()),
                                _mm512_load_ps(clear.0.as_ptr().add(at)),
                            )
                        };
                        // Places from where the window begins.
                        let u =
                            _mm512_add_epi32(_mm512_mullo_epi32(u, layer.multiple), from_column);
                        let v = _mm512_add_epi32(_mm512_mullo_epi32(v, layer.multiple), from_row);
                        let outside = _mm512_cmpge_epu32_mask(u, layer.limits[0])
                            | _mm512_cmpge_epu32_mask(v, layer.limits[1]);
                        let words = if WINDOW == NONE || outside != 0 {
                            // SAFETY: as many entries as rows and columns say.
                            unsafe { gathered(table, u, v, column, row) }
                        } else {
                            let c = _mm512_multishift_epi64_epi8(layer.fields[0], u);
                            let r = _mm512_multishift_epi64_epi8(layer.fields[1], v);
                            let index = _mm512_ternarylogic_epi32::<0xca>(layer.row_bits, r, c);
                            let index = _mm512_add_epi8(index, layer.taps);
                            let near = _mm512_permutex2var_epi8(window[0], index, window[1]);
                            if WINDOW == SMALL {
                                near
                            } else {
                                let far = _mm512_permutex2var_epi8(window[2], index, window[3]);
                                _mm512_mask_blend_epi8(_mm512_movepi8_mask(index), near, far)
                            }
                        };
                        let alpha = layer.opacities(words, u, v);
                        let after = if LEVEL == AVX512 {
                            _mm512_fnmadd_ps(alpha, before, before)
                        } else {
                            _mm512_sub_ps(before, _mm512_mul_ps(alpha, before))
                        };
                        // SAFETY: as above.
                        unsafe { _mm512_store_ps(clear.0.as_mut_ptr().add(at), after) };
                    }
                }
            }
        }
    }
}

/// The words of places, from where a window begins, signed as the bytes of a window are.
#[cold]
#[inline(never)]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
unsafe fn gathered(table: &Table<'_>, u: __m512i, v: __m512i, column: u32, row: u32) -> __m512i {
    let set = |value: u32| _mm512_set1_epi32(value as i32);
    let place = |at: __m512i, bits: u32, first: u32| {
        let inside = _mm512_srlv_epi32(at, set(32 - bits));
        _mm512_and_si512(_mm512_add_epi32(inside, set(first)), set((1 << bits) - 1))
    };
    let (columns, rows) = (table.columns, table.rows);
    let (c, r) = (place(u, columns, column), place(v, rows, row));
    let at = _mm512_add_epi32(_mm512_sllv_epi32(r, set(columns)), c);
    // SAFETY: as many entries as rows and columns say; the caller answers for the instructions.
    let words = unsafe { _mm512_i32gather_epi32::<4>(at, table.entries.as_ptr().cast()) };
    _mm512_xor_si512(words, set(0x8080_8080))
}

/// Writes 1 - clear to the pixels of a square, `width` columns of it.
///
/// # Safety
///
/// The processor has what `Windows::found` asks for, and `out` room for 16 rows.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi,avx2,fma")]
pub unsafe fn write(clear: &Clear, out: &mut [f32], stride: usize, width: usize) {
    // SAFETY: the caller has that many rows and columns there.
    unsafe {
        let one = _mm512_set1_ps(1.0);
        let mask = ((1_u32 << width) - 1) as u16;
        for y in (0..BLOCK).step_by(2) {
            let from = clear.0.as_ptr().add(y * BLOCK);
            let left = _mm512_sub_ps(one, _mm512_loadu_ps(from));
            let right = _mm512_sub_ps(one, _mm512_loadu_ps(from.add(16)));
            let upper = _mm512_shuffle_f32x4::<0b01_00_01_00>(left, right);
            let lower = _mm512_shuffle_f32x4::<0b11_10_11_10>(left, right);
            let to = out.as_mut_ptr().add(y * stride);
            _mm512_mask_storeu_ps(to, mask, upper);
            _mm512_mask_storeu_ps(to.add(stride), mask, lower);
        }
    }
}
