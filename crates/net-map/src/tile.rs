//! Tiles: 32 x 32 cells with their twines, fixed in size, as bytes on whatever keeps them.

use crate::error::{Error, Result};

/// Cells along a tile's side.
pub const TILE: i32 = 32;
/// Samples along a cell's side in the mosaic.
pub const PATCH: usize = 16;
/// Samples of a cell.
pub const SAMPLES: usize = PATCH * PATCH;
/// First bytes of a tile: name and version.
const MAGIC: &[u8; 8] = b"netmap01";
/// Bytes of a cell and of a twine.
const CELL_BYTES: usize = 4 * 8 + SAMPLES;
const TWINE_BYTES: usize = 4 * 12;

/// Which tile: cells `32 i` to `32 i + 31`, likewise `j`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileKey {
    /// Number of the count of cells.
    pub track: u32,
    /// Along the first direction.
    pub i: i32,
    /// Along the second.
    pub j: i32,
}

impl TileKey {
    /// The tile of a cell, and the cell's place in it.
    pub fn of(track: u32, cell: (i32, i32)) -> (Self, usize) {
        let key = Self { track, i: cell.0.div_euclid(TILE), j: cell.1.div_euclid(TILE) };
        (key, (cell.1.rem_euclid(TILE) * TILE + cell.0.rem_euclid(TILE)) as usize)
    }

    /// The cell at a place in this tile.
    pub fn cell(&self, place: usize) -> (i32, i32) {
        (self.i * TILE + place as i32 % TILE, self.j * TILE + place as i32 / TILE)
    }
}

impl std::fmt::Display for TileKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}_{}_{}", self.track, self.i, self.j)
    }
}

/// A mesh: the cell between the nodes `(i, j)` and `(i + 1, j + 1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Frames that show it.
    pub frames: u32,
    /// First and last of them.
    pub first: u32,
    /// See `first`.
    pub last: u32,
    /// Best view: height of the cell, px; 0 before any.
    pub best_px: f32,
    /// Depth of the best view, m.
    pub best_depth_m: f32,
    /// How far twine stands out from the water behind it in the best view, grey levels.
    pub contrast: f32,
    /// Blocked share of the mesh, summed over the frames that could measure it, and their number.
    pub blocked: f32,
    /// See `blocked`.
    pub blocked_frames: u32,
    /// The best view, rows along the first direction; 128 is the water, brightness and contrast normalised.
    pub patch: [u8; SAMPLES],
}

impl Cell {
    const EMPTY: Self = Self {
        frames: 0,
        first: 0,
        last: 0,
        best_px: 0.0,
        best_depth_m: 0.0,
        contrast: 0.0,
        blocked: 0.0,
        blocked_frames: 0,
        patch: [0; SAMPLES],
    };

    /// Blocked share of the mesh in [0, 1], twine included; `None` if it was never seen from near enough, unhidden and well above noise.
    pub fn blocked_share(&self) -> Option<f32> {
        (self.blocked_frames > 0).then(|| self.blocked / self.blocked_frames as f32)
    }
}

/// What is known of a twine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twine {
    /// Sum of the log likelihood ratios, present to missing, of all looks that are over.
    pub settled: f32,
    /// Sum and number of the frames of the present look.
    pub look_sum: f32,
    /// See `look_sum`.
    pub look_frames: u32,
    /// Where the present look began: lattice coordinates at the optical axis, and frame.
    pub look_at: [f32; 2],
    /// See `look_at`.
    pub look_since: u32,
    /// Looks, the present one included.
    pub looks: u32,
    /// Frames in which it was overgrown.
    pub fouled: u32,
    /// Frames that called it missing, and the first and the last of them.
    pub missing: u32,
    /// See `missing`.
    pub first_missing: u32,
    /// See `missing`.
    pub last_missing: u32,
    /// Best neighbourhood contrast of a frame that called it missing, deviations.
    pub contrast: f32,
}

/// A tile.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// Its cells, row by row along the first direction.
    pub cells: Vec<Cell>,
    /// Twines that leave each cell's node `(i, j)` along both directions.
    pub twines: Vec<[Twine; 2]>,
}

impl Default for Tile {
    fn default() -> Self {
        let n = (TILE * TILE) as usize;
        Self { cells: vec![Cell::EMPTY; n], twines: vec![[Twine::default(); 2]; n] }
    }
}

impl Tile {
    /// Length of [`Tile::to_bytes`].
    pub const BYTES: usize = MAGIC.len() + (TILE * TILE) as usize * (CELL_BYTES + 2 * TWINE_BYTES);

    /// As bytes, little-endian: the same for the same tile everywhere.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(Self::BYTES);
        bytes.extend_from_slice(MAGIC);
        for c in &self.cells {
            let words = [
                c.frames,
                c.first,
                c.last,
                c.best_px.to_bits(),
                c.best_depth_m.to_bits(),
                c.contrast.to_bits(),
                c.blocked.to_bits(),
                c.blocked_frames,
            ];
            words.iter().for_each(|w| bytes.extend_from_slice(&w.to_le_bytes()));
            bytes.extend_from_slice(&c.patch);
        }
        for t in self.twines.iter().flatten() {
            let words = [
                t.settled.to_bits(),
                t.look_sum.to_bits(),
                t.look_frames,
                t.look_at[0].to_bits(),
                t.look_at[1].to_bits(),
                t.look_since,
                t.looks,
                t.fouled,
                t.missing,
                t.first_missing,
                t.last_missing,
                t.contrast.to_bits(),
            ];
            words.iter().for_each(|w| bytes.extend_from_slice(&w.to_le_bytes()));
        }
        bytes
    }

    /// Back from bytes.
    ///
    /// # Errors
    /// [`Error::Tile`] for bytes of another length or version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let wrong = Error::Tile { length: bytes.len(), expected: Self::BYTES };
        let Some(body) = bytes.strip_prefix(MAGIC).filter(|_| bytes.len() == Self::BYTES) else { return Err(wrong) };
        let n = (TILE * TILE) as usize;
        let (cells, twines) = body.split_at(n * CELL_BYTES);
        let word = |b: &[u8], k: usize| u32::from_le_bytes(std::array::from_fn(|n| b[4 * k + n]));
        let real = |b: &[u8], k: usize| f32::from_bits(word(b, k));
        let cell = |b: &[u8]| Cell {
            frames: word(b, 0),
            first: word(b, 1),
            last: word(b, 2),
            best_px: real(b, 3),
            best_depth_m: real(b, 4),
            contrast: real(b, 5),
            blocked: real(b, 6),
            blocked_frames: word(b, 7),
            patch: std::array::from_fn(|k| b[32 + k]),
        };
        let twine = |b: &[u8]| Twine {
            settled: real(b, 0),
            look_sum: real(b, 1),
            look_frames: word(b, 2),
            look_at: [real(b, 3), real(b, 4)],
            look_since: word(b, 5),
            looks: word(b, 6),
            fouled: word(b, 7),
            missing: word(b, 8),
            first_missing: word(b, 9),
            last_missing: word(b, 10),
            contrast: real(b, 11),
        };
        Ok(Self {
            cells: cells.chunks_exact(CELL_BYTES).map(cell).collect(),
            twines: twines
                .chunks_exact(2 * TWINE_BYTES)
                .map(|pair| [twine(&pair[..TWINE_BYTES]), twine(&pair[TWINE_BYTES..])])
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_reads_back() {
        let mut tile = Tile::default();
        tile.cells[5] = Cell { frames: 3, best_px: 12.5, blocked: 0.25, patch: [7; SAMPLES], ..Cell::EMPTY };
        tile.twines[1023][1] = Twine { settled: -3.5, looks: 2, contrast: 4.0, ..Twine::default() };
        let bytes = tile.to_bytes();
        assert_eq!(bytes.len(), Tile::BYTES);
        assert_eq!(Tile::from_bytes(&bytes).expect("just written"), tile);
        assert!(Tile::from_bytes(&bytes[1..]).is_err());
        assert!(Tile::from_bytes(&[]).is_err());
    }

    #[test]
    fn cells_of_negative_index_have_their_place() {
        for cell in [(0, 0), (31, 31), (32, -1), (-1, -32), (-33, 5)] {
            let (key, place) = TileKey::of(2, cell);
            assert_eq!(key.cell(place), cell);
        }
        assert_eq!(TileKey::of(0, (-1, -33)).0, TileKey { track: 0, i: -1, j: -2 });
    }
}
