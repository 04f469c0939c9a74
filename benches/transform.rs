//! The two transforms of a tile against each other: `cargo bench --bench transform`.
//!
//! Prints, for sizes and bands, the least microseconds of each way and the ratio of their operation
//! counts at which they would cost the same; `DENSE_ADVANTAGE` in src/spectral/tile.rs rests on it.

use std::time::Instant;

use _core::base::real::Real;
use _core::spectral::band::Band;
use _core::spectral::dense::operations;
use _core::spectral::filter::{Alias, TemporalFilter};
use _core::spectral::spectrum::TileMotion;
use _core::spectral::tent::Motion;
use _core::spectral::tile::{Choice, Plan, fft_operations};
use _core::spectral::waves::{Draw, Waves};

fn microseconds<T: Real>(waves: &Waves, choice: Choice) -> f64 {
    let plan = Plan::<T>::new(waves, choice, false).expect("a plan");
    let mut scratch = plan.scratch().expect("buffers");
    let mut pixels = vec![T::zero(); waves.tile.0 * waves.tile.1];
    let motion = [Motion { drift: [1.3, 2.7], shift: [0.0; 2] }];
    let filter = TemporalFilter { alias: Alias::Keep, soft_from: 0.4, shutter: 0.0 };
    let asked = TileMotion { place: &motion, rate: &motion, filter, shortest: 0.0, lap: None };
    let mut least = f64::INFINITY;
    for row in 0..60 {
        let start = Instant::now();
        for col in 0..20 {
            let draw = Draw::new(1, (row, col), false);
            let made = plan.render(draw, asked, &mut scratch, &mut pixels).expect("a tile");
            std::hint::black_box(made);
        }
        least = least.min(start.elapsed().as_secs_f64() / 20.0);
    }
    1e6 * least
}

fn main() {
    println!(
        "{:>5} {:>10} {:>9} {:>9} {:>12} {:>11} {:>13}",
        "tile", "band px", "dense us", "FFT us", "dense/FFT", "break-even", "dense f64 us"
    );
    for (size, low, high) in [
        (32, 2.0, 12.0),
        (64, 4.0, 32.0),
        (64, 2.0, 16.0),
        (136, 6.0, 51.0),
        (128, 4.0, 32.0),
        (256, 4.0, 32.0),
        (512, 4.0, 32.0),
    ] {
        let band = Band { shortest: low, longest: high, exponent: 1.0 };
        let waves = Waves::new((size, size), band, &[]).expect("waves");
        let dense = microseconds::<f32>(&waves, Choice::Dense);
        let fft = microseconds::<f32>(&waves, Choice::Fft);
        let wide = microseconds::<f64>(&waves, Choice::Dense);
        let counts = operations(&waves) / fft_operations(&waves);
        println!(
            "{size:>5} {:>10} {dense:>9.2} {fft:>9.2} {:>12.2} {:>11.2} {wide:>13.2}",
            format!("{low}..{high}"),
            dense / fft,
            counts * fft / dense
        );
    }
}
