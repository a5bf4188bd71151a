//! Times of an image folder: from `timestamps.csv`, from the names, or made up.

use std::collections::BTreeMap;
use std::path::{Component, Path};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::frame::check_regular;

/// Name of the table of times.
pub(crate) const TIMESTAMPS_CSV: &str = "timestamps.csv";

/// A line of `timestamps.csv`.
#[derive(Debug, Deserialize)]
struct Row {
    file: String,
    timestamp_ns: String,
}

/// A time that the table gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Told {
    /// Since the Unix epoch, ns.
    pub ns: i64,
    /// Line of the table, from 1.
    pub line: u64,
}

/// Time by file name, or why the table has none that can be used.
pub(crate) type Times = BTreeMap<String, std::result::Result<Told, String>>;

/// Reads `timestamps.csv`. A line that gives no time spoils its own frame only; a table without the two columns is an error.
pub(crate) fn read_csv(path: &Path) -> Result<Times> {
    check_regular(path).map_err(Error::io("read", path))?;
    let table = |line: u64, why: String| Error::Table { path: path.to_owned(), line, why };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_path(path)
        .map_err(|e| table(1, e.to_string()))?;
    let headers = reader.headers().map_err(|e| table(1, e.to_string()))?.clone();
    for column in ["file", "timestamp_ns"] {
        if !headers.iter().any(|h| h == column) {
            return Err(table(1, format!("no column {column:?}; the first line must be file,timestamp_ns")));
        }
    }
    let mut times = Times::new();
    for record in reader.records() {
        let record = record.map_err(|e| table(e.position().map_or(0, csv::Position::line), e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        // Too few cells: most often a last line that was never finished.
        let Ok(row) = record.deserialize::<Row>(Some(&headers)) else {
            if let Some(file) = record.get(headers.iter().position(|h| h == "file").unwrap_or(0)) {
                let file = name_in_folder(file).unwrap_or_else(|| file.to_owned());
                times.insert(file, Err(format!("{TIMESTAMPS_CSV}, line {line} has no time")));
            }
            continue;
        };
        let Some(file) = name_in_folder(&row.file) else {
            let why = format!("{TIMESTAMPS_CSV}, line {line}: {:?} is no file of this folder", row.file);
            times.insert(row.file, Err(why));
            continue;
        };
        let time = row.timestamp_ns.parse().map(|ns| Told { ns, line }).map_err(|_| {
            format!("{TIMESTAMPS_CSV}, line {line}: {:?} is not a whole number of nanoseconds", row.timestamp_ns)
        });
        let same = |before: &std::result::Result<Told, String>| match (before, &time) {
            (Ok(before), Ok(now)) => before.ns == now.ns,
            _ => false,
        };
        let twice = times.get(&file).is_some_and(|before| !same(before));
        let time =
            if twice { Err(format!("{TIMESTAMPS_CSV} gives it two times, the second in line {line}")) } else { time };
        times.insert(file, time);
    }
    Ok(times)
}

/// The name of a file as the folder's listing has it: `./f.png` is `f.png`. `None` for none, and for a path that leaves the folder.
fn name_in_folder(path: &str) -> Option<String> {
    let mut parts = Vec::new();
    for part in Path::new(path).components() {
        match part {
            Component::CurDir => {}
            Component::Normal(name) => parts.push(name.to_str()?),
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    (!parts.is_empty()).then(|| parts.join("/"))
}

/// Times from names that are whole nanoseconds, `None` if these are not such names.
///
/// Numbers are nanoseconds if most of the names are numbers and the largest is a time after 1973 (at least 1e17), or if a clock
/// that starts near zero is the only sense in them: 1 ms or more between most neighbours. Frame numbers, dates
/// (`20231105143000`) and epoch times in microseconds are neither. A name that is no number then has no time.
pub(crate) fn from_names(names: &[String]) -> Option<Vec<Option<i64>>> {
    let times: Vec<Option<i64>> = names.iter().map(|name| stem(name).parse().ok().filter(|&t: &i64| t >= 0)).collect();
    let mut known: Vec<i64> = times.iter().copied().flatten().collect();
    if known.is_empty() || 2 * known.len() <= names.len() {
        return None;
    }
    known.sort_unstable();
    let largest = *known.last()?;
    let mut steps: Vec<i64> = known.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_unstable();
    let median_step = steps.get(steps.len() / 2).copied().unwrap_or(0);
    let since_epoch = largest >= 100_000_000_000_000_000;
    let since_start = largest < 1_000_000_000_000_000 && median_step >= 1_000_000;
    (since_epoch || since_start).then_some(times)
}

/// Name without its extension.
fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}
