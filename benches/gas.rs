//! Gas against a plain loop over pixels and table entries: `cargo bench --bench gas`.
//!
//! 1024 x 1024 px, particles of 50 to 300 px, one color unless said otherwise, float32, one thread
//! and two. Variants take turns; the least milliseconds of each and the plain loop's over it.

use std::time::Instant;

use _core::base::error::Cancel;
use _core::base::pool;
use _core::base::random::Hash;
use _core::gas::cloud::Cloud;
use _core::gas::footprint::{Edge, TABLE};
use _core::gas::splat;
use _core::gas::sprite::{Eye, Footprint, Look, NearMode};
use ndarray::{Array1, Array2, Array3, ArrayView2};

const SIDE: usize = 1024;
const FOCAL: f64 = 1000.0;
const EYE: Eye = Eye { focal: FOCAL, center: [512.0; 2], offset: [0.0; 3] };

struct Gas {
    centers: Array2<f64>,
    radius: Array1<f64>,
    density: Array1<f64>,
    extent: Vec<f64>,
}

fn gas(count: usize) -> Gas {
    let unit = |i: usize, word: i64| Hash::seeded(7).word(i as i64).word(word).unit();
    let extent: Vec<f64> = (0..count).map(|i| 50.0 + 250.0 * unit(i, 0)).collect();
    let depth = |i: usize| 2.0 + 8.0 * unit(i, 3);
    let centers = Array2::from_shape_fn((count, 3), |(i, axis)| match axis {
        2 => depth(i),
        _ => (unit(i, 1 + axis as i64) * SIDE as f64 - 512.0) * depth(i) / FOCAL,
    });
    let radius = Array1::from_shape_fn(count, |i| 0.5 * extent[i] * depth(i) / FOCAL);
    Gas { centers, radius, density: Array1::from_elem(count, 0.02), extent }
}

/// What a reader of the paper would write: Eq. 2 for every pixel, blended into RGB.
fn plain(gas: &Gas, table: &[f32], out: &mut Array3<f32>) {
    out.fill(0.0);
    let (width, height) = (SIDE as i64, SIDE as i64);
    for (i, extent) in gas.extent.iter().enumerate() {
        let z = gas.centers[[i, 2]];
        let across = extent.round() as i64;
        let x = (512.0 + FOCAL * gas.centers[[i, 0]] / z - 0.5 * extent).round() as i64;
        let y = (512.0 + FOCAL * gas.centers[[i, 1]] / z - 0.5 * extent).round() as i64;
        let density = gas.density[i] as f32;
        for row in y.max(0)..(y + across).min(height) {
            for column in x.max(0)..(x + across).min(width) {
                let last = (TABLE - 1) as i64;
                let a = (row - y) * last / (across - 1);
                let b = (column - x) * last / (across - 1);
                let alpha = density * table[a as usize * TABLE + b as usize];
                for channel in 0..3 {
                    let pixel = &mut out[[row as usize, column as usize, channel]];
                    *pixel = *pixel * (1.0 - alpha) + alpha * 0.7;
                }
            }
        }
    }
}

fn milliseconds(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    1e3 * start.elapsed().as_secs_f64()
}

fn main() {
    let table: Vec<f32> = (0..TABLE * TABLE)
        .map(|i| {
            let at = |k: usize| -3.0 + 6.0 * k as f64 / (TABLE - 1) as f64;
            let (x, y) = (at(i % TABLE), at(i / TABLE));
            (-0.5 * (x * x + y * y)).exp() as f32
        })
        .collect();
    let one = [[0.7; 3]];
    let mut alpha = Array2::<f32>::zeros((SIDE, SIDE));
    let mut layer = Array3::<f32>::zeros((SIDE, SIDE, 4));
    let mut scratch = Array3::<f32>::zeros((SIDE, SIDE, 3));
    for count in [1000, 2000] {
        let gas = gas(count);
        let many: Vec<[f64; 3]> = (0..count)
            .map(|i| [0, 1, 2].map(|c| Hash::seeded(9).word(i as i64).word(c).unit()))
            .collect();
        let cloud = |colors| Cloud {
            centers: gas.centers.view(),
            radius: gas.radius.view(),
            density: gas.density.view(),
            colors,
        };
        let look = |footprint| Look {
            footprint,
            edge: Edge::Taper,
            near: 0.1,
            near_mode: NearMode::Fade,
            hard: false,
            error: 1e-6,
            smooth: f64::INFINITY,
        };
        let none: Option<ArrayView2<f32>> = None;
        let names = [
            "plain loop over the table",
            "viewplane_c, alpha",
            "viewplane_c, RGBA, one color",
            "viewplane_c, RGBA, many colors",
            "viewpoint, alpha",
            "volume, alpha",
            "viewplane_c, alpha, 2 threads",
            "viewplane_c, many colors, 2 threads",
        ];
        let mut least = [f64::INFINITY; 8];
        for turn in 0..12 {
            for (k, least) in least.iter_mut().enumerate() {
                if k == 0 && turn % 4 != 0 {
                    continue;
                }
                let looks = match k {
                    4 => look(Footprint::Viewpoint),
                    5 => look(Footprint::Volume),
                    _ => look(Footprint::ViewplaneC),
                };
                pool::set_threads(if k < 6 { 1 } else { 2 }).expect("a thread count");
                let cancel = Cancel::new();
                *least = least.min(milliseconds(|| match k {
                    0 => plain(&gas, &table, &mut scratch),
                    2 | 3 | 7 => {
                        let cloud = cloud(if k == 2 { &one[..] } else { &many[..] });
                        splat::splat(layer.view_mut(), &cloud, &EYE, &looks, none, &cancel)
                            .expect("a layer");
                    }
                    _ => splat::alpha(alpha.view_mut(), &cloud(&one), &EYE, &looks, none, &cancel)
                        .expect("a plane"),
                }));
            }
        }
        println!("{count} particles of 50-300 px, {SIDE} x {SIDE}");
        for (name, value) in names.iter().zip(least) {
            println!("  {name:38} {value:9.2} ms {:9.1} x", least[0] / value);
        }
    }
}
