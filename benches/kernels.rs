//! The kernels by themselves, without Python: `cargo bench --bench kernels`.
//!
//! Throughput is pixels or flakes. FLURRIES_SIMD=avx2 or portable takes lower instruction sets.

use _core::base::error::Cancel;
use _core::base::pool;
use _core::base::random::Hash;
use _core::base::real::Real;
use _core::falling::layers::{Layer, Others, read};
use _core::falling::sheet::{Law, Sheet};
use _core::frame::composite::snow;
use _core::particles::splat::{Flakes, splat};
use _core::particles::sprite::Lens;
use _core::spectral::band::Band;
use _core::spectral::field::{Field, Window};
use _core::spectral::filter::{Alias, TemporalFilter};
use _core::spectral::opacity::Opacity;
use _core::spectral::stripes::Mapped;
use _core::spectral::tiles::Blend;
use divan::Bencher;
use divan::counter::ItemsCount;
use ndarray::{Array1, Array2, Array3, Array4, ArrayView2, array};

const SIDE: usize = 1024;

fn main() {
    pool::set_threads(1).expect("one thread");
    divan::main();
}

/// One alpha; every tile has its own drift.
#[divan::bench(types = [f32, f64], args = [256, 1024])]
fn texture<T: Real>(bencher: Bencher<'_, '_>, side: usize) {
    let count = (side - 64).div_ceil(54) + 1;
    let unit = |i: usize| 10.0 * Hash::seeded(3).word(i as i64).unit() - 5.0;
    let drift =
        Array4::from_shape_fn((count, count, 1, 2), |(r, c, _, i)| unit(2 * (r * count + c) + i));
    let still = Array4::zeros((1, 1, 1, 2));
    let field = Field {
        shape: (side, side),
        tile: (64, 64),
        overlap: 10,
        blend: Blend::Power,
        band: Band { shortest: 4.0, longest: 32.0, exponent: 1.0 },
        seed: 1,
        jitter: false,
        ring_edges: &[],
        ring_gains: &[],
        drift: drift.view(),
        shift: still.view(),
        velocity: still.view(),
        shift_rate: still.view(),
        filter: TemporalFilter { alias: Alias::Keep, soft_from: 0.4, shutter: 0.0 },
        shortest: None,
        lap: None,
    };
    let map = Opacity { mean: 0.5, spread: 3.0, power: 2.0, amount: 1.0 };
    let mapped = Some(Mapped { map, preserve_mean: false });
    let window = Window { rows: 0..side, cols: 0..side };
    let mut out = Array2::<T>::zeros((side, side));
    bencher.counter(ItemsCount::new(side * side)).bench_local(|| {
        let ready = field.ready::<T>().expect("a field");
        ready.render(&window, out.view_mut(), mapped, &Cancel::new()).expect("a frame");
    });
}

/// Discs of 1 to 4 px.
#[divan::bench(args = [1_000, 30_000, 150_000])]
fn discs(bencher: Bencher<'_, '_>, count: usize) {
    let unit = |i: usize, word: i64| Hash::seeded(7).word(i as i64).word(word).unit();
    let depth = |i: usize| 2.0 + 18.0 * unit(i, 2);
    let points = Array2::from_shape_fn((count, 3), |(i, axis)| {
        if axis == 2 { depth(i) } else { 1.024 * depth(i) * (unit(i, axis as i64) - 0.5) }
    });
    let radius = Array1::from_shape_fn(count, |i| (1.0 + 3.0 * unit(i, 3)) * depth(i) / 1000.0);
    let (opacity, velocity) = (array![0.5], array![[0.0, 0.0, 0.0]]);
    let flakes = Flakes {
        points: points.view(),
        radius: radius.view(),
        opacity: opacity.view(),
        velocity: velocity.view(),
        shutter: 0.0,
    };
    let lens = Lens { focal: 1000.0, center: [512.0; 2], offset: [0.0; 3], near: 0.1 };
    let mut out = Array2::<f32>::zeros((SIDE, SIDE));
    bencher.counter(ItemsCount::new(count)).bench_local(|| {
        let none = None::<ArrayView2<'_, f32>>;
        splat(out.view_mut(), &flakes, &lens, none, &Cancel::new()).expect("flakes");
    });
}

fn sheet(seed: u64) -> Sheet {
    let law = Law {
        seed,
        period: (SIDE - 16, SIDE - 24),
        shear: 300,
        count: 0.05,
        diameters: (0..16).map(|i| 0.6 + 0.05 * i as f32).collect(),
        streak: [0.5, 2.0],
        circle: 0.0,
        tau0: 4.3,
        thin: 1.0,
        ranks: (0.0, 1.0),
    };
    Sheet::new(law).expect("a law")
}

/// One place of a sheet of 50,000 far flakes.
#[divan::bench]
fn sheet_made(bencher: Bencher<'_, '_>) {
    bencher.counter(ItemsCount::new(50_000_usize)).with_inputs(|| sheet(1)).bench_local_refs(
        |sheet| {
            sheet.place(0, &Cancel::new()).expect("a place");
        },
    );
}

/// The opacity of sheets whose places are made.
#[divan::bench(args = [10, 20])]
fn sheets(bencher: Bencher<'_, '_>, count: usize) {
    let sheets: Vec<_> = (0..count).map(|i| sheet(i as u64)).collect();
    let layer = |(i, sheet)| Layer {
        sheet,
        shift: [37.5 * i as f64, 61.25 * i as f64],
        gain: 1.0,
        base: 0.0,
        near: i as f32,
        far: i as f32 + 1.0,
    };
    let layers: Vec<_> = sheets.iter().enumerate().map(layer).collect();
    let mut out = Array2::zeros((SIDE, SIDE));
    bencher.counter(ItemsCount::new(SIDE * SIDE)).bench_local(|| {
        read(out.view_mut(), [-512; 2], &layers, None, Some(Others::default()), &Cancel::new())
            .expect("a picture");
    });
}

/// One color over a picture.
#[divan::bench]
fn composite(bencher: Bencher<'_, '_>) {
    let back = Array3::from_shape_fn((SIDE, SIDE, 3), |(y, x, c)| (y + 3 * x + c) as u8);
    let alpha = Array2::from_shape_fn((SIDE, SIDE), |(y, x)| ((y * 7 + x) % 11) as f32 / 11.0);
    let mut out = Array3::<u8>::zeros(back.dim());
    bencher.counter(ItemsCount::new(SIDE * SIDE)).bench_local(|| {
        let color = [0.98; 3];
        snow(out.view_mut(), back.view(), alpha.view(), &color, &Cancel::new()).expect("snow");
    });
}
