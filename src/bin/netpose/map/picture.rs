//! The map as pictures: the mosaic tile by tile, and for each track the whole, with holes, coverage and growth.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use net_geometry::nalgebra::Vector2;
use net_map::{Cell, Hole, Mapper, PATCH, TILE, TileKey, TileStore};

use crate::draw::{Canvas, Colour};

/// Longest side of a picture of the whole, px.
const LARGEST_PX: i64 = 4096;
const NEVER_SEEN: Colour = [24, 30, 44];
const HOLE: Colour = [255, 60, 40];
/// Height of a cell, px, that counts as sharp: junctions are then good to a tenth of a pixel.
const SHARP_PX: f32 = 30.0;
/// Excess of the blocked share that is drawn as full growth.
const MUCH_GROWTH: f32 = 0.3;

/// Writes them; returns their number.
pub fn write<S: TileStore>(
    dir: &Path,
    mapper: &mut Mapper<S>,
    holes: &[Hole],
    clean: &BTreeMap<u32, f32>,
) -> Result<usize> {
    let keys: Vec<TileKey> = mapper.keys().iter().copied().collect();
    let mut written = 0;
    let mut save = |name: String, canvas: &Canvas| -> Result<()> {
        let path = dir.join(name);
        written += 1;
        std::fs::write(&path, canvas.to_png()?).with_context(|| format!("cannot write {}", path.display()))
    };
    let mut by_track: BTreeMap<u32, Vec<TileKey>> = BTreeMap::new();
    for key in keys {
        by_track.entry(key.track).or_default().push(key);
    }
    for (track, keys) in by_track {
        let holes: Vec<&Hole> = holes.iter().filter(|h| h.track == track).collect();
        let Some(extent) = extent(mapper, &keys)? else { continue };
        for &key in &keys {
            let mut sheet = Sheet::new(key.cell(0), (TILE, TILE), PATCH as i64);
            sheet.draw_tile(mapper, key, |cell| Some(cell.patch.map(|g| [g; 3])))?;
            sheet.draw_holes(&holes);
            save(format!("tile_{key}.png"), &sheet.canvas)?;
        }
        let [first, span] = extent;
        let scale = (LARGEST_PX / i64::from(span.0.max(span.1))).min(PATCH as i64);
        if scale == 0 {
            eprintln!(
                "the map of track {track} has {} x {} cells: too many for one picture, see its tiles",
                span.0, span.1
            );
            continue;
        }
        let clean = clean.get(&track).copied().unwrap_or(0.0);
        type Paint<'a> = &'a dyn Fn(&Cell) -> Option<[Colour; PATCH * PATCH]>;
        let growth = |cell: &Cell| {
            let Some(share) = cell.blocked_share() else {
                return Some(cell.patch.map(|g| tint(g, NEVER_SEEN, 0.6)));
            };
            let much = ((share - clean) / MUCH_GROWTH).clamp(0.0, 1.0);
            Some(cell.patch.map(|g| tint(g, [40, 200, 60], 0.7 * much)))
        };
        let coverage = |cell: &Cell| {
            let sharp = (cell.best_px / SHARP_PX).clamp(0.0, 1.0);
            // From red, seen from afar or hidden, to green.
            let colour = [(220.0 * (1.0 - sharp)) as u8, (60.0 + 150.0 * sharp) as u8, 60];
            Some([colour; PATCH * PATCH])
        };
        let paints: [(&str, Paint<'_>); 3] =
            [("map", &|cell| Some(cell.patch.map(|g| [g; 3]))), ("coverage", &coverage), ("growth", &growth)];
        for (name, paint) in paints {
            let mut sheet = Sheet::new(first, span, scale);
            for &key in &keys {
                sheet.draw_tile(mapper, key, paint)?;
            }
            sheet.draw_holes(&holes);
            save(format!("{name}_{track}.png"), &sheet.canvas)?;
        }
    }
    Ok(written)
}

/// First cell and number of cells of what was seen; `None` if nothing was.
fn extent<S: TileStore>(mapper: &mut Mapper<S>, keys: &[TileKey]) -> Result<Option<[(i32, i32); 2]>> {
    let (mut first, mut last) = ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN));
    for &key in keys {
        for (place, _) in mapper.tile(key)?.cells.iter().enumerate().filter(|(_, c)| c.frames > 0) {
            let (i, j) = key.cell(place);
            first = (first.0.min(i), first.1.min(j));
            last = (last.0.max(i), last.1.max(j));
        }
    }
    Ok((first.0 <= last.0).then(|| [first, (last.0 - first.0 + 1, last.1 - first.1 + 1)]))
}

fn tint(grey: u8, colour: Colour, share: f32) -> Colour {
    colour.map(|c| (f32::from(grey) * (1.0 - share) + f32::from(c) * share) as u8)
}

/// A part of the net laid out: i to the right, j down.
struct Sheet {
    canvas: Canvas,
    first: (i32, i32),
    span: (i32, i32),
    /// Pixels of a cell's side.
    scale: i64,
}

impl Sheet {
    fn new(first: (i32, i32), span: (i32, i32), scale: i64) -> Self {
        let side = |n: i32| (i64::from(n) * scale) as usize;
        Self { canvas: Canvas::filled(side(span.0), side(span.1), NEVER_SEEN), first, span, scale }
    }

    /// Draws the cells of a tile that were seen; `paint` gives their samples' colours.
    fn draw_tile<S: TileStore>(
        &mut self,
        mapper: &mut Mapper<S>,
        key: TileKey,
        paint: impl Fn(&Cell) -> Option<[Colour; PATCH * PATCH]>,
    ) -> Result<()> {
        for (place, cell) in mapper.tile(key)?.cells.iter().enumerate().filter(|(_, c)| c.frames > 0) {
            let Some(samples) = paint(cell) else { continue };
            let at = key.cell(place);
            let (i, j) = (at.0 - self.first.0, at.1 - self.first.1);
            if !((0..self.span.0).contains(&i) && (0..self.span.1).contains(&j)) {
                continue;
            }
            for y in 0..self.scale {
                for x in 0..self.scale {
                    let colour = mean(&samples, x as usize, y as usize, self.scale as usize);
                    self.canvas.blend(i64::from(i) * self.scale + x, i64::from(j) * self.scale + y, colour, 1.0);
                }
            }
        }
        Ok(())
    }

    fn draw_holes(&mut self, holes: &[&Hole]) {
        let pixel = |corner: (i32, i32)| {
            let along = |at: i32, first: i32| f64::from(at - first) * self.scale as f64 - 0.5;
            Vector2::new(along(corner.0, self.first.0), along(corner.1, self.first.1))
        };
        let width = (self.scale as f64 / 8.0).clamp(1.0, 2.0);
        let lines: Vec<_> = holes
            .iter()
            .flat_map(|h| h.outline.iter().zip(h.outline.iter().cycle().skip(1)))
            .map(|(&a, &b)| (pixel(a), pixel(b)))
            .collect();
        for (a, b) in lines {
            self.canvas.line(a, b, width, HOLE, 1.0);
        }
    }
}

/// Mean of the samples under pixel `(x, y)` of a cell that is `scale` px wide.
fn mean(samples: &[Colour; PATCH * PATCH], x: usize, y: usize, scale: usize) -> Colour {
    let range = |k: usize| k * PATCH / scale..((k + 1) * PATCH / scale).max(k * PATCH / scale + 1);
    let (mut sum, mut n) = ([0_u32; 3], 0);
    for v in range(y) {
        for u in range(x) {
            let colour = samples[v * PATCH + u];
            sum.iter_mut().zip(colour).for_each(|(s, c)| *s += u32::from(c));
            n += 1;
        }
    }
    sum.map(|s| (s / n) as u8)
}
