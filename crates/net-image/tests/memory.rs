//! Nothing is allocated once a filter has met the size of an image.
#![allow(clippy::unwrap_used)]

use net_image::convert::{grey_from_colour, grey8_from_grey16, to_f32, to_u8};
use net_image::{BoxFilter, ColourLayout, GaussianBlur, Gradient, GrayView, Image, Pyramid, Remap, View};

#[test]
fn the_second_image_allocates_nothing() {
    let (width, height) = (61, 43);
    let data: Vec<u8> = (0..width * height).map(|k| (k * 37 % 251) as u8).collect();
    let colour = vec![9; 3 * width * height];
    let deep = vec![999u16; width * height];
    let image = GrayView::packed(&data, width, height).unwrap();

    let mut blur = GaussianBlur::new(1.5).unwrap();
    let mut mean = BoxFilter::new(4).unwrap();
    let (mut gradient, mut pyramid) = (Gradient::default(), Pyramid::new(4));
    let remap = Remap::new((width, height), (width, height), |u, v| Some((v, u))).unwrap();
    let (mut a, mut b, mut bytes) = (Image::default(), Image::default(), Image::default());
    let mut frame = || {
        blur.apply(image, &mut a);
        mean.mean(image, &mut b);
        to_u8(a.view().unwrap(), &mut bytes);
        gradient.apply(image, &mut a, &mut b);
        pyramid.build(image, 1);
        to_f32(image, &mut a);
        grey_from_colour(&colour, width, height, 3 * width, ColourLayout::Bgr, &mut bytes).unwrap();
        grey8_from_grey16(View::packed(&deep, width, height).unwrap(), 4095, &mut bytes).unwrap();
        remap.apply(image, &mut bytes).unwrap();
    };
    frame();
    let allocations = allocation_counter::measure(&mut frame);
    assert_eq!(allocations.count_total, 0);
    assert_eq!(pyramid.len(), 4);
}
