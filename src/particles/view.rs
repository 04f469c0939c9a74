//! What an eye sees: the pyramid in front of a window of its picture.

use super::sprite::Lens;

/// What a lens sees, with room for the size and the motion of flakes: never a wrong no.
pub struct View {
    offset: [f64; 3],
    // Slopes of the four planes, along x and y.
    low: [f64; 2],
    high: [f64; 2],
    /// World units, for the size and the motion of flakes.
    pub(super) room: f64,
}

/// Pixels that the smallest image reaches beyond its middle, and a little more.
const LEAST_REACH: f64 = 4.0;

impl View {
    /// What a lens sees in a window, pixels (top, bottom, left, right).
    pub fn new(lens: &Lens, [top, bottom, left, right]: [usize; 4], room: f64) -> Self {
        let first = [left as f64, top as f64];
        let end = [right as f64, bottom as f64];
        let slope = |axis: usize, px: f64| (px - lens.center[axis]) / lens.focal;
        Self {
            offset: lens.offset,
            low: std::array::from_fn(|axis| slope(axis, first[axis] - LEAST_REACH)),
            high: std::array::from_fn(|axis| slope(axis, end[axis] + LEAST_REACH)),
            room,
        }
    }

    /// Whether a place may be seen.
    #[inline(always)]
    pub fn sees(&self, [x, y, z]: [f64; 3]) -> bool {
        self.holds(0, x, z) & self.holds(1, y, z)
    }

    /// Whether a place may be seen along an axis, 0 or 1, at a depth.
    #[inline(always)]
    fn holds(&self, axis: usize, place: f64, z: f64) -> bool {
        let (place, z) = (place - self.offset[axis], z - self.offset[2]);
        // The room shifts each plane outwards, whichever way it leans.
        let (near, far) = (z - self.room, z + self.room);
        let reach =
            |slope: f64, deep: f64, shallow: f64| slope * if slope > 0.0 { deep } else { shallow };
        // Without branches, so that it is asked for a vector of places.
        (far > 0.0)
            & (place >= -reach(-self.low[axis], far, near) - self.room)
            & (place <= reach(self.high[axis], far, near) + self.room)
    }
}
