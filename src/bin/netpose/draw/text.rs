//! Text on a picture.

use embedded_graphics::Drawable;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::ascii::{FONT_6X10, FONT_9X18_BOLD};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};

use super::canvas::{Canvas, Colour};

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.width() as u32, self.height() as u32)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = core::convert::Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Self::Error> {
        for Pixel(Point { x, y }, colour) in pixels {
            self.blend(x.into(), y.into(), [colour.r(), colour.g(), colour.b()], 1.0);
        }
        Ok(())
    }
}

/// The larger font where the picture has room for it.
fn font(canvas: &Canvas) -> &'static MonoFont<'static> {
    if canvas.width() >= 640 { &FONT_9X18_BOLD } else { &FONT_6X10 }
}

impl Canvas {
    /// Lines of text along the top of the picture, each letter with a dark edge: between the letters the picture stays as it is.
    pub fn status(&mut self, lines: &[String], colour: Colour) {
        let font = font(self);
        let line_height = font.character_size.height as usize + 2;
        for (k, line) in lines.iter().enumerate() {
            let (u, v) = (6, (4 + k * line_height) as i32);
            for (du, dv) in (-1..=1).flat_map(|du| (-1..=1).map(move |dv| (du, dv))) {
                self.text(u + du, v + dv, line, [0; 3]);
            }
            self.text(u, v, line, colour);
        }
    }

    /// Text whose top-left corner is `(u, v)`.
    pub fn text(&mut self, u: i32, v: i32, text: &str, colour: Colour) {
        let style = MonoTextStyle::new(font(self), Rgb888::new(colour[0], colour[1], colour[2]));
        // Drawing on a canvas cannot fail: its error type has no values.
        let Ok(_) = Text::with_baseline(text, Point::new(u, v), style, Baseline::Top).draw(self);
    }
}
