//! What a frame is asked for: the classes of a population, the eye at several times, and the wind.

use super::cells::DENSEST;
use super::law::{Sizes, Table};
use super::notes::Notes;
use crate::base::error::Error;

/// The time of the frame, and those at which its shutter opens and closes; after them others may come.
pub const NOW: usize = 0;
pub const OPEN: usize = 1;
pub const CLOSE: usize = 2;

/// Metres by which the air is carried at most.
const FARTHEST: f64 = 1e15;

pub type Vector = [f64; 3];

#[derive(Debug, Clone, Copy)]
pub struct Eye {
    /// Rows turn house axes into the eye's.
    pub turn: [Vector; 3],
    /// Across and down, px.
    pub focal: [f64; 2],
    /// The principal point, px.
    pub center: [f64; 2],
    /// The eye in the camera's axes, metres.
    pub offset: Vector,
}

impl Eye {
    /// A place relative to the camera, house axes, in the camera's.
    #[inline]
    pub fn turned(&self, [x, y, z]: Vector) -> Vector {
        self.turn.map(|[a, b, c]| a * x + b * y + c * z)
    }

    /// Where a place in the camera's axes is seen, px, and its depth, metres.
    #[inline]
    pub fn seen(&self, point: Vector) -> ([f64; 2], f64) {
        let z = point[2] - self.offset[2];
        let px = |axis: usize| {
            self.center[axis] + self.focal[axis] * ((point[axis] - self.offset[axis]) / z)
        };
        ([px(0), px(1)], z)
    }
}

/// Flakes of an interval of sizes, which fall alike.
#[derive(Debug, Clone)]
pub struct Class {
    /// Its number in the population, which its flakes are hashed by.
    pub number: i64,
    /// The most there are, 1/m3.
    pub density: f64,
    pub sizes: Sizes,
    /// Depths between which they fade in, and between which they fade out again, metres.
    pub shown: [f64; 4],
    /// Whether the first two are those of the largest flake, and a smaller one's are nearer as it is smaller.
    pub by_size: bool,
    /// Shares of `density` that are there by the height below the camera, metres.
    pub amount: Table,
    /// Of those shares the flakes of ranks between two parts are shown.
    pub ranks: (f64, f64),
    /// The camera in this class's air at each time, metres.
    pub at: Vec<Vector>,
    /// Angles of the sway at each time, cycles.
    pub swung: Vec<f64>,
    /// Of each wave of the wind: real parts of the displacement at all times, (x, y, z) after (x, y, z), then
    /// imaginary parts; metres. None where there are no waves.
    pub waves: Vec<f64>,
    /// How far a wind of depth has carried the air (x, y) at each time, by the depth along the house's z ahead of
    /// the camera, metres. None where there is no such wind.
    pub profile: Vec<[Table; 2]>,
    /// Where in this air its one flake is, put there by hand, metres; else its flakes are those of cells.
    pub placed: Option<Vector>,
}

/// How many times as dense as on the mean it is where the waves of clumps sum to `s`.
pub fn denser(strength: f64, s: f64) -> f64 {
    1.0 + strength * s / (1.0 + s * s).sqrt()
}

/// Where flakes are denser than on the mean, as `denser` says.
#[derive(Debug, Clone)]
pub struct Clumps {
    /// (m, 3): cycles per metre, along the house's axes.
    pub waves: Vec<f64>,
    /// (m, 2): real and imaginary parts at the camera.
    pub weights: Vec<f64>,
    /// 0 to 1.
    pub strength: f64,
}

/// The flakes before an eye.
#[derive(Debug, Clone)]
pub struct Air {
    pub seed: i64,
    /// Mean over the disc of a resting flake, 0 to 1.
    pub opacity: f64,
    pub classes: Vec<Class>,
    /// At each time.
    pub eyes: Vec<Eye>,
    /// Of the sway at each time, metres.
    pub sway: Vec<f64>,
    /// Waves of the wind, (m, 3) cycles per metre.
    pub waves: Vec<f64>,
    /// With them the classes have the densities of the densest places.
    pub clumps: Option<Clumps>,
    pub notes: Option<Notes>,
    /// Pixels of the whole picture, (height, width).
    pub shape: (usize, usize),
    /// The pixels that are wanted: top, bottom, left, right.
    pub window: [usize; 4],
    /// Metres around the view in which flakes may be seen, besides what follows from the rest: for blur.
    pub room: f64,
    /// Nothing nearer than this is drawn, metres.
    pub near: f64,
}

impl Air {
    /// Refuses what no caller means.
    pub fn checked(self) -> Result<Self, Error> {
        let times = self.eyes.len();
        // Cells are numbered by whole numbers of 64 bits.
        if !self.classes.iter().flat_map(|class| &class.at).flatten().all(|v| v.abs() < FARTHEST) {
            let words = format!("has carried the air by {FARTHEST:e} m or more");
            return Err(Error::invalid("t", words));
        }
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let sound = times > CLOSE
            && (0.0..=1.0).contains(&self.opacity)
            && self.near > 0.0
            && finite(&[self.room, self.near])
            && (self.sway.len() == times && finite(&self.sway))
            && self.notes.as_ref().is_none_or(|notes| notes.sound(times))
            && self.eyes.iter().all(|eye| {
                finite(&eye.turn.concat())
                    && finite(&eye.center)
                    && finite(&eye.offset)
                    && eye.focal.iter().all(|&f| f > 0.0 && f.is_finite())
            })
            && self.classes.iter().all(|class| {
                class.sizes.sound()
                    && (0.0..=DENSEST).contains(&class.density)
                    && finite(&class.shown)
                    && class.at.len() == times
                    && class.swung.len() == times
                    && (class.waves.is_empty() || class.waves.len() == 2 * times * self.waves.len())
                    && (class.profile.is_empty() || class.profile.len() == times)
                    && class.profile.iter().flatten().chain([&class.amount]).all(Table::sound)
            });
        if sound { Ok(self) } else { Err(Error::Internal("no air looks like that".into())) }
    }
}
