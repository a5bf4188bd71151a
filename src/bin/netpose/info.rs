//! `netpose info`: what a log is, before anything is run on it.

use std::path::PathBuf;

use anyhow::Result;
use net_log::{LogInfo, OpenOptions};
use serde_json::{Value, json};

use crate::describe;
use crate::failure::{Outcome, as_usage};

/// What a log is: kind, frames, times, topics, camera.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A folder of images, an MCAP file or a folder of MCAP files
    log: PathBuf,
    /// Image topic of an MCAP to look at, where there are several
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    /// One JSON document instead of text
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    let options = OpenOptions { topic: args.topic.clone(), ..OpenOptions::default() };
    let info = net_log::inspect(&args.log, &options).map_err(as_usage)?;
    let size = first_size(args, &options);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&as_json(&info, size))?);
    } else {
        print!("{}", as_text(&info, size));
    }
    Ok(Outcome::Complete)
}

/// Width and height of the first frame that can be read, among the first few.
fn first_size(args: &Args, options: &OpenOptions) -> Option<(usize, usize)> {
    const LOOK_AT: usize = 10;
    let log = net_log::open(&args.log, options).ok()?;
    log.take(LOOK_AT).find_map(|frame| frame.decode().ok()).map(|image| (image.width(), image.height()))
}

fn as_text(info: &LogInfo, size: Option<(usize, usize)>) -> String {
    let mut lines = vec![format!("{}: {}", info.path.display(), info.kind.as_str())];
    let frames = info.frames.map_or_else(|| "not known before reading".into(), |n| n.to_string());
    lines.push(format!("frames    {frames}"));
    if let Some((width, height)) = size {
        lines.push(format!("size      {width}x{height} px"));
    }
    lines.push(format!("times     {}", describe::times(info)));
    if let Some((first, last)) = info.span_ns {
        lines.push(format!("span      {first} to {last} ns: {:.3} s", last.abs_diff(first) as f64 * 1e-9));
    }
    lines.push(format!("camera    {}", camera(info)));
    if let Some(topic) = &info.topic {
        lines.push(format!("topic     {topic}"));
    }
    let images: Vec<_> = info.topics.iter().filter(|t| t.is_image).collect();
    if !images.is_empty() {
        lines.push("image topics:".into());
        lines.extend(images.iter().map(|t| t.option_line()));
    }
    let others: Vec<_> = info.topics.iter().filter(|t| !t.is_image).collect();
    if !others.is_empty() {
        lines.push("other topics:".into());
        lines.extend(others.iter().map(|t| format!("  {} ({} {})", t.name, t.encoding, t.schema)));
    }
    lines.join("\n") + "\n"
}

fn camera(info: &LogInfo) -> String {
    match (&info.camera, &info.camera_file) {
        (Some(found), _) => match &found.camera {
            Ok(camera) => format!("{} (topic {})", describe::camera(camera), found.topic),
            Err(why) => format!("topic {} can't be used: {why}", found.topic),
        },
        (None, Some(file)) => match net_log::read_camera(file) {
            Ok(camera) => format!("{} ({})", describe::camera(&camera), file.display()),
            Err(why) => format!("can't be used: {why}"),
        },
        (None, None) => "none; give one with --camera FILE".into(),
    }
}

fn as_json(info: &LogInfo, size: Option<(usize, usize)>) -> Value {
    let topics: Vec<Value> = info
        .topics
        .iter()
        .map(|t| json!({ "name": t.name, "schema": t.schema, "encoding": t.encoding, "messages": t.messages, "image": t.is_image }))
        .collect();
    json!({
        "path": info.path, "kind": info.kind.as_str(), "frames": info.frames,
        "width": size.map(|s| s.0), "height": size.map(|s| s.1),
        "times": describe::times(info), "first_ns": info.span_ns.map(|s| s.0), "last_ns": info.span_ns.map(|s| s.1),
        "camera": camera(info), "topic": info.topic, "topics": topics,
    })
}
