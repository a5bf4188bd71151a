//! `netpose run --map`: the net unrolled, while the run goes on, and its pictures and tables in the end.

mod disk;
mod picture;
mod table;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use net_geometry::nalgebra::Vector2;
use net_image::GrayView;
use net_map::{Config, Frame, Mapper, Seen, TwineLook};
use netpose::{Mesh, Tracker, Twine, TwineState};

use crate::run::Counted;
use disk::Disk;

/// The map of a run under construction.
pub struct NetMap {
    mapper: Mapper<Disk>,
    dir: PathBuf,
    mesh: Mesh,
    looks: Vec<TwineLook>,
}

impl NetMap {
    /// An empty map, to be written into the folder of a run.
    pub fn new(out: &Path, mesh: Mesh) -> Result<Self> {
        let dir = out.join("map");
        let store = Disk::create(&dir.join("tiles"))?;
        Ok(Self { mapper: Mapper::new(store, &Config::default())?, dir, mesh, looks: Vec::new() })
    }

    /// Adds the frame that the tracker did last, if its count is certain.
    pub fn add(&mut self, counted: &Counted, image: GrayView<'_>, tracker: &Tracker, twines: &[Twine]) -> Result<()> {
        let Some(axis) = tracker.lattice_at_axis().filter(|_| counted.sure) else { return Ok(()) };
        let number = u32::try_from(counted.frame).context("the map counts to four thousand million frames")?;
        let offset = counted.offset;
        let shift = Vector2::new(f64::from(offset.0), f64::from(offset.1));
        self.looks.clear();
        self.looks.extend(twines.iter().map(|t| look(t, offset)));
        let view =
            |at: Vector2<f64>| Some((tracker.pixel_by_knots(at - shift)?, tracker.pixel_from_lattice(at - shift)?.1));
        let track = counted.stretch;
        self.mapper.add(&Frame { number, track, image, view: &view, axis: axis + shift, twines: &self.looks })?;
        Ok(())
    }

    /// Writes pictures and tables, and removes the tiles. Returns what to tell.
    pub fn finish(mut self) -> Result<String> {
        let holes = self.mapper.holes()?;
        let out = self.dir.parent().unwrap_or(&self.dir).to_owned();
        table::write_holes(&out.join("holes.csv"), &holes, &self.mesh)?;
        let clean = table::write_growth(&out.join("growth.parquet"), &mut self.mapper)?;
        let pictures = picture::write(&self.dir, &mut self.mapper, &holes, &clean)?;
        disk::remove(&self.dir.join("tiles"))?;
        Ok(format!("map: {} holes, {pictures} pictures in {}", holes.len(), self.dir.display()))
    }
}

fn look(t: &Twine, offset: (i32, i32)) -> TwineLook {
    let seen = match t.state {
        TwineState::Unknown => Seen::Unknown,
        TwineState::Present => Seen::Present,
        TwineState::Missing | TwineState::Doubtful => Seen::Missing,
        TwineState::Hidden => Seen::Hidden,
        TwineState::Fouled => Seen::Fouled,
    };
    let index = (t.index.0.saturating_add(offset.0), t.index.1.saturating_add(offset.1));
    TwineLook { index, direction: t.direction, seen, llr: t.llr, contrast: t.contrast }
}
