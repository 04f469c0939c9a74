//! A layer of a stack, and the filtered textures that layers look into.

use crate::base::error::Error;

/// One filtered texture.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    /// Row after row; see [`super::table`].
    pub entries: &'a [u32],
    pub columns: u32,
    pub rows: u32,
}

/// One layer.
#[derive(Debug, Clone, Copy)]
pub struct Sheet {
    /// How often it repeats the first layer.
    pub multiple: u32,
    /// Added across and along, 2^32 to a tile; the phase is in it.
    pub offset: [u32; 2],
    /// Factor of the texture's opacity.
    pub gain: f32,
    /// log2 of the texture's texels in a tile of the first layer.
    pub texels: f32,
}

/// Filtered textures by the size of their boxes: level l is a box of 2^(l / 2) texels.
#[derive(Debug, Clone)]
pub struct Tables<'a> {
    pub levels: usize,
    /// (levels, levels): across, then along; only those that a chart needs.
    pub grid: Vec<Option<Table<'a>>>,
}

impl Tables<'_> {
    /// Refuses tables that are not as large as they say.
    pub fn check(&self) -> Result<(), Error> {
        for table in self.grid.iter().flatten() {
            let sized = (1..=16).contains(&table.columns) && (1..=16).contains(&table.rows);
            // Words are 32 bits wide, and so are the places in a table.
            let bits = table.columns + table.rows;
            if !sized || bits > 31 || table.entries.len() != 1 << bits {
                return Err(Error::Internal("a table must be as long as it says".into()));
            }
        }
        if !(1..=255).contains(&self.levels) || self.grid.len() != self.levels * self.levels {
            return Err(Error::Internal("tables must be square".into()));
        }
        Ok(())
    }
}

/// The level for a footprint of 2^`log` texels.
#[inline]
pub fn level(log: f32, levels: usize) -> usize {
    // Half a step is added and the rest cut off: rounded, for what is not negative.
    ((2.0 * log + 0.5).max(0.0) as usize).min(levels - 1)
}
