//! Tiles as files, one each, while the run goes on.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use net_map::{TileKey, TileStore};

/// A folder of tiles.
#[derive(Debug)]
pub struct Disk {
    dir: PathBuf,
}

impl Disk {
    /// An empty folder; tiles of an earlier run are removed.
    pub fn create(dir: &Path) -> Result<Self> {
        if dir.exists() {
            remove(dir)?;
        }
        std::fs::create_dir_all(dir).with_context(|| format!("cannot make {}", dir.display()))?;
        Ok(Self { dir: dir.to_owned() })
    }

    fn path(&self, key: TileKey) -> PathBuf {
        self.dir.join(format!("{key}.tile"))
    }
}

impl TileStore for Disk {
    fn load(&mut self, key: TileKey) -> std::io::Result<Option<Vec<u8>>> {
        match std::fs::read(self.path(key)) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            other => other.map(Some),
        }
    }

    fn save(&mut self, key: TileKey, bytes: &[u8]) -> std::io::Result<()> {
        std::fs::write(self.path(key), bytes)
    }
}

/// Removes the tiles, and the folder if nothing else is in it.
pub fn remove(dir: &Path) -> Result<()> {
    let failed = || format!("cannot remove {}", dir.display());
    for entry in std::fs::read_dir(dir).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        if path.extension().is_some_and(|e| e == "tile") {
            std::fs::remove_file(&path).with_context(failed)?;
        }
    }
    // A folder with something else in it stays.
    let _ = std::fs::remove_dir(dir);
    Ok(())
}
