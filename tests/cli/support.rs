//! Logs made on the spot, and the program run on them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder that goes away with the test.
pub struct Scratch(TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file, with the folders that lead to it.
    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("below the scratch folder")).expect("a folder");
        std::fs::write(&path, contents).expect("a file");
        path
    }

    /// An image log `log/` of `frames` grey pictures with times 0.1 s apart, and `camera.yaml` beside it.
    pub fn image_log(&self, frames: u64, width: u32, height: u32) -> PathBuf {
        let mut times = String::from("file,timestamp_ns\n");
        for k in 0..frames {
            self.write(&format!("log/f{k:03}.png"), png(width, height, k as u8));
            times += &format!("f{k:03}.png,{}\n", 1_700_000_000_000_000_000 + k * 100_000_000);
        }
        self.write("log/timestamps.csv", times);
        self.camera(width, height);
        self.path("log")
    }

    /// `camera.yaml` for pictures of this size.
    pub fn camera(&self, width: u32, height: u32) -> PathBuf {
        let (fx, cx, cy) = (0.7 * f64::from(width), f64::from(width) / 2.0, f64::from(height) / 2.0);
        self.write(
            "camera.yaml",
            format!(
                "image_width: {width}\nimage_height: {height}\ncamera_name: test\n\
                 camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{fx}, 0, {cx}, 0, {fx}, {cy}, 0, 0, 1]\n\
                 distortion_model: plumb_bob\n\
                 distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
            ),
        )
    }

    /// `netpose run log --camera camera.yaml --cell 50mm --out out`, and what else is given.
    pub fn run(&self, more: &[&str]) -> Output {
        let (log, out, camera) = (self.path("log"), self.path("out"), self.path("camera.yaml"));
        netpose()
            .arg("run")
            .arg(log)
            .arg("--out")
            .arg(out)
            .arg("--camera")
            .arg(camera)
            .args(["--cell", "50mm"])
            .args(more)
            .output()
            .expect("netpose starts")
    }

    /// Rows of `out/poses.csv` without the header, each cell by cell.
    pub fn poses(&self) -> Vec<Vec<String>> {
        let text = std::fs::read_to_string(self.path("out/poses.csv")).expect("poses.csv");
        assert!(text.ends_with('\n'), "a row was cut off");
        text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
    }

    /// `out/run.json`.
    pub fn record(&self) -> serde_json::Value {
        read_json(&self.path("out/run.json"))
    }
}

/// The status column of a row of `poses.csv`.
pub const STATUS: usize = 3;

pub fn netpose() -> Command {
    Command::new(env!("CARGO_BIN_EXE_netpose"))
}

pub fn read_json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a file")).expect("JSON")
}

/// A textured grey picture, different for every seed.
pub fn pixels(width: u32, height: u32, seed: u8) -> Vec<u8> {
    (0..width * height).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8 ^ seed).collect()
}

pub fn png(width: u32, height: u32, seed: u8) -> Vec<u8> {
    encode(&pixels(width, height, seed), width, height, image::ExtendedColorType::L8)
}

/// A PNG of any pixel type.
pub fn encode(pixels: &[u8], width: u32, height: u32, kind: image::ExtendedColorType) -> Vec<u8> {
    use image::ImageEncoder;
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes).write_image(pixels, width, height, kind).expect("a picture");
    bytes
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The exit status, with what was said on standard error if it is another.
pub fn assert_status(output: &Output, expected: i32) {
    assert_eq!(output.status.code(), Some(expected), "{}{}", stdout(output), stderr(output));
}

/// That standard error says all of these.
pub fn assert_says(output: &Output, words: &[&str]) {
    let said = stderr(output);
    for word in words {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
}
