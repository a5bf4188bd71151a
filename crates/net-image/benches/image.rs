//! Time of each operation on a picture of 848 x 480 px.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, criterion_group, criterion_main};
use net_image::convert::{grey_from_colour, to_f32};
use net_image::{
    BoxFilter, ColourLayout, GaussianBlur, Gradient, GrayView, Image, Pyramid, Remap, bicubic_with_gradient, bilinear,
};

const SIZE: (usize, usize) = (848, 480);

fn operations(c: &mut Criterion) {
    let (width, height) = SIZE;
    let data: Vec<u8> = (0..width * height).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let image = GrayView::packed(&data, width, height).unwrap();
    let (mut out, mut other, mut bytes) = (Image::default(), Image::default(), Image::default());

    for sigma in [1.0, 3.0, 10.0] {
        let mut blur = GaussianBlur::new(sigma).unwrap();
        c.bench_function(&format!("blur, sigma {sigma}"), |b| b.iter(|| blur.apply(image, &mut out)));
    }
    for radius in [3, 30] {
        let mut mean = BoxFilter::new(radius).unwrap();
        c.bench_function(&format!("mean, radius {radius}"), |b| b.iter(|| mean.mean(image, &mut out)));
    }
    let mut pyramid = Pyramid::new(5);
    c.bench_function("pyramid, 5 levels", |b| b.iter(|| pyramid.build(image, 1)));
    let mut gradient = Gradient::default();
    c.bench_function("gradient", |b| b.iter(|| gradient.apply(image, &mut out, &mut other)));
    c.bench_function("to f32", |b| b.iter(|| to_f32(image, &mut out)));
    let colour = vec![77; 3 * width * height];
    c.bench_function("grey from colour", |b| {
        b.iter(|| grey_from_colour(&colour, width, height, 3 * width, ColourLayout::Rgb, &mut bytes))
    });
    let remap = Remap::new(SIZE, SIZE, |u, v| Some((0.99 * u + 0.3, 0.99 * v + 0.7))).unwrap();
    c.bench_function("remap", |b| b.iter(|| remap.apply(image, &mut bytes)));
    let places = || (0..1000).map(|k| (0.7 * f64::from(k) + 1.3, 0.4 * f64::from(k) + 2.7));
    c.bench_function("bilinear, 1000 places", |b| {
        b.iter(|| places().filter_map(|(u, v)| bilinear(image, u, v)).sum::<f32>())
    });
    c.bench_function("bicubic with gradient, 1000 places", |b| {
        b.iter(|| {
            places()
                .filter_map(|(u, v)| bicubic_with_gradient(image, u, v))
                .map(|(x, [du, dv])| x + du + dv)
                .sum::<f32>()
        })
    });
}

criterion_group!(benches, operations);
criterion_main!(benches);
