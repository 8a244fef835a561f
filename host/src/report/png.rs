//! Rasterises a figure with resvg, from the same SVG.

use resvg::{tiny_skia, usvg};

/// Pixels per pixel of the drawing, for screens and print.
const SCALE: f32 = 2.0;

/// Fonts that contain every character of a figure, including superscripts; otherwise missing ones
/// would come from another font.
const FONTS: &str = "\"DejaVu Sans\",\"Segoe UI\",\"Liberation Sans\",Arial,sans-serif";

/// The drawing as a PNG file.
///
/// # Errors
/// The text is not valid SVG, or the image is too large for memory.
pub fn png(svg: &str) -> Result<Vec<u8>, String> {
    let svg = with_fonts(svg);
    let mut options = usvg::Options::default();
    options.fontdb_mut().load_system_fonts();
    let tree = usvg::Tree::from_str(&svg, &options).map_err(|error| error.to_string())?;
    let size = tree.size();
    let (width, height) = ((size.width() * SCALE) as u32, (size.height() * SCALE) as u32);
    let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or("the figure has no size")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}

/// The same drawing, with [`FONTS`] in its style sheet.
fn with_fonts(svg: &str) -> String {
    let Some(from) = svg.find("font-family:") else { return svg.to_owned() };
    let from = from + "font-family:".len();
    let to = svg[from..].find(['}', ';']).map_or(svg.len(), |end| from + end);
    format!("{}{FONTS}{}", &svg[..from], &svg[to..])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{figures, svg};
    use crate::results::example_tests as example;

    #[test]
    fn every_figure_becomes_a_picture_of_twice_its_size() {
        for figure in figures::all(&example::results()).iter().take(4) {
            let text = svg::file(figure);
            let picture = tiny_skia::Pixmap::decode_png(&png(&text).expect(figure.name)).expect(figure.name);
            assert_eq!(picture.width(), (2.0 * svg::WIDTH) as u32, "{}", figure.name);
            // the background is white; frame, curves and words are not
            let drawn =
                picture.pixels().iter().filter(|p| p.red().min(p.green()).min(p.blue()) < 200).count();
            assert!(drawn > 2_000, "{}: {drawn} dark pixels", figure.name);
        }
        assert!(png("no drawing").is_err());
    }

    #[test]
    fn the_style_names_fonts_with_superscripts() {
        let text = with_fonts("<style>text{fill:#333;font-family:system-ui,Arial}.a{x:1}</style>");
        assert_eq!(text, format!("<style>text{{fill:#333;font-family:{FONTS}}}.a{{x:1}}</style>"));
    }
}
