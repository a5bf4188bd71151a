//! Filters against their definitions, written naively.
#![allow(clippy::unwrap_used)]

use net_image::{BoxFilter, GaussianBlur, Gradient, GradientKernel, Image, Pixel, Pyramid, View};
use proptest::prelude::*;

/// Rounding of sums of some hundred `f32` near 255.
const ROUNDING: f64 = 1e-3;

/// Noise of a size, deterministic by seed.
fn noise<T: Copy + Default>(width: usize, height: usize, seed: u64, value: impl Fn(u8) -> T) -> Image<T> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let data = (0..width * height)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            value((state >> 56) as u8)
        })
        .collect();
    Image::from_vec(data, width, height).unwrap()
}

/// A pixel of the image that goes on as its outermost pixel.
fn clamped<T: Pixel>(image: View<'_, T>, u: i64, v: i64) -> f64 {
    let u = u.clamp(0, image.width() as i64 - 1) as usize;
    let v = v.clamp(0, image.height() as i64 - 1) as usize;
    f64::from(image.get(u, v).unwrap().to_f32())
}

/// Largest difference to the sum of `weight(du) weight(dv) pixel(u + du, v + dv)`.
fn error_of_separable<T: Pixel>(
    image: View<'_, T>,
    out: &Image<f32>,
    radius: i64,
    weight_u: impl Fn(i64) -> f64,
    weight_v: impl Fn(i64) -> f64,
) -> f64 {
    let mut worst = 0.0f64;
    for v in 0..image.height() {
        for u in 0..image.width() {
            let mut sum = 0.0;
            for dv in -radius..=radius {
                for du in -radius..=radius {
                    sum += weight_u(du) * weight_v(dv) * clamped(image, u as i64 + du, v as i64 + dv);
                }
            }
            worst = worst.max((sum - f64::from(out.row(v)[u])).abs());
        }
    }
    worst
}

fn check_blur<T: Pixel>(image: View<'_, T>, sigma: f64, radius: usize) -> f64 {
    let mut out = Image::default();
    GaussianBlur::with_radius(sigma, radius).unwrap().apply(image, &mut out);
    assert_eq!((out.width(), out.height()), (image.width(), image.height()));
    let raw = |k: i64| (-0.5 * (k as f64 / sigma).powi(2)).exp();
    let sum: f64 = (-(radius as i64)..=radius as i64).map(raw).sum();
    error_of_separable(image, &out, radius as i64, |k| raw(k) / sum, |k| raw(k) / sum)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn blur_is_a_gaussian_sum(width in 1usize..40, height in 1usize..20, sigma in 0.3..4.0, radius in 0usize..9, seed: u64) {
        let bytes = noise(width, height, seed, |x| x);
        let floats = noise(width, height, seed, f32::from);
        prop_assert!(check_blur(bytes.view().unwrap(), sigma, radius) < ROUNDING);
        prop_assert!(check_blur(floats.view().unwrap(), sigma, radius) < ROUNDING);
    }

    #[test]
    fn mean_is_the_mean(width in 1usize..30, height in 1usize..20, radius in 0usize..25, seed: u64) {
        let side = 2.0 * radius as f64 + 1.0;
        let (mut exact, mut rounded) = (Image::default(), Image::default());
        let bytes = noise(width, height, seed, |x| x);
        BoxFilter::new(radius).unwrap().mean(bytes.view().unwrap(), &mut exact);
        let error = error_of_separable(bytes.view().unwrap(), &exact, radius as i64, |_| 1.0 / side, |_| 1.0 / side);
        prop_assert!(error < ROUNDING, "{error}");
        // Running sums of floats do not drift away from those of integers.
        let floats = noise(width, height, seed, f32::from);
        BoxFilter::new(radius).unwrap().mean(floats.view().unwrap(), &mut rounded);
        prop_assert_eq!(exact, rounded);
    }

    #[test]
    fn gradients_are_their_stencils(width in 1usize..30, height in 1usize..20, seed: u64) {
        let image = noise(width, height, seed, |x| x);
        let (mut du, mut dv) = (Image::default(), Image::default());
        for (kernel, side) in [(GradientKernel::Central, 0.0), (GradientKernel::Scharr, 3.0 / 16.0)] {
            Gradient::new(kernel).apply(image.view().unwrap(), &mut du, &mut dv);
            let difference = |k: i64| 0.5 * k as f64;
            let across = |k: i64| if k == 0 { 1.0 - 2.0 * side } else { side };
            prop_assert!(error_of_separable(image.view().unwrap(), &du, 1, difference, across) < ROUNDING);
            prop_assert!(error_of_separable(image.view().unwrap(), &dv, 1, across, difference) < ROUNDING);
        }
    }

    #[test]
    fn pyramid_levels_are_blurred_halves(width in 1usize..40, height in 1usize..40, seed: u64) {
        let image = noise(width, height, seed, |x| x);
        let mut pyramid = Pyramid::new(3);
        pyramid.build(image.view().unwrap(), 1);
        prop_assert_eq!(pyramid.level(0).unwrap().rows().collect::<Vec<_>>(), image.view().unwrap().rows().collect::<Vec<_>>());
        for k in 1..pyramid.len() {
            let (below, level) = (pyramid.level(k - 1).unwrap(), pyramid.level(k).unwrap());
            prop_assert_eq!((level.width(), level.height()), (below.width().div_ceil(2), below.height().div_ceil(2)));
            let weights = [1.0, 4.0, 6.0, 4.0, 1.0];
            for v in 0..level.height() {
                for u in 0..level.width() {
                    let mut sum = 0.0;
                    for (j, wv) in weights.iter().enumerate() {
                        for (i, wu) in weights.iter().enumerate() {
                            sum += wu * wv * clamped(below, 2 * u as i64 + i as i64 - 2, 2 * v as i64 + j as i64 - 2);
                        }
                    }
                    // Rounded to nearest, halves up: exact in binary.
                    prop_assert_eq!(f64::from(level.get(u, v).unwrap()), (sum / 256.0 + 0.5).floor());
                }
            }
        }
        prop_assert!(pyramid.level(pyramid.len()).is_none());
    }
}

#[test]
fn a_crop_is_filtered_as_a_copy_of_it() {
    // Strides: the gap between rows must not leak in.
    let image = noise(37, 23, 5, |x| x);
    let crop = image.view().unwrap().crop(4, 3, 21, 17).unwrap();
    let mut copy = Image::default();
    copy.copy_from(crop);
    let copy = copy.view().unwrap();
    let (mut a, mut b) = (Image::default(), Image::default());
    let mut blur = GaussianBlur::new(1.5).unwrap();
    blur.apply(crop, &mut a);
    blur.apply(copy, &mut b);
    assert_eq!(a, b);
    let mut mean = BoxFilter::new(4).unwrap();
    mean.mean(crop, &mut a);
    mean.mean(copy, &mut b);
    assert_eq!(a, b);
    let (mut one, mut two) = (Pyramid::new(4), Pyramid::new(4));
    one.build(crop, 1);
    two.build(copy, 1);
    for k in 0..one.len() {
        assert!(one.level(k).unwrap().rows().eq(two.level(k).unwrap().rows()));
    }
}

#[test]
fn a_filter_that_met_another_size_first_gives_the_same() {
    let (small, large) = (noise(19, 7, 1, |x| x), noise(50, 33, 2, |x| x));
    let mut used = GaussianBlur::new(2.0).unwrap();
    let (mut a, mut b) = (Image::default(), Image::default());
    used.apply(large.view().unwrap(), &mut a);
    used.apply(small.view().unwrap(), &mut a);
    GaussianBlur::new(2.0).unwrap().apply(small.view().unwrap(), &mut b);
    assert_eq!(a, b);
    let mut used = BoxFilter::new(3).unwrap();
    used.mean(large.view().unwrap(), &mut a);
    used.mean(small.view().unwrap(), &mut a);
    BoxFilter::new(3).unwrap().mean(small.view().unwrap(), &mut b);
    assert_eq!(a, b);
    let (mut used, mut fresh) = (Pyramid::new(5), Pyramid::new(5));
    used.build(large.view().unwrap(), 2);
    used.build(small.view().unwrap(), 2);
    fresh.build(small.view().unwrap(), 2);
    assert_eq!(used.len(), fresh.len());
    for k in 0..used.len() {
        assert!(used.level(k).unwrap().rows().eq(fresh.level(k).unwrap().rows()));
    }
}

#[test]
fn constant_images_stay_constant() {
    let image = View::packed(&[77u8; 31 * 9], 31, 9).unwrap();
    let (mut out, mut other) = (Image::default(), Image::default());
    for sigma in [0.0, 0.5, 3.0, 100.0] {
        GaussianBlur::new(sigma).unwrap().apply(image, &mut out);
        assert!(out.data().iter().all(|x| (x - 77.0).abs() < 1e-4), "sigma {sigma}");
    }
    for radius in [0, 1, 8, 500] {
        BoxFilter::new(radius).unwrap().mean(image, &mut out);
        assert!(out.data().iter().all(|&x| x == 77.0), "radius {radius}");
    }
    Gradient::default().apply(image, &mut out, &mut other);
    assert!(out.data().iter().chain(other.data()).all(|&x| x == 0.0));
    let mut pyramid = Pyramid::new(9);
    pyramid.build(image, 1);
    assert!((0..pyramid.len()).all(|k| pyramid.level(k).unwrap().rows().flatten().all(|&x| x == 77)));
}

#[test]
fn pyramid_stops_where_told() {
    let image = noise(64, 48, 1, |x| x);
    let mut pyramid = Pyramid::new(10);
    assert!(pyramid.is_empty() && pyramid.level(0).is_none());
    pyramid.build(image.view().unwrap(), 12);
    assert_eq!(pyramid.len(), 3);
    pyramid.build(image.view().unwrap(), 1);
    assert_eq!(pyramid.len(), 7, "64x48 down to 1x1");
    pyramid.build(image.view().unwrap(), 0);
    assert_eq!(pyramid.len(), 7, "nothing above 1x1");
    // One bright pixel in an even place stays in its place.
    let mut dot = Image::new(64, 48);
    dot.row_mut(24)[40] = 255u8;
    pyramid.build(dot.view().unwrap(), 1);
    let level = pyramid.level(2).unwrap();
    let brightest = (0..level.height()).flat_map(|v| (0..level.width()).map(move |u| (u, v)));
    assert_eq!(brightest.max_by_key(|&(u, v)| level.get(u, v)), Some((10, 6)));
}

#[test]
fn bad_parameters_are_errors() {
    for sigma in [f64::NAN, -1.0, f64::INFINITY, 1e300] {
        assert!(GaussianBlur::new(sigma).is_err(), "{sigma}");
    }
    assert!(GaussianBlur::with_radius(1.0, usize::MAX).is_err());
    assert!(BoxFilter::<u8>::new(usize::MAX).is_err());
    assert!(GaussianBlur::new(-1.0).unwrap_err().to_string().contains("-1"));
}

#[test]
fn nan_stays_near_where_it_is() {
    let mut image = noise(40, 40, 3, f32::from);
    image.row_mut(20)[20] = f32::NAN;
    let mut out = Image::default();
    GaussianBlur::with_radius(1.0, 3).unwrap().apply(image.view().unwrap(), &mut out);
    for v in 0..40usize {
        for u in 0..40usize {
            assert_eq!(out.row(v)[u].is_nan(), u.abs_diff(20) <= 3 && v.abs_diff(20) <= 3, "({u}, {v})");
        }
    }
}
