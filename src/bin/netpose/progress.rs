//! Progress on standard error: a bar with rate and remaining time on a terminal, plain lines elsewhere.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

/// How often a plain line is printed.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Counts frames.
#[derive(Debug)]
pub struct Progress {
    bar: Option<ProgressBar>,
    total: Option<u64>,
    done: u64,
    start: Instant,
    last_line: Instant,
}

impl Progress {
    /// `total` frames, where that is known.
    pub fn new(total: Option<u64>) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = total.map_or_else(ProgressBar::no_length, ProgressBar::new);
            let template = if total.is_some() {
                "{bar:30} {pos}/{len} frames, {rate}, {eta} left  {msg}"
            } else {
                "{spinner} {pos} frames, {rate}  {msg}"
            };
            let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            // Four digits behind the point is what the library would print.
            bar.with_style(style.with_key("rate", |state: &ProgressState, to: &mut dyn std::fmt::Write| {
                let _ = write!(to, "{:.1}/s", state.per_sec());
            }))
        });
        let now = Instant::now();
        Self { bar, total, done: 0, start: now, last_line: now }
    }

    /// One frame more; `message` is the run so far in a few words.
    pub fn step(&mut self, message: impl FnOnce() -> String) {
        self.done += 1;
        if let Some(bar) = &self.bar {
            bar.set_message(message());
            bar.inc(1);
        } else if self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            let rate = self.done as f64 / self.start.elapsed().as_secs_f64();
            let of = self.total.map_or_else(String::new, |n| format!("/{n}"));
            let left = self.total.map_or_else(String::new, |n| {
                let seconds = n.saturating_sub(self.done) as f64 / rate;
                format!(", {} left", HumanDuration(Duration::from_secs_f64(seconds)))
            });
            eprintln!("{}{of} frames, {rate:.1}/s{left}  {}", self.done, message());
        }
    }

    /// A line for the user that does not break the bar.
    pub fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
