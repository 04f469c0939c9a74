//! Transforms without vector instructions: slower, and the same bits on every processor.
//!
//! RealFFT plans with whatever the processor has, so a half spectrum is mirrored and takes a complex
//! transform.

use std::sync::Arc;

use realfft::{ComplexToReal, FftError};
use rustfft::num_complex::Complex;
use rustfft::num_traits::Zero;
use rustfft::{Fft, FftNum, FftPlannerScalar};

/// Complex inverse transform of length `n`.
pub fn inverse<T: FftNum>(n: usize) -> Arc<dyn Fft<T>> {
    FftPlannerScalar::new().plan_fft_inverse(n)
}

/// Inverse transform of a half spectrum.
pub struct ToReal<T> {
    whole: Arc<dyn Fft<T>>,
}

impl<T: FftNum> ToReal<T> {
    /// Plans a transform to `n` samples.
    pub fn new(n: usize) -> Self {
        Self { whole: inverse(n) }
    }
}

impl<T: FftNum> ComplexToReal<T> for ToReal<T> {
    fn process(&self, input: &mut [Complex<T>], output: &mut [T]) -> Result<(), FftError> {
        self.process_with_scratch(input, output, &mut self.make_scratch_vec())
    }

    fn process_with_scratch(
        &self,
        input: &mut [Complex<T>],
        output: &mut [T],
        scratch: &mut [Complex<T>],
    ) -> Result<(), FftError> {
        let (n, half) = (self.len(), self.complex_len());
        if input.len() != half {
            return Err(FftError::InputBuffer(half, input.len()));
        }
        if output.len() != n {
            return Err(FftError::OutputBuffer(n, output.len()));
        }
        if scratch.len() < self.get_scratch_len() {
            return Err(FftError::ScratchBuffer(self.get_scratch_len(), scratch.len()));
        }
        let (line, work) = scratch.split_at_mut(n);
        line[..half].copy_from_slice(input);
        for k in half..n {
            line[k] = input[n - k].conj();
        }
        self.whole.process_with_scratch(line, work);
        for (sample, value) in output.iter_mut().zip(line) {
            *sample = value.re;
        }
        let bent = |value: &Complex<T>| !value.im.is_zero();
        let (first, last) = (bent(&input[0]), n % 2 == 0 && bent(&input[half - 1]));
        if first || last { Err(FftError::InputValues(first, last)) } else { Ok(()) }
    }

    fn get_scratch_len(&self) -> usize {
        self.len() + self.whole.get_inplace_scratch_len()
    }

    fn len(&self) -> usize {
        self.whole.len()
    }

    fn make_input_vec(&self) -> Vec<Complex<T>> {
        vec![Complex::zero(); self.complex_len()]
    }

    fn make_output_vec(&self) -> Vec<T> {
        vec![T::zero(); self.len()]
    }

    fn make_scratch_vec(&self) -> Vec<Complex<T>> {
        vec![Complex::zero(); self.get_scratch_len()]
    }
}
