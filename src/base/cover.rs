//! Which pixels an interval covers.

use std::ops::Range;

/// The pixels (of `count`) whose centres j + 1/2 lie in [low, high].
#[inline(always)]
pub fn pixels(low: f64, high: f64, count: usize) -> Option<Range<usize>> {
    // Clamped before the cast, since a bound may be 1e30.
    let limit = count as i64 as f64;
    let first = (low - 0.5).clamp(0.0, limit);
    let end = (high + 0.5).clamp(0.0, limit);
    // The casts truncate, which is the floor of what is not negative; `floor` and `ceil` would be calls
    // where SSE 4.1 is not assumed. Signed integers convert in one instruction, unsigned ones in
    // several.
    let whole = first as i64;
    let start = whole as usize + usize::from(first > whole as f64);
    let end = end as i64 as usize;
    if start < end { Some(start..end) } else { None }
}
