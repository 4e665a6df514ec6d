//! Paints a scene as SVG text.

use super::font::FAMILIES;
use super::scene::{Anchor, Color, Point, Scene, Shape, Stroke, Text, Turn};
use std::fmt::{self, Display, Formatter, Write};

/// The whole document; `title` is what a screen reader says.
pub(super) fn document(scene: &Scene, title: &str) -> String {
    let (width, height) = (Number(scene.width), Number(scene.height));
    let mut svg = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\" \
         font-family=\"{FAMILIES}\" fill=\"{}\">",
        Escaped(title),
        Color::TEXT
    );
    let _ = writeln!(
        svg,
        "<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>"
    );
    for shape in &scene.shapes {
        let _ = writeln!(svg, "{}", Element(shape));
    }
    svg.push_str("</svg>\n");
    svg
}

struct Element<'a>(&'a Shape);

impl Display for Element<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.0 {
            Shape::Line { points, stroke } => line(f, points, stroke),
            Shape::Rect { area, fill } => write!(
                f,
                "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{fill}\"/>",
                Number(area.left),
                Number(area.top),
                Number(area.width),
                Number(area.height)
            ),
            Shape::Disc {
                center,
                radius,
                fill,
            } => write!(
                f,
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{fill}\" stroke=\"#ffffff\"/>",
                Number(center.0),
                Number(center.1),
                Number(*radius)
            ),
            Shape::Text(content) => text(f, content),
        }
    }
}

fn line(f: &mut Formatter<'_>, points: &[Point], stroke: &Stroke) -> fmt::Result {
    f.write_str("<path d=\"")?;
    for (index, point) in points.iter().enumerate() {
        let command = if index == 0 { 'M' } else { 'L' };
        write!(f, "{command}{} {}", Number(point.0), Number(point.1))?;
    }
    write!(
        f,
        "\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"",
        stroke.color,
        Number(stroke.width)
    )?;
    if let Some([on, off]) = stroke.pattern() {
        write!(f, " stroke-dasharray=\"{} {}\"", Number(on), Number(off))?;
    }
    f.write_str("/>")
}

fn text(f: &mut Formatter<'_>, text: &Text) -> fmt::Result {
    let (x, y) = (Number(text.at.0), Number(text.at.1));
    write!(
        f,
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\"",
        Number(text.size)
    )?;
    match text.anchor {
        Anchor::Start => {}
        Anchor::Middle => f.write_str(" text-anchor=\"middle\"")?,
        Anchor::End => f.write_str(" text-anchor=\"end\"")?,
    }
    if text.turn == Turn::Upwards {
        write!(f, " transform=\"rotate(-90 {x} {y})\"")?;
    }
    write!(f, ">{}</text>", Escaped(&text.content))
}

impl Display for Color {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

/// A length to a hundredth of a pixel, as short as it goes.
struct Number(f64);

impl Display for Number {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // Adding zero turns the negative zero into the positive one.
        let rounded = (self.0 * 100.0).round() / 100.0 + 0.0;
        write!(f, "{rounded}")
    }
}

/// Text with the characters of markup replaced, and those that XML 1.0 forbids left out.
struct Escaped<'a>(&'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for character in self.0.chars() {
            match character {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\t' | '\n' | '\r' => f.write_char(' ')?,
                '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => {}
                other => f.write_char(other)?,
            }
        }
        Ok(())
    }
}
