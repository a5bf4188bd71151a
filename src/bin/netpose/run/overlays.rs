//! A picture of every frame, drawn in the pool's threads.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

use anyhow::{Context, Result, anyhow};
use net_image::Image;
use rayon::ThreadPool;

use super::frames::Tracked;
use crate::draw::Overlay;

/// Pictures under way, at most `depth` of them.
pub struct Overlays<'a> {
    dir: PathBuf,
    pool: &'a ThreadPool,
    depth: usize,
    overlay: Arc<Overlay>,
    under_way: VecDeque<Receiver<Result<()>>>,
}

impl<'a> Overlays<'a> {
    /// Pictures go into `dir`, which is made.
    pub fn new(dir: &Path, pool: &'a ThreadPool, depth: usize, overlay: &Arc<Overlay>) -> Result<Self> {
        std::fs::create_dir_all(dir).with_context(|| format!("cannot create {}", dir.display()))?;
        Ok(Self { dir: dir.to_owned(), pool, depth, overlay: Arc::clone(overlay), under_way: VecDeque::new() })
    }

    /// Draws one frame, soon. Waits while too many are under way.
    pub fn draw(&mut self, frame: u64, image: Image<u8>, tracked: &Tracked) -> Result<()> {
        while self.under_way.len() >= self.depth {
            self.wait_for_one()?;
        }
        let dir = self.dir.clone();
        let (done, promise) = sync_channel(1);
        let (overlay, tracked) = (Arc::clone(&self.overlay), tracked.clone());
        self.pool.spawn_fifo(move || {
            let drawn = match image.view() {
                Some(view) => {
                    overlay.write(view, &format!("frame {frame}"), &tracked.shown(), &dir, &format!("{frame:06}"))
                }
                None => Ok(()),
            };
            // If nobody waits any more, nobody wants to know.
            let _ = done.send(drawn);
        });
        self.under_way.push_back(promise);
        Ok(())
    }

    /// Waits for all pictures.
    pub fn finish(mut self) -> Result<()> {
        while !self.under_way.is_empty() {
            self.wait_for_one()?;
        }
        Ok(())
    }

    fn wait_for_one(&mut self) -> Result<()> {
        let Some(promise) = self.under_way.pop_front() else { return Ok(()) };
        promise.recv().map_err(|_| anyhow!("a drawing thread ended early"))?
    }
}
