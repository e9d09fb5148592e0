//! SVG to PNG.

use png::{ColorType, Compression, Encoder, EncodingError};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

use crate::font;

/// Why a picture cannot become pixels.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PngError {
    /// The document is no SVG.
    #[error("picture is not readable SVG: {0}")]
    Unreadable(String),
    /// There is no picture of this size.
    #[error("picture cannot be {max_side_px} pixels wide, expected a number from 1 on that fits in memory")]
    Size {
        /// Longer side that was asked for, pixels.
        max_side_px: u32,
    },
    /// The pixels cannot be written as PNG.
    #[error("picture cannot be encoded as PNG: {0}")]
    Encoding(String),
}

/// Draws `svg` so that its longer side is `max_side_px` pixels, and returns the bytes of a PNG file.
///
/// Text is drawn in the embedded font, whatever fonts the machine has; files and addresses that the
/// document names are not read.
///
/// # Errors
/// Returns an error if `svg` cannot be read or `max_side_px` is zero or too large for memory.
pub fn svg_to_png(svg: &str, max_side_px: u32) -> Result<Vec<u8>, PngError> {
    let options = Options { fontdb: font::database(), ..Options::default() };
    let tree = Tree::from_str(svg, &options).map_err(|error| PngError::Unreadable(error.to_string()))?;
    let (width, height) = (tree.size().width(), tree.size().height());
    let scale = max_side_px as f32 / width.max(height);
    let side = |length: f32| ((length * scale).round() as u32).max(1);
    let pixmap = (max_side_px > 0).then(|| Pixmap::new(side(width), side(height)));
    let mut pixmap = pixmap.flatten().ok_or(PngError::Size { max_side_px })?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixmap.as_mut());
    encode(pixmap).map_err(|error| PngError::Encoding(error.to_string()))
}

/// The bytes of a PNG file, packed fast: a picture is made for every plan, and tiny-skia's own packing takes longer than
/// drawing it.
fn encode(pixmap: Pixmap) -> Result<Vec<u8>, EncodingError> {
    let (width, height) = (pixmap.width(), pixmap.height());
    let rgba = pixmap.take_demultiplied();
    let is_opaque = rgba.iter().skip(3).step_by(4).all(|&alpha| alpha == u8::MAX);
    let pixels =
        if is_opaque { rgba.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect() } else { rgba };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(if is_opaque { ColorType::Rgb } else { ColorType::Rgba });
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_keep_their_colors_and_what_is_seen_through() {
        let picture = |fill: &str| {
            let svg = format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"4\" height=\"2\">\
                 <rect width=\"4\" height=\"2\" {fill}/></svg>"
            );
            let png = svg_to_png(&svg, 4).expect("a picture");
            image::load_from_memory(&png).expect("a PNG")
        };
        let opaque = picture("fill=\"#ff8000\"");
        assert_eq!((opaque.width(), opaque.height(), opaque.color()), (4, 2, image::ColorType::Rgb8));
        assert_eq!(opaque.to_rgb8().get_pixel(3, 1).0, [255, 128, 0]);
        let pane = picture("fill=\"#ff0000\" fill-opacity=\"0.5\"");
        assert_eq!(pane.color(), image::ColorType::Rgba8);
        let [red, .., alpha] = pane.to_rgba8().get_pixel(3, 1).0;
        assert!(red > 250 && (126..=129).contains(&alpha), "{red} {alpha}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert!(matches!(svg_to_png("<svg", 10), Err(PngError::Unreadable(_))));
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"4\" height=\"2\"/>";
        assert_eq!(svg_to_png(svg, 0), Err(PngError::Size { max_side_px: 0 }));
        assert_eq!(svg_to_png(svg, u32::MAX), Err(PngError::Size { max_side_px: u32::MAX }));
    }
}
