//! SVG to PNG.

use anyhow::Context;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Draws `svg` so that its longer side is `max_side_px` pixels, and returns the bytes of a PNG file.
///
/// # Errors
/// Returns an error if `svg` cannot be read or `max_side_px` is zero or too large for memory.
pub(crate) fn svg_to_png(svg: &str, max_side_px: u32) -> anyhow::Result<Vec<u8>> {
    let tree = Tree::from_str(svg, &Options::default()).context("picture is not readable SVG")?;
    let (width, height) = (tree.size().width(), tree.size().height());
    let scale = max_side_px as f32 / width.max(height);
    let side = |length: f32| ((length * scale).round() as u32).max(1);
    let mut pixmap = Pixmap::new(side(width), side(height))
        .with_context(|| format!("picture cannot be {max_side_px} pixels wide"))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixmap.as_mut());
    pixmap.encode_png().context("picture cannot be encoded as PNG")
}
