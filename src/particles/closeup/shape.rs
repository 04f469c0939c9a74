//! A flake at rest and in focus, as texels: an aggregate that tumbles, a drop, or a dot.

use super::bank::{self, SHAPES, Silhouette};
use super::near::Closeup;
use crate::base::random::Hash;
use crate::base::simd::dispatch;
use crate::particles::balls::Outline;

/// What a flake looks like from near.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Aggregate,
    Drop,
    /// A round dot, out of focus.
    Dot,
}

#[derive(Debug, Clone, Copy)]
pub struct Tumble {
    pub seed: i64,
    /// Seconds since frame 0.
    pub seconds: f64,
    /// Seconds that the shutter is open.
    pub exposure: f64,
}

impl Tumble {
    /// How bright a flake that is `own` metres wide is over the exposure, s of -1 to 1: flat ones flutter.
    pub fn flutter(&self, number: i64, own: f64, flat: bool) -> impl Fn(f64) -> f64 + use<> {
        let rate = (FLUTTER / own).min(FASTEST);
        let phase = Hash::seeded(self.seed).word(number).word(0x666C_7574).unit();
        let (now, half) = (phase + rate * self.seconds, 0.5 * rate * self.exposure);
        let deep = if flat { 0.5 } else { 0.0 };
        move |s| 1.0 + deep * libm::sin(std::f64::consts::TAU * (now + s * half))
    }

    /// The lamps' light on a flake over that on the mean of all: facets mirror a lamp for a moment.
    pub fn glint(&self, number: i64) -> f32 {
        let unit = |word: i64| Hash::seeded(self.seed).word(number).word(0x676C_696E + word).unit();
        let phase = unit(0) + (1.5 + 3.0 * unit(1)) * self.seconds;
        let wave = libm::cos(std::f64::consts::PI * phase);
        let pulse = (0..4).fold(wave, |power, _| power * power);
        (1.0 - GLINT + GLINT * pulse / PULSE) as f32
    }
}

/// Metres per second: a disc that falls flutters by its speed over its diameter times a Strouhal number of .15
/// to .2 (Willmarth, Hawk and Harvey 1964, Phys. Fluids 7, 197). And the most flutters a second.
const FLUTTER: f64 = 0.2;
const FASTEST: f64 = 60.0;

/// Diameters in px between which a flake that is too small for its crystals takes an outline of its own.
const FORMS: (f64, f64) = (3.0, 6.0);

impl Closeup {
    /// The outline of a flake of a diameter in px.
    pub fn outline(&self, number: i64, diameter: f64) -> Outline {
        let part = ((diameter - FORMS.0) / (FORMS.1 - FORMS.0)).min(1.0);
        if part <= 0.0 || self.kind != Some(Kind::Aggregate) {
            return Outline::ROUND;
        }
        let hash = Hash::seeded(self.tumble.seed).word(number).word(0x666F_726D);
        let unit = |word: i64| hash.word(word).unit();
        let turns = unit(0) + (unit(1) - 0.5) * self.tumble.seconds;
        let aspect = 1.0 - part * (0.1 + 0.4 * unit(2));
        let curve = part * (unit(3) - 0.5);
        Outline::of(aspect, std::f64::consts::TAU * turns, curve, 1.0 + 0.25 * part * unit(4))
    }
}

/// How much of the lamps' light comes in glints, and the mean of the 16th power of a cosine.
const GLINT: f64 = 0.5;
const PULSE: f64 = 6435.0 / 32768.0;

/// A flake as it is seen.
#[derive(Debug, Clone, Copy)]
pub struct Near {
    /// Its place in the list, and what it is known by.
    pub index: i32,
    pub number: i64,
    /// In the axes of the eye whose pixels are square, world units.
    pub point: [f64; 3],
    pub depth: f64,
    /// World units, and px.
    pub own: f64,
    pub diameter: f64,
    /// Opacity summed over pixels.
    pub energy: f64,
    /// Its middle now, and when the shutter opens and closes, px.
    pub seen: [[f64; 2]; 3],
}

#[derive(Debug, Clone, Copy)]
pub struct Look<'a> {
    pub kind: Kind,
    /// How much of it has that shape and a sharp disc; the rest is the image of a sprite.
    pub share: f64,
    pub closeup: &'a Closeup,
}

/// A dot ends here, in sigma.
pub const DOT: f64 = 4.0;

/// Below this diameter in texels every flake is a ball of it.
const LEAST: f64 = 2.5;

/// Turns per second around the vertical axis, at least and at most.
const TURNS: (f64, f64) = (0.1, 0.6);

/// Where texels lie: (across, down), and the flake's middle among them.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub size: [usize; 2],
    pub middle: [f64; 2],
}

/// The silhouette of a flake; `diameter` in texels.
pub fn silhouette(place: &Place, diameter: f64, flake: &Near, look: &Look<'_>) -> Vec<f32> {
    match look.kind {
        Kind::Drop if diameter >= LEAST => drop(place, diameter, flake.own),
        Kind::Aggregate if diameter >= LEAST => aggregate(place, diameter, flake.number, look),
        _ => ball(place, diameter, flake, look),
    }
}

/// An aggregate of crystals, as far as it has tumbled.
fn aggregate(place: &Place, diameter: f64, number: i64, look: &Look<'_>) -> Vec<f32> {
    let tumble = look.closeup.tumble;
    let unit = |word: i64| Hash::seeded(tumble.seed).word(number).word(0x7475_6D62 + word).unit();
    let phase = unit(0) + (0.3 + unit(1)) * tumble.seconds;
    let swing = 0.6 * libm::sin(std::f64::consts::TAU * phase);
    let angle = std::f64::consts::TAU * unit(2) + swing;
    let sign = if unit(4) < 0.5 { -1.0 } else { 1.0 };
    let turns = unit(5) + sign * (TURNS.0 + (TURNS.1 - TURNS.0) * unit(3)) * tumble.seconds;
    let shape = (unit(6) * SHAPES as f64) as usize;
    let seen = bank::look(shape, turns, 1.0 / diameter);
    // Nothing lies in the corners of a view.
    let reach = 0.5 * seen.side;
    let turn = [libm::cos(angle) as f32, libm::sin(angle) as f32];
    filled(place, diameter, reach, &Turned { seen: &seen, turn })
}

/// What has an opacity at a place in diameters from a flake's middle.
trait Shape: Sync {
    fn at(&self, x: f32, y: f32) -> f32;
}

/// A silhouette, turned by an angle of (cosine, sine).
struct Turned<'a> {
    seen: &'a Silhouette,
    turn: [f32; 2],
}

impl Shape for Turned<'_> {
    #[inline(always)]
    fn at(&self, x: f32, y: f32) -> f32 {
        let [cosine, sine] = self.turn;
        self.seen.at(cosine * x + sine * y, cosine * y - sine * x)
    }
}

/// Optical depth in the middle of the ball that a flake is where it has no shape yet: that of an opacity of .9.
const MIDDLE: f32 = 4.3;

struct Ball {
    diameter: f32,
    along: [f32; 2],
    outline: Outline,
}

impl Shape for Ball {
    #[inline(always)]
    fn at(&self, x: f32, y: f32) -> f32 {
        // A texel wide at its border, as a pixel sees it.
        let (soft, [ux, uy]) = (1.0 / self.diameter, self.along);
        let [u, v] = self.outline.at(2.0 * (x * ux + y * uy), 2.0 * (y * ux - x * uy));
        let r = 0.5 * (u * u + v * v).sqrt();
        let edge = ((0.5 - r) / soft + 0.5).clamp(0.0, 1.0);
        let inside = (1.0 - 4.0 * r * r).max(soft * soft);
        let depth = MIDDLE * inside.sqrt();
        // Within .4 % of 1 - exp(-depth), in arithmetic alone.
        let through =
            1.0 / (1.0 + depth * (1.0 + depth * (0.5 + depth * (1.0 / 6.0 + depth / 24.0))));
        edge * (1.0 - through)
    }
}

pub fn ball(place: &Place, diameter: f64, flake: &Near, look: &Look<'_>) -> Vec<f32> {
    // One that is smaller is hardly told from it.
    let diameter = diameter.max(LEAST);
    let [_, open, close] = flake.seen;
    let angle = libm::atan2(close[1] - open[1], close[0] - open[0]);
    let along = [libm::cos(angle) as f32, libm::sin(angle) as f32];
    let outline = look.closeup.outline(flake.number, flake.diameter);
    let reach = 0.5 * outline.reach().into_iter().fold(1.0, f64::max) + 1.0 / diameter;
    filled(place, diameter, reach, &Ball { diameter: diameter as f32, along, outline })
}

/// A drop: its half axes in diameters, and texels in a diameter.
struct Refracting {
    axes: [f32; 2],
    diameter: f32,
}

impl Shape for Refracting {
    #[inline(always)]
    fn at(&self, x: f32, y: f32) -> f32 {
        let (u, v) = (x / self.axes[0], y / self.axes[1]);
        let share = (u * u + v * v).sqrt();
        let edge = ((1.0 - share) * 0.5 * self.diameter + 0.5).clamp(0.0, 1.0);
        edge * through(f64::from(share.min(0.97))) as f32
    }
}

/// A drop of a diameter in metres: what it does not let through.
fn drop(place: &Place, diameter: f64, own: f64) -> Vec<f32> {
    // Height over width by Brandes, Zhang and Vivekanandan 2002 (J. Appl. Meteor. 41, 674), a fit to
    // measurements in wind tunnels and of oscillating drops.
    let d = (1e3 * own).clamp(0.5, 8.0);
    let ratio = 0.9951 + d * (0.0251 + d * (-0.03644 + d * (0.005_303 - d * 0.000_249_2)));
    let ratio = ratio.clamp(0.4, 1.0);
    // Axes of a drop of the same area.
    let axes = [0.5 / ratio.sqrt(), 0.5 * ratio.sqrt()].map(|axis| axis as f32);
    let shape = Refracting { axes, diameter: diameter as f32 };
    filled(place, diameter, 0.5 / ratio.sqrt() + 1.0 / diameter, &shape)
}

/// Texels of a shape that reaches so many diameters from its middle.
fn filled(place: &Place, diameter: f64, reach: f64, shape: &impl Shape) -> Vec<f32> {
    let [columns, rows] = place.size;
    let mut alpha = vec![0.0; columns * rows];
    let middle = place.middle.map(|v| v as f32 - 0.5);
    let reach = (reach * diameter) as f32;
    let range = |middle: f32, count: usize, reach: f32| {
        let limit = count as f32;
        let first = (middle - reach).floor().clamp(0.0, limit) as usize;
        first..(middle + reach + 1.0).ceil().clamp(0.0, limit) as usize
    };
    let inverse = (1.0 / diameter) as f32;
    for row in range(middle[1], rows, reach) {
        // No shape fills the corners.
        let y = row as f32 - middle[1];
        let across = range(middle[0], columns, (reach * reach - y * y).max(0.0).sqrt());
        let start = across.start as f32 - middle[0];
        let line = &mut alpha[row * columns..][across];
        paint(line, start, y * inverse, inverse, shape);
    }
    alpha
}

/// Paints a line of a shape from so many texels right of its middle on, `y` and a texel in diameters.
#[dispatch]
fn paint<const LEVEL: u8, S: Shape>(line: &mut [f32], start: f32, y: f32, texel: f32, shape: &S) {
    for (column, out) in line.iter_mut().enumerate() {
        *out = shape.at((column as f32 + start) * texel, y);
    }
}

/// The part that a drop lets through at a distance from its middle, in radii, below 1: twice through its
/// surface, by Fresnel's law at an index of 1.333.
#[inline(always)]
fn through(share: f64) -> f64 {
    let index = 1.333;
    let inside = share / index;
    let (a, b) = ((1.0 - share * share).sqrt(), (1.0 - inside * inside).sqrt());
    let across = (a - index * b) / (a + index * b);
    let along = (index * a - b) / (index * a + b);
    let passed = 1.0 - 0.5 * (across * across + along * along);
    passed * passed
}
