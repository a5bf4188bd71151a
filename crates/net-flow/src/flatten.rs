//! Stage 0: the light's slow changes taken away.
//!
//! Shading, backscatter and vignette stay with the camera while the net moves. Inside a template they correlate perfectly with themselves at no
//! motion at all, and where twines are faint they win. Less its local mean the picture is the net's.

use net_image::{BoxFilter, GrayView, Image};

use crate::error::Result;

/// Takes the local mean away. Owns its buffers.
#[derive(Debug)]
pub(crate) struct Flatten {
    filter: Option<BoxFilter<u8>>,
    mean: Image<f32>,
    flat: Image<u8>,
}

impl Flatten {
    /// Means over `2 radius_px + 1` px squared; with radius 0 pictures stay as they are.
    pub(crate) fn new(radius_px: usize) -> Result<Self> {
        let filter = if radius_px > 0 { Some(BoxFilter::new(radius_px)?) } else { None };
        Ok(Self { filter, mean: Image::default(), flat: Image::default() })
    }

    /// The picture less its local mean, about grey 128.
    pub(crate) fn apply<'a>(&'a mut self, view: GrayView<'a>) -> GrayView<'a> {
        let Some(filter) = &mut self.filter else { return view };
        filter.mean(view, &mut self.mean);
        self.flat.resize(view.width(), view.height());
        for (v, source) in view.rows().enumerate() {
            let mean = self.mean.row(v);
            for ((out, &x), &m) in self.flat.row_mut(v).iter_mut().zip(source).zip(mean) {
                // Contrasts of more than 127 levels are cut off. Adding 2^23 leaves the rounded number in the low bits.
                let value = (f32::from(x) - m + 128.0).clamp(0.0, 255.0) + 8_388_608.0;
                *out = value.to_bits() as u8;
            }
        }
        self.flat.view().unwrap_or(view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_vanishes_and_a_twine_stays() {
        let data: Vec<u8> = (0..90 * 60).map(|i| (i % 90) as u8 * 2 + if i % 90 == 45 { 40 } else { 0 }).collect();
        let view = GrayView::packed(&data, 90, 60).expect("a view");
        let mut flatten = Flatten::new(10).expect("a radius");
        let flat = flatten.apply(view);
        // Far from edges and twine nothing is left of the slope; the twine keeps its 40 levels less its own share of the mean (1/21).
        assert!(flat.row(30)[20].abs_diff(128) <= 1);
        assert!(flat.row(30)[45].abs_diff(128 + 38) <= 1);
    }
}
