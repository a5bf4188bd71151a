//! `holes.csv` and `growth.parquet`.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use net_log::{GrowthParquet, GrowthRow};
use net_map::{Hole, Mapper, TileKey, TileStore};
use netpose::Mesh;

/// Bins of the histogram of blocked shares.
const BINS: usize = 1000;
/// Share of the meshes that are cleaner than what is called clean: enough not to be an accident.
const CLEAN: f64 = 0.1;

/// Writes the holes.
pub fn write_holes(path: &Path, holes: &[Hole], mesh: &Mesh) -> Result<()> {
    let write = || -> Result<()> {
        let mut table = csv::Writer::from_path(path)?;
        table.write_record([
            "track",
            "hole",
            "i",
            "j",
            "cells",
            "area_cm2",
            "twines",
            "llr",
            "least_llr",
            "looks",
            "first_frame",
            "last_frame",
            "outline",
        ])?;
        for (n, hole) in holes.iter().enumerate() {
            let cells = hole.cells.len() as f64;
            let centre =
                |of: fn(&(i32, i32)) -> i32| hole.cells.iter().map(|c| f64::from(of(c)) + 0.5).sum::<f64>() / cells;
            let outline: Vec<String> = hole.outline.iter().map(|(i, j)| format!("{i} {j}")).collect();
            table.write_record([
                hole.track.to_string(),
                n.to_string(),
                format!("{:.2}", centre(|c| c.0)),
                format!("{:.2}", centre(|c| c.1)),
                hole.cells.len().to_string(),
                format!("{:.1}", cells * mesh.cell_area() * 1e4),
                hole.twines.len().to_string(),
                format!("{:.2}", hole.llr),
                format!("{:.2}", hole.least_llr),
                hole.looks.to_string(),
                hole.first_frame.to_string(),
                hole.last_frame.to_string(),
                outline.join("; "),
            ])?;
        }
        Ok(table.flush()?)
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

/// Writes all meshes; returns the blocked share of a clean one, by track.
pub fn write_growth<S: TileStore>(path: &Path, mapper: &mut Mapper<S>) -> Result<BTreeMap<u32, f32>> {
    let keys: Vec<TileKey> = mapper.keys().iter().copied().collect();
    let mut histograms: BTreeMap<u32, Vec<u64>> = BTreeMap::new();
    for &key in &keys {
        let histogram = histograms.entry(key.track).or_insert_with(|| vec![0; BINS]);
        for share in mapper.tile(key)?.cells.iter().filter_map(net_map::Cell::blocked_share) {
            histogram[((f64::from(share) * BINS as f64) as usize).min(BINS - 1)] += 1;
        }
    }
    let clean: BTreeMap<u32, f32> = histograms
        .iter()
        .map(|(&track, bins)| {
            let wanted = (bins.iter().sum::<u64>() as f64 * CLEAN) as u64;
            let mut sum = 0;
            let at = bins.iter().position(|&n| {
                sum += n;
                sum > wanted
            });
            (track, at.map_or(0.0, |at| (at as f32 + 0.5) / BINS as f32))
        })
        .collect();
    let mut file = GrowthParquet::create(path)?;
    for &key in &keys {
        for (place, cell) in mapper.tile(key)?.cells.iter().enumerate().filter(|(_, c)| c.frames > 0) {
            let (i, j) = key.cell(place);
            let blocked_share = cell.blocked_share();
            file.write(&GrowthRow {
                track: key.track,
                i,
                j,
                frames: cell.frames,
                first_frame: cell.first,
                last_frame: cell.last,
                best_px: cell.best_px,
                best_depth_m: cell.best_depth_m,
                contrast: cell.contrast,
                blocked_share,
                excess_share: blocked_share.map(|s| s - clean.get(&key.track).copied().unwrap_or(0.0)),
            })?;
        }
    }
    file.finish()?;
    Ok(clean)
}
