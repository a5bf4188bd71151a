//! Pictures of a folder, a `.json` with the truth beside each: `file`, `K`, `dist_model`, `dist`, `net_colour`, and of the net `layers[0]` with `cell_len`, `cell_angle_deg`, `a1`, `a2`, `junctions`
//! (rows `i, j, u, v, depth, flag`; flag 0 is visible) and `missing_edges`.

use std::path::{Path, PathBuf};

use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Lens, Mesh};
use net_sim::Image;
use serde_json::Value;

use crate::Result;
use crate::sample::{Knot, Sample};

fn number(value: &Value) -> Result<f64> {
    value.as_f64().ok_or_else(|| format!("{value} is no number").into())
}

fn numbers(value: &Value) -> Result<Vec<f64>> {
    value.as_array().ok_or_else(|| format!("{value} is no list"))?.iter().map(number).collect()
}

/// Pictures with a net by kind.
pub fn list(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let mut list = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let json: Value = serde_json::from_slice(&std::fs::read(&path)?)?;
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        // s076_B_hole0: the group, then the name.
        let mut parts = stem.splitn(3, '_').skip(1);
        let (group, name) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        let name = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
        let kind = match (group, name, json["net_colour"].as_str()) {
            ("N", ..) => continue,
            ("A", _, Some("white")) => "A flat, white",
            ("A", ..) => "A flat, dark or brown",
            ("H", ..) | (_, "curved", _) => "hung, bent",
            ("C", ..) => "mixtures",
            (_, "mblur", _) => "motion blur",
            (_, "turbid_v" | "lowlight" | "noise" | "snow" | "fish", _) => name.trim_end_matches("_v"),
            (_, "hole", _) => "hole",
            _ => "other",
        };
        list.push((kind.to_owned(), path));
    }
    Ok(list)
}

pub fn read(path: &Path) -> Result<Sample> {
    let json: Value = serde_json::from_slice(&std::fs::read(path)?)?;
    let layer = &json["layers"][0];
    let k = json["K"].as_array().ok_or("no K")?.iter().map(numbers).collect::<Result<Vec<_>>>()?;
    let lens = match json["dist_model"].as_str() {
        Some("plumb_bob") => Lens::PlumbBob(numbers(&json["dist"])?.try_into().map_err(|_| "five coefficients")?),
        _ => Lens::None,
    };
    let (width, height) = (number(&json["width"])? as u32, number(&json["height"])? as u32);
    let camera = Camera::new(k[0][0], k[1][1], k[0][2], k[1][2], width, height, lens)?;
    let sides = numbers(&layer["cell_len"])?;
    let mesh = Mesh::oblique(sides[0], sides[1], number(&layer["cell_angle_deg"])?.to_radians())?;
    let mut knots = Vec::new();
    for row in layer["junctions"].as_array().ok_or("no junctions")? {
        let row = numbers(row)?;
        let pixel = Vector2::new(row[2], row[3]);
        let Some(ray) = camera.ray_from_pixel(pixel) else { continue };
        let (index, point) = ((row[0] as i32, row[1] as i32), ray * (row[4] / ray.z));
        knots.push(Knot { index, pixel, point, visible: row[5] == 0.0, covered: row[5] != 0.0 });
    }
    let mut missing = std::collections::BTreeSet::new();
    for edge in layer["missing_edges"].as_array().into_iter().flatten() {
        let ends = edge["ij"].as_array().ok_or("no ij")?.iter().map(numbers).collect::<Result<Vec<_>>>()?;
        let ends = [0, 1].map(|e| (ends[e][0] as i32, ends[e][1] as i32));
        missing.insert((ends[0].min(ends[1]), usize::from(ends[0].0 == ends[1].0)));
    }
    let name = json["file"].as_str().ok_or("no file")?;
    let picture = image::open(path.with_file_name(name))?.to_luma8();
    let mut image = Image::new(picture.width() as usize, picture.height() as usize);
    for (v, row) in picture.as_raw().chunks_exact(picture.width() as usize).enumerate() {
        image.row_mut(v).copy_from_slice(row);
    }
    Ok(Sample { name: name.to_owned(), image, camera, mesh, knots, missing, bent: true })
}
