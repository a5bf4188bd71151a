//! Tiles beyond those in memory: the caller keeps them, on disk or elsewhere.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{Error, Result};
use crate::tile::{Tile, TileKey};

/// Keeps tiles.
pub trait TileStore {
    /// A tile that was saved; `None` if it never was.
    ///
    /// # Errors
    /// Whatever keeps it from being read.
    fn load(&mut self, key: TileKey) -> std::io::Result<Option<Vec<u8>>>;

    /// Saves a tile over an earlier one.
    ///
    /// # Errors
    /// Whatever keeps it from being written.
    fn save(&mut self, key: TileKey, bytes: &[u8]) -> std::io::Result<()>;
}

/// In memory: for tests and short runs.
impl TileStore for BTreeMap<TileKey, Vec<u8>> {
    fn load(&mut self, key: TileKey) -> std::io::Result<Option<Vec<u8>>> {
        Ok(self.get(&key).cloned())
    }

    fn save(&mut self, key: TileKey, bytes: &[u8]) -> std::io::Result<()> {
        self.insert(key, bytes.to_vec());
        Ok(())
    }
}

/// The tiles in use, and the store behind them.
#[derive(Debug)]
pub(crate) struct Cache<S> {
    store: S,
    most: usize,
    /// With the time of last use.
    tiles: BTreeMap<TileKey, (u64, Tile)>,
    clock: u64,
    /// Every tile that there is.
    pub keys: BTreeSet<TileKey>,
}

impl<S: TileStore> Cache<S> {
    pub fn new(store: S, most: usize) -> Self {
        Self { store, most, tiles: BTreeMap::new(), clock: 0, keys: BTreeSet::new() }
    }

    /// A tile to read and change; an empty one where there was none.
    pub fn tile(&mut self, key: TileKey) -> Result<&mut Tile> {
        self.clock += 1;
        if !self.tiles.contains_key(&key) {
            if self.tiles.len() >= self.most {
                self.spill()?;
            }
            let known = self.keys.contains(&key);
            let bytes = if known { self.store.load(key).map_err(|source| Error::Store { key, source })? } else { None };
            let tile = bytes.as_deref().map_or_else(|| Ok(Tile::default()), Tile::from_bytes)?;
            self.keys.insert(key);
            self.tiles.insert(key, (self.clock, tile));
        }
        let clock = self.clock;
        let slot = self.tiles.entry(key).or_default();
        slot.0 = clock;
        Ok(&mut slot.1)
    }

    /// Saves the tile that was not used for longest, and forgets it.
    fn spill(&mut self) -> Result<()> {
        if let Some(key) = self.tiles.iter().min_by_key(|(_, (used, _))| *used).map(|(key, _)| *key)
            && let Some((_, tile)) = self.tiles.remove(&key)
        {
            self.store.save(key, &tile.to_bytes()).map_err(|source| Error::Store { key, source })?;
        }
        Ok(())
    }

    /// Saves all.
    pub fn save_all(&mut self) -> Result<()> {
        for (&key, (_, tile)) in &self.tiles {
            self.store.save(key, &tile.to_bytes()).map_err(|source| Error::Store { key, source })?;
        }
        Ok(())
    }
}
