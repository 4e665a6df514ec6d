//! The built-in font: widths of texts, and their outlines for the PNG.

use super::figure::FigureError;
use super::scene::{Anchor, Text, Turn};
use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder, Rect};

/// Families for the SVG, the built-in one first; the others are of similar width.
pub(super) const FAMILIES: &str = "'DejaVu Sans', Verdana, 'Liberation Sans', Arial, sans-serif";

/// DejaVu Sans.
pub(super) struct Font {
    face: Face<'static>,
}

/// A glyph at its place, in font units.
struct Placed {
    glyph: GlyphId,
    x: f64,
    y: f64,
}

impl Font {
    pub fn load() -> Result<Self, FigureError> {
        let face = Face::parse(dejavu::sans::regular(), 0).map_err(FigureError::Font)?;
        Ok(Self { face })
    }

    /// Width of `text` in pixels.
    pub fn width(&self, text: &str, size: f64) -> f64 {
        self.place(text).1 * self.unit(size)
    }

    /// Outline of `text` in scene coordinates; `None` when it is blank.
    pub fn outline(&self, text: &Text) -> Option<Path> {
        let (glyphs, width) = self.place(&text.content);
        let mut pen = Pen {
            builder: PathBuilder::new(),
            x: 0.0,
            y: 0.0,
        };
        for placed in glyphs {
            (pen.x, pen.y) = (placed.x as f32, placed.y as f32);
            self.face.outline_glyph(placed.glyph, &mut pen);
        }
        let shift = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        let unit = self.unit(text.size) as f32;
        let turn = match text.turn {
            Turn::Upright => 0.0,
            Turn::Upwards => -90.0,
        };
        let place = Transform::from_translate(shift as f32, 0.0)
            .post_scale(unit, -unit)
            .post_rotate(turn)
            .post_translate(text.at.0 as f32, text.at.1 as f32);
        pen.builder.finish()?.transform(place)
    }

    /// Pixels per font unit.
    fn unit(&self, size: f64) -> f64 {
        size / f64::from(self.face.units_per_em())
    }

    /// The glyphs of `text` with their places, and its width, in font units.
    fn place(&self, text: &str) -> (Vec<Placed>, f64) {
        let mut glyphs: Vec<Placed> = Vec::new();
        let mut pen = 0.0;
        for character in text.chars() {
            let glyph = self.face.glyph_index(character).unwrap_or_default();
            if is_mark_above(character) {
                let (x, y) = self.above(glyph, glyphs.last());
                glyphs.push(Placed { glyph, x, y });
            } else {
                glyphs.push(Placed {
                    glyph,
                    x: pen,
                    y: 0.0,
                });
                pen += f64::from(self.face.glyph_hor_advance(glyph).unwrap_or(0));
            }
        }
        (glyphs, pen)
    }

    /// Where `mark` stands centred above `base`.
    fn above(&self, mark: GlyphId, base: Option<&Placed>) -> (f64, f64) {
        let bounds = |glyph| self.face.glyph_bounding_box(glyph);
        let center = |area: Rect| (f64::from(area.x_min) + f64::from(area.x_max)) / 2.0;
        match base.and_then(|base| Some((base, bounds(base.glyph)?, bounds(mark)?))) {
            Some((base, under, over)) => {
                let gap = 0.06 * f64::from(self.face.units_per_em());
                let lift = f64::from(under.y_max) + gap - f64::from(over.y_min);
                (base.x + center(under) - center(over), base.y + lift)
            }
            None => (0.0, 0.0),
        }
    }
}

/// Combining marks (the dot of a time derivative) are placed by hand: there is no shaping here.
fn is_mark_above(character: char) -> bool {
    ('\u{300}'..='\u{314}').contains(&character)
}

/// Collects outlines, each moved to its place.
struct Pen {
    builder: PathBuilder,
    x: f32,
    y: f32,
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.builder.move_to(self.x + x, self.y + y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.builder.line_to(self.x + x, self.y + y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.builder
            .quad_to(self.x + x1, self.y + y1, self.x + x, self.y + y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (px, py) = (self.x, self.y);
        self.builder
            .cubic_to(px + x1, py + y1, px + x2, py + y2, px + x, py + y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_of_the_labels_has_a_glyph() {
        let font = Font::load().unwrap();
        for character in "φθτ\u{307}‖−×·⁰¹²³⁴⁵⁶⁷⁸⁹⁻∞*|[]".chars() {
            assert!(font.face.glyph_index(character).is_some(), "{character}");
        }
    }

    #[test]
    fn a_mark_adds_no_width() {
        let font = Font::load().unwrap();
        assert_eq!(font.width("φ\u{307}", 12.0), font.width("φ", 12.0));
        assert!(font.width("φφ", 12.0) > font.width("φ", 12.0));
    }
}
