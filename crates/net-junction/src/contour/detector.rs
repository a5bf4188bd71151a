use net_geometry::nalgebra::Vector2;
use net_geometry::{Junction, JunctionState};
use net_image::GrayView;

use crate::contour::cluster::Clusterer;
use crate::contour::config::{Config, Polarity};
use crate::contour::covering::Covering;
use crate::contour::expectation::{Expectation, ExpectedCell};
use crate::contour::naming::Namer;
use crate::contour::shape::{CellBox, Shaper, Verdict};
use crate::contour::size::SizeField;
use crate::contour::threshold::Threshold;
use crate::contour::trace::Tracer;
use crate::error::{Error, Result};

/// Cell sides, px, that are tried when nothing is expected.
const SIZES_TRIED: [f64; 5] = [7.0, 13.0, 24.0, 44.0, 80.0];

/// Finds junctions in images of one size. Owns all buffers: after the first pictures no memory is allocated.
#[derive(Debug)]
pub struct JunctionDetector {
    config: Config,
    width: usize,
    height: usize,
    threshold: Threshold,
    tracer: Tracer,
    shaper: Shaper,
    accepted: Vec<CellBox>,
    rejected: Vec<CellBox>,
    outlines: Vec<Vector2<f64>>,
    clusterer: Clusterer,
    namer: Namer,
    scratch: Vec<f64>,
    junctions: Vec<Junction>,
}

impl JunctionDetector {
    /// A detector for images of `width` x `height` px.
    ///
    /// # Errors
    /// [`Error::Value`] for a parameter out of range or an empty image.
    pub fn new(width: usize, height: usize, config: &Config) -> Result<Self> {
        config.validate()?;
        for (field, value) in [("width", width), ("height", height)] {
            if value == 0 || value > 1 << 15 {
                return Err(Error::Value { field, value: value as f64, expected: "an image side from 1 to 32768 px" });
            }
        }
        Ok(Self {
            config: config.clone(),
            width,
            height,
            threshold: Threshold::default(),
            tracer: Tracer::default(),
            shaper: Shaper::default(),
            accepted: Vec::new(),
            rejected: Vec::new(),
            outlines: Vec::new(),
            clusterer: Clusterer::default(),
            namer: Namer::default(),
            scratch: Vec::new(),
            junctions: Vec::new(),
        })
    }

    /// Finds the junctions of a picture, in the order of their openings' top-left pixels. Without an expectation the
    /// cells' size is taken from the openings; that costs several times as much and takes more regular nets.
    ///
    /// # Errors
    /// [`Error::ImageSize`] if the image is not of the detector's size, [`Error::Geometry`] if the expectation's camera is for another.
    pub fn detect(&mut self, image: GrayView, expectation: Option<&Expectation>) -> Result<&[Junction]> {
        if (image.width(), image.height()) != (self.width, self.height) {
            return Err(Error::ImageSize {
                width: self.width,
                height: self.height,
                image_width: image.width(),
                image_height: image.height(),
            });
        }
        let net = match expectation {
            Some(Expectation::Net(net)) => Some(net),
            _ => None,
        };
        let mut middle = Vector2::new((self.width - 1) as f64, (self.height - 1) as f64) * 0.5;
        if let Some(net) = net {
            net.camera.check_image_size(self.width as u32, self.height as u32)?;
            middle = Vector2::new(net.camera.cx(), net.camera.cy());
        }
        // 1. The meshes of the net.
        match expectation {
            Some(expectation) => self.find_openings(image, |p| expectation.cell_at(p)),
            None => self.find_openings_of_unknown_size(image),
        }
        // 2. Their corners, to junctions.
        self.clusterer.cluster(&self.accepted, &self.config);
        // 3. Which junction is which.
        let knots = self.clusterer.knots();
        self.namer.name(&self.accepted, knots, self.clusterer.knot_of_corner(), net, middle);
        self.junctions.clear();
        self.junctions.extend(knots.iter().zip(self.namer.names()).map(|(knot, &index)| Junction {
            pixel: knot.pixel,
            index,
            sigma_px: knot.sigma,
            state: JunctionState::Seen,
        }));
        Ok(&self.junctions)
    }

    /// The junctions of the last picture.
    pub fn junctions(&self) -> &[Junction] {
        &self.junctions
    }

    /// The openings of the last picture that were taken for meshes, then, if [`Config::keep_rejected`], the others with the reason.
    pub fn boxes(&self) -> impl Iterator<Item = &CellBox> {
        self.accepted.iter().chain(&self.rejected)
    }

    /// The outline of one of [`Self::boxes`], px; empty unless [`Config::keep_outlines`].
    pub fn outline(&self, found: &CellBox) -> &[Vector2<f64>] {
        let (start, length) = found.outline;
        self.outlines.get(start..start + length).unwrap_or(&[])
    }

    /// The rectangle around all junctions of the last picture; `None` for fewer than three.
    pub fn covering(&self) -> Option<Covering> {
        Covering::of(&self.junctions, self.width, self.height)
    }

    /// The last picture's twine, as the threshold sees it for light (`true`) or dark twine: 255 for twine, 0 for water, row by row.
    pub fn twine_mask(&mut self, light: bool, mask: &mut Vec<u8>) {
        mask.clear();
        let level = self.threshold.level(light);
        for v in 0..level.height() {
            mask.extend(level.row(v).iter().map(|&l| if l >= 0 { 255 } else { 0 }));
        }
    }

    /// Threshold, outlines, shapes, for one or both polarities.
    fn find_openings(&mut self, image: GrayView, cell_at: impl Fn(Vector2<f64>) -> Option<ExpectedCell>) {
        self.accepted.clear();
        self.rejected.clear();
        self.outlines.clear();
        self.threshold.prepare(image, &self.config, |p| cell_at(p).map(|c| c.side()));
        match self.config.polarity {
            Polarity::Light => self.judge_outlines(true, &cell_at),
            Polarity::Dark => self.judge_outlines(false, &cell_at),
            Polarity::Auto => {
                self.judge_outlines(true, &cell_at);
                let light = self.accepted.len();
                self.judge_outlines(false, &cell_at);
                self.settle_polarity(light);
            }
        }
    }

    fn judge_outlines(&mut self, light: bool, cell_at: &impl Fn(Vector2<f64>) -> Option<ExpectedCell>) {
        let Self { config, threshold, tracer, shaper, accepted, rejected, outlines, .. } = self;
        // No mesh has an outline longer than this; the web of twine and open water do.
        let longest = 4 * (self.width + self.height);
        shaper.reserve(longest);
        tracer.trace(threshold.level(light), longest, |outline| {
            let mut found = shaper.judge(&outline, cell_at(outline.middle), light, config);
            let good = found.verdict == Verdict::Accepted;
            if !good && !config.keep_rejected {
                return;
            }
            if config.keep_outlines {
                found.outline = (outlines.len(), outline.crossings.len());
                outlines.extend(outline.pixels());
            }
            if good { accepted.push(found) } else { rejected.push(found) }
        });
    }

    /// Of the first `light` and the other, dark, openings the majority stays; the minority fills in where none of the majority is near.
    fn settle_polarity(&mut self, light: usize) {
        let dark = self.accepted.len() - light;
        if light < dark {
            self.accepted.rotate_left(light);
        }
        let (more, fewer) = (light.max(dark), light.min(dark));
        let mut kept = more;
        for k in more..more + fewer {
            let (majority, rest) = self.accepted.split_at(more);
            let found = &rest[k - more];
            let centre = found.centre();
            let near = majority.iter().any(|m| (m.centre() - centre).norm() < 1.2 * found.spacing);
            if near {
                if self.config.keep_rejected {
                    self.rejected.push(CellBox { verdict: Verdict::OtherPolarity, ..found.clone() });
                }
            } else {
                self.accepted.swap(kept, k);
                kept += 1;
            }
        }
        self.accepted.truncate(kept);
    }

    /// Tries several sizes, fits a plane's sizes to the openings of the best and looks again.
    fn find_openings_of_unknown_size(&mut self, image: GrayView) {
        let mut best: Option<(f64, SizeField)> = None;
        for side in SIZES_TRIED {
            let field = SizeField::uniform(side);
            // Sizes tried lie a factor of 1.8 apart: each takes what lies within two thirds of the way to the next, and tilt.
            self.find_openings(image, |p| field.cell_at(p));
            let covered: f64 = self.accepted.iter().map(|b| b.area).sum();
            if let Some(field) = SizeField::fit(&self.accepted, &mut self.scratch)
                && best.as_ref().is_none_or(|(most, _)| covered > *most)
            {
                best = Some((covered, field));
            }
        }
        let Some((_, field)) = best else {
            self.accepted.clear();
            self.rejected.clear();
            return;
        };
        self.find_openings(image, |p| field.cell_at(p));
        // The openings' own sizes again, now from all over the picture.
        if let Some(field) = SizeField::fit(&self.accepted, &mut self.scratch) {
            self.find_openings(image, |p| field.cell_at(p));
        }
    }
}
