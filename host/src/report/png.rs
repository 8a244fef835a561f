//! A figure in pixels, by resvg, from the same vectors.

use resvg::{tiny_skia, usvg};

/// Pixels for each of the drawing's own, for screens and print.
const SCALE: f32 = 2.0;

/// The drawing as a PNG file.
///
/// # Errors
/// The text is no SVG, or is too large for memory.
pub fn png(svg: &str) -> Result<Vec<u8>, String> {
    let mut options = usvg::Options::default();
    options.fontdb_mut().load_system_fonts();
    let tree = usvg::Tree::from_str(svg, &options).map_err(|error| error.to_string())?;
    let size = tree.size();
    let (width, height) = ((size.width() * SCALE) as u32, (size.height() * SCALE) as u32);
    let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or("the figure has no size")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}
