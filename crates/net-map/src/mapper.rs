//! Frame after frame into tiles.

use std::collections::BTreeSet;

use net_geometry::nalgebra::Vector2;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::frame::{Frame, NetView, Seen, TwineLook, in_reach};
use crate::patch::Patches;
use crate::store::{Cache, TileStore};
use crate::tile::{Tile, TileKey};

/// The map of a net under construction. Memory: the tiles that the configuration allows, and one view; the rest is the store's.
#[derive(Debug)]
pub struct Mapper<S> {
    pub(crate) config: Config,
    pub(crate) cache: Cache<S>,
    patches: Patches,
    last: Option<u32>,
}

impl<S: TileStore> Mapper<S> {
    /// An empty map.
    ///
    /// # Errors
    /// [`Error::Value`] for a parameter out of range.
    pub fn new(store: S, config: &Config) -> Result<Self> {
        config.validate()?;
        Ok(Self {
            config: config.clone(),
            cache: Cache::new(store, config.tiles_in_memory),
            patches: Patches::default(),
            last: None,
        })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// [`Error::Order`] for a frame that does not come after the one before, [`Error::Store`] and [`Error::Tile`] for tiles that can't be kept.
    pub fn add<V: NetView>(&mut self, frame: &Frame<'_, V>) -> Result<()> {
        if let Some(previous) = self.last.filter(|&p| p >= frame.number) {
            return Err(Error::Order { frame: frame.number, previous });
        }
        self.last = Some(frame.number);
        let Self { config, cache, patches, .. } = self;
        for look in frame.twines.iter().filter(|t| t.direction < 2 && in_reach(t.index)) {
            let (key, place) = TileKey::of(frame.track, look.index);
            let mut look = *look;
            if look.seen == Seen::Missing && length_px(frame.view, &look).is_some_and(|l| l < config.missing_min_px) {
                // Too far away to tell a gap from weed.
                look.seen = Seen::Unknown;
            }
            cache.tile(key)?.twines[place][look.direction].add(&look, frame.number, frame.axis, config);
        }
        let mut result = Ok(());
        patches.lay_out(frame.image, frame.view, frame.twines, |view| {
            if result.is_err() || !in_reach(view.cell) {
                return;
            }
            let (key, place) = TileKey::of(frame.track, view.cell);
            let cell = match cache.tile(key) {
                Ok(tile) => &mut tile.cells[place],
                Err(error) => {
                    result = Err(error);
                    return;
                }
            };
            if cell.frames == 0 {
                cell.first = frame.number;
            }
            cell.frames = cell.frames.saturating_add(1);
            cell.last = frame.number;
            if let Some(blocked) = view.blocked.filter(|_| view.px >= config.growth_min_px) {
                cell.blocked += blocked;
                cell.blocked_frames += 1;
            }
            // Near and unhidden is best; a hidden cell is better than none.
            if !view.hidden && view.px as f32 > cell.best_px {
                cell.best_px = view.px as f32;
                cell.best_depth_m = view.depth_m as f32;
                cell.contrast = view.contrast;
                cell.patch = view.patch;
            } else if cell.best_px == 0.0 {
                cell.patch = view.patch;
            }
        });
        result
    }

    /// Every tile that there is, in order.
    pub fn keys(&self) -> &BTreeSet<TileKey> {
        &self.cache.keys
    }

    /// A tile.
    ///
    /// # Errors
    /// [`Error::Store`] and [`Error::Tile`].
    pub fn tile(&mut self, key: TileKey) -> Result<&Tile> {
        self.cache.tile(key).map(|tile| &*tile)
    }

    /// Hands all tiles in memory to the store.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn save(&mut self) -> Result<()> {
        self.cache.save_all()
    }
}

/// Distance between the knots at a twine's ends, px.
fn length_px(view: &impl NetView, look: &TwineLook) -> Option<f64> {
    let from = Vector2::new(f64::from(look.index.0), f64::from(look.index.1));
    let to = from + if look.direction == 0 { Vector2::x() } else { Vector2::y() };
    Some((view.pixel(to)?.0 - view.pixel(from)?.0).norm())
}
