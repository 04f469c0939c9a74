//! Buffers that start at a cache line, so that a vector of a whole line is never read from two.

use std::ops::{Deref, DerefMut};

use num_traits::Zero;

use crate::base::error::{Error, zeroed};

/// Bytes of a cache line, and of the longest vector.
const LINE: usize = 64;

/// A slice of its own that starts at a multiple of 64 bytes.
#[derive(Debug)]
pub struct Aligned<T> {
    values: Vec<T>,
    from: usize,
    count: usize,
}

impl<T: Zero + Clone> Aligned<T> {
    /// `count` zeros.
    pub fn zeroed(count: usize) -> Result<Self, Error> {
        let spare = LINE / size_of::<T>();
        let values = zeroed::<T>(count.saturating_add(spare))?;
        let from = values.as_ptr().align_offset(LINE).min(spare);
        Ok(Self { values, from, count })
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        &self.values[self.from..self.from + self.count]
    }
}

impl<T> DerefMut for Aligned<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values[self.from..self.from + self.count]
    }
}
