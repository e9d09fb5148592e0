//! The font of all pictures: Inter, regular and semi-bold, cut down to the letters that pictures use.
//!
//! The files in `assets/` hold Latin, Greek and a few signs, without kerning and ligatures, so that
//! the width of a text is the sum of its letters' advances. `docs/decisions/0010-text-in-pictures.md`
//! says why there is a font at all.

use std::sync::{Arc, OnceLock};

use resvg::usvg::fontdb::Database;
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

/// The families that an SVG asks for, best first: without Inter, what the reader's system uses.
pub(crate) const FAMILY: &str = "Inter, system-ui, sans-serif";

const REGULAR: &[u8] = include_bytes!("../assets/Inter-Regular.otf");
const SEMI_BOLD: &[u8] = include_bytes!("../assets/Inter-SemiBold.otf");

/// How heavy letters are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    Regular,
    SemiBold,
}

impl Weight {
    /// The number that CSS has for it.
    pub(crate) const fn css(self) -> &'static str {
        match self {
            Self::Regular => "400",
            Self::SemiBold => "600",
        }
    }

    const fn file(self) -> &'static [u8] {
        match self {
            Self::Regular => REGULAR,
            Self::SemiBold => SEMI_BOLD,
        }
    }
}

/// Width of `text` in `weight` at `size`, in the unit of `size`.
///
/// A letter that the font lacks counts as its box for unknown letters.
pub(crate) fn width(text: &str, size: f64, weight: Weight) -> f64 {
    let font = FontRef::new(weight.file()).expect("the embedded font is sound");
    let (letters, at) = (font.charmap(), (Size::unscaled(), LocationRef::default()));
    let metrics = font.glyph_metrics(at.0, at.1);
    let em = f64::from(font.metrics(at.0, at.1).units_per_em);
    let advance = |letter| metrics.advance_width(letters.map(letter).unwrap_or_default()).unwrap_or_default();
    text.chars().map(|letter| f64::from(advance(letter))).sum::<f64>() / em * size
}

/// The embedded files for resvg, which then draws text as the SVG asks for it.
pub(crate) fn database() -> Arc<Database> {
    static DATABASE: OnceLock<Arc<Database>> = OnceLock::new();
    let load = || {
        let mut database = Database::new();
        for weight in [Weight::Regular, Weight::SemiBold] {
            database.load_font_data(weight.file().to_vec());
        }
        database.set_sans_serif_family("Inter");
        Arc::new(database)
    };
    Arc::clone(DATABASE.get_or_init(load))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_add_up_and_grow_with_weight() {
        let regular = |text: &str, size: f64| width(text, size, Weight::Regular);
        let parts = regular("SHARP ", 11.0) + regular("interface", 11.0);
        assert!((regular("SHARP interface", 11.0) - parts).abs() < 1e-9, "no kerning");
        assert!((regular("x", 20.0) - 2.0 * regular("x", 10.0)).abs() < 1e-9, "in proportion");
        assert!(width("title", 13.0, Weight::SemiBold) > regular("title", 13.0));
        assert_eq!(regular("", 11.0), 0.0);
    }

    #[test]
    fn every_letter_that_reports_use_is_in_both_files() {
        for weight in [Weight::Regular, Weight::SemiBold] {
            let font = FontRef::new(weight.file()).expect("a font");
            for letter in (' '..='~').chain("×±°µ–—≤≥→₀₉σφπ".chars()) {
                assert!(font.charmap().map(letter).is_some(), "{letter:?} in {weight:?}");
            }
        }
    }

    #[test]
    fn both_weights_are_one_family() {
        let names: Vec<(String, u16)> =
            database().faces().map(|face| (face.families[0].0.clone(), face.weight.0)).collect();
        assert_eq!(names, [("Inter".into(), 400), ("Inter".into(), 600)]);
    }
}
