//! Reading between pixels, changing their kind, remapping.
#![allow(clippy::unwrap_used)]

use net_image::convert::{grey_from_colour, grey8_from_grey16, to_f32, to_u8};
use net_image::{ColourLayout, Error, GrayView, Image, Remap, View, bicubic, bicubic_with_gradient, bilinear};
use proptest::prelude::*;

/// Rounding of `f32` near 1,000.
const ROUNDING: f32 = 2e-3;

fn sampled(width: usize, height: usize, f: impl Fn(f32, f32) -> f32) -> Image<f32> {
    let data = (0..width * height).map(|k| f((k % width) as f32, (k / width) as f32)).collect();
    Image::from_vec(data, width, height).unwrap()
}

proptest! {
    #[test]
    fn bilinear_is_exact_for_bilinear_functions(u in 0.0..19.0, v in 0.0..14.0) {
        let f = |u: f32, v: f32| 3.0 + 2.0 * u - v + 0.5 * u * v;
        let image = sampled(20, 15, f);
        let value = bilinear(image.view().unwrap(), u, v).unwrap();
        prop_assert!((value - f(u as f32, v as f32)).abs() < ROUNDING);
    }

    #[test]
    fn bicubic_is_exact_for_parabolas(u in 1.0..17.0, v in 1.0..12.0) {
        let f = |u: f32, v: f32| 3.0 + 2.0 * u - v + 0.5 * u * v + 0.25 * u * u - 0.125 * v * v;
        let image = sampled(20, 15, f);
        let (value, [du, dv]) = bicubic_with_gradient(image.view().unwrap(), u, v).unwrap();
        let (u, v) = (u as f32, v as f32);
        prop_assert!((value - f(u, v)).abs() < ROUNDING);
        prop_assert!((du - (2.0 + 0.5 * v + 0.5 * u)).abs() < ROUNDING);
        prop_assert!((dv - (-1.0 + 0.5 * u - 0.25 * v)).abs() < ROUNDING);
        prop_assert_eq!(bicubic(image.view().unwrap(), f64::from(u), f64::from(v)).is_some(), true);
    }

    #[test]
    fn sixteen_bits_round_to_the_nearest_eight(x: u16, white in 1u16..) {
        let mut out = Image::default();
        grey8_from_grey16(View::packed(&[x], 1, 1).unwrap(), white, &mut out).unwrap();
        let exact = (255.0 * f64::from(x) / f64::from(white)).min(255.0);
        // Half, and the rounding of f32 where a half is met.
        prop_assert!((f64::from(out.row(0)[0]) - exact).abs() <= 0.5 + 1e-4);
    }
}

#[test]
fn samples_end_at_the_outermost_pixels() {
    let image = sampled(5, 4, |u, v| u + 10.0 * v);
    let view = image.view().unwrap();
    for (u, v) in [(0.0, 0.0), (4.0, 3.0), (4.0, 0.0), (0.0, 3.0), (2.0, 1.0)] {
        assert_eq!(bilinear(view, u, v), Some((u + 10.0 * v) as f32));
        assert_eq!(bicubic(view, u, v), Some((u + 10.0 * v) as f32));
    }
    let beyond = 1e-9;
    for (u, v) in
        [(-beyond, 1.0), (1.0, -beyond), (4.0 + beyond, 1.0), (1.0, 3.0 + beyond), (f64::NAN, 1.0), (1e300, 1.0)]
    {
        assert_eq!(bilinear(view, u, v), None, "({u}, {v})");
        assert_eq!(bicubic(view, u, v), None, "({u}, {v})");
    }
    let one = GrayView::packed(&[9], 1, 1).unwrap();
    assert_eq!((bilinear(one, 0.0, 0.0), bicubic(one, 0.0, 0.0)), (Some(9.0), Some(9.0)));
}

#[test]
fn bytes_and_floats() {
    let floats = View::packed(&[-3.0, 0.4, 0.5, 254.6, 300.0, f32::NAN], 6, 1).unwrap();
    let mut bytes = Image::default();
    to_u8(floats, &mut bytes);
    assert_eq!(bytes.data(), [0, 0, 1, 255, 255, 0]);
    let mut back = Image::default();
    to_f32(bytes.view().unwrap(), &mut back);
    assert_eq!(back.data(), [0.0, 0.0, 1.0, 255.0, 255.0, 0.0]);
}

#[test]
fn white_is_white_and_black_is_black() {
    let mut out = Image::default();
    let image = View::packed(&[0u16, 4095, 4096, 65535], 4, 1).unwrap();
    grey8_from_grey16(image, 4095, &mut out).unwrap();
    assert_eq!(out.data(), [0, 255, 255, 255]);
    grey8_from_grey16(image, 65535, &mut out).unwrap();
    assert_eq!(out.data(), [0, 16, 16, 255]);
    assert!(matches!(grey8_from_grey16(image, 0, &mut out), Err(Error::Value { .. })));
}

#[test]
fn colour_is_weighted_as_bt601() {
    // Reference values: cv2.cvtColor(np.uint8([[[R, G, B]]]), cv2.COLOR_RGB2GRAY), OpenCV 4.
    let colours =
        [([255, 0, 0], 76), ([0, 255, 0], 150), ([0, 0, 255], 29), ([255, 255, 255], 255), ([12, 200, 99], 132)];
    let mut out = Image::default();
    for ([r, g, b], grey) in colours {
        // Two rows of one pixel with a gap between them.
        let layouts: [(ColourLayout, Vec<u8>); 4] = [
            (ColourLayout::Rgb, vec![r, g, b, 9, 9, r, g, b]),
            (ColourLayout::Bgr, vec![b, g, r, 9, 9, b, g, r]),
            (ColourLayout::Rgba, vec![r, g, b, 7, 9, r, g, b, 7]),
            (ColourLayout::Bgra, vec![b, g, r, 7, 9, b, g, r, 7]),
        ];
        for (layout, data) in layouts {
            grey_from_colour(&data, 1, 2, 5, layout, &mut out).unwrap();
            assert_eq!(out.data(), [grey, grey], "{layout:?} {r} {g} {b}");
            assert!(grey_from_colour(&data[1..], 1, 2, 5, layout, &mut out).is_err());
        }
    }
    assert!(grey_from_colour(&[], usize::MAX, 1, usize::MAX, ColourLayout::Rgb, &mut out).is_err());
    assert!(grey_from_colour(&[], 0, 0, 0, ColourLayout::Rgb, &mut out).is_err());
}

#[test]
fn remap_reads_bilinearly() {
    let width = 30;
    let data: Vec<u8> = (0..width * 20).map(|k| (3 * (k % width) + 5 * (k / width)) as u8).collect();
    let image = GrayView::packed(&data, width, 20).unwrap();
    let place = |u: f64, v: f64| (u != 7.0).then_some((0.9 * u + 0.3 * v + 0.53, 0.8 * v + 0.25));
    let remap = Remap::new((36, 24), (width, 20), place).unwrap();
    let mut out = Image::default();
    remap.apply(image, &mut out).unwrap();
    let mut inside = 0;
    for v in 0..24 {
        for u in 0..36 {
            let expected = place(u as f64, v as f64).and_then(|(x, y)| bilinear(image, x, y));
            match expected {
                // Places are rounded to 1/128 px, here worth 8 / 256 grey values, and the value to a half.
                Some(x) if remap.is_inside(u, v) => {
                    inside += 1;
                    assert!((f32::from(out.row(v)[u]) - x).abs() < 0.54, "({u}, {v})");
                }
                Some(_) => panic!("({u}, {v}) was taken for outside"),
                // No place here lies so little outside that rounding brings it in.
                None => assert!(!remap.is_inside(u, v) && out.row(v)[u] == 0, "({u}, {v})"),
            }
        }
    }
    assert!(inside > 400);
    assert_eq!(out.row(3)[7], 0);
    assert!(matches!(remap.apply(image.crop(0, 0, 10, 10).unwrap(), &mut out), Err(Error::SourceSize { .. })));
    assert!(Remap::new((0, 5), (5, 5), |u, v| Some((u, v))).is_err());
    assert!(Remap::new((5, 5), (5, 1 << 20), |u, v| Some((u, v))).is_err());
    let nowhere = Remap::new((2, 2), (width, 20), |_, _| Some((f64::NAN, f64::INFINITY))).unwrap();
    nowhere.apply(image, &mut out).unwrap();
    assert_eq!(out.data(), [0; 4]);
}

#[test]
fn views_refuse_wrong_buffers() {
    assert!(matches!(GrayView::new(&[0; 10], 4, 3, 4), Err(Error::BufferLength { expected: 12, got: 10, .. })));
    assert!(matches!(GrayView::new(&[0; 10], 4, 2, 3), Err(Error::Size { .. })));
    assert!(matches!(GrayView::new(&[], 0, 0, 0), Err(Error::Size { .. })));
    assert!(GrayView::new(&[0; 10], usize::MAX, usize::MAX, usize::MAX).is_err());
    let view = GrayView::new(&[0, 1, 2, 3, 4, 5, 6], 3, 2, 4).unwrap();
    assert_eq!(view.row(1), [4, 5, 6]);
    assert_eq!((view.get(2, 1), view.get(3, 1), view.get(0, 2)), (Some(6), None, None));
    assert_eq!(view.crop(1, 1, 2, 1).unwrap().row(0), [5, 6]);
    assert!(
        view.crop(1, 1, 3, 1).is_none() && view.crop(usize::MAX, 0, 2, 1).is_none() && view.crop(0, 0, 0, 1).is_none()
    );
}
