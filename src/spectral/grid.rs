//! The frequency grid of a tile: signed indices, frequencies, directions.

/// The signed frequency index of array position `index` in fftfreq order; even sizes store the
/// Nyquist index as -n/2.
#[inline]
pub const fn signed(index: usize, n: usize) -> i64 {
    if index < n.div_ceil(2) { index as i64 } else { index as i64 - n as i64 }
}

/// The array position of a signed index.
#[inline]
pub const fn position(index: i64, n: usize) -> usize {
    index.rem_euclid(n as i64) as usize
}

/// Whether a signed index is the Nyquist index of its axis, its own mirror there.
#[inline]
pub const fn is_nyquist(index: i64, n: usize) -> bool {
    n.is_multiple_of(2) && index == -(n as i64 / 2)
}

/// Frequency in cycles per pixel, (y, x), with an axis' component zero on its Nyquist line.
///
/// A motion rate must be odd in k for the field to stay real. On a Nyquist line the bin is its own
/// mirror in that axis, so that only zero is odd there: the rule of spectral differentiation.
#[inline]
pub fn odd_frequency(ky: i64, kx: i64, (height, width): (usize, usize)) -> (f64, f64) {
    let component = |k: i64, n: usize| if is_nyquist(k, n) { 0.0 } else { k as f64 / n as f64 };
    (component(ky, height), component(kx, width))
}

/// |k| in cycles per pixel.
#[inline]
pub fn magnitude(ky: i64, kx: i64, (height, width): (usize, usize)) -> f64 {
    let (fy, fx) = (ky as f64 / height as f64, kx as f64 / width as f64);
    (fy * fy + fx * fx).sqrt()
}

/// The unit vector k'/|k'| as (y, x), odd in k; zero at dc.
///
/// Divided by |k'|, not multiplied by its reciprocal: on the axes it must be exactly 1.
#[inline]
pub fn direction(ky: i64, kx: i64, shape: (usize, usize)) -> (f64, f64) {
    let length = magnitude(ky, kx, shape);
    if length == 0.0 {
        return (0.0, 0.0);
    }
    let (fy, fx) = odd_frequency(ky, kx, shape);
    (fy / length, fx / length)
}

/// How a bin stands to its mirror -k.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The one of the pair whose hash is drawn.
    Leader,
    /// The other: minus the leader's phase.
    Mirror,
    /// Its own mirror (dc and, for even sizes, the corners).
    Alone,
}

/// The role of a bin among the random phases.
#[inline]
pub const fn role(ky: i64, kx: i64, (height, width): (usize, usize)) -> Role {
    let own_x = kx == 0 || is_nyquist(kx, width);
    let own_y = ky == 0 || is_nyquist(ky, height);
    if own_x && own_y {
        Role::Alone
    } else if (kx > 0 && !own_x) || (own_x && ky > 0) {
        Role::Leader
    } else {
        Role::Mirror
    }
}
