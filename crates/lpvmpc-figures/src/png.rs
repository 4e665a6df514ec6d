//! Paints a scene as a PNG.

use super::figure::FigureError;
use super::font::Font;
use super::scene::{Color, Point, Scene, Shape, Stroke};
use tiny_skia::{FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform};

const LONGEST_SIDE: f64 = 20_000.0;

/// The PNG with `scale` pixels per pixel of the scene.
pub(super) fn encode(scene: &Scene, scale: f64) -> Result<Vec<u8>, FigureError> {
    let size = [scene.width, scene.height].map(|side| (side * scale).round());
    let [width, height] = size;
    let unusable = || FigureError::PngSize { width, height };
    if !size.iter().all(|side| (1.0..=LONGEST_SIDE).contains(side)) {
        return Err(unusable());
    }
    let mut pixmap = Pixmap::new(width as u32, height as u32).ok_or_else(unusable)?;
    pixmap.fill(tiny_skia::Color::WHITE);
    let mut painter = Painter {
        pixmap,
        font: Font::load()?,
        transform: Transform::from_scale(scale as f32, scale as f32),
    };
    for shape in &scene.shapes {
        painter.paint(shape);
    }
    painter
        .pixmap
        .encode_png()
        .map_err(|error| FigureError::Encode(error.to_string()))
}

struct Painter {
    pixmap: Pixmap,
    font: Font,
    transform: Transform,
}

impl Painter {
    /// Shapes without extent have no path, and leave no mark.
    fn paint(&mut self, shape: &Shape) {
        match shape {
            Shape::Line { points, stroke } => {
                if let Some(path) = polyline(points) {
                    self.stroke(&path, stroke);
                }
            }
            Shape::Rect { area, fill } => {
                let [x, y, w, h] =
                    [area.left, area.top, area.width, area.height].map(|value| value as f32);
                if let Some(rect) = tiny_skia::Rect::from_xywh(x, y, w, h) {
                    self.pixmap
                        .fill_rect(rect, &paint(*fill), self.transform, None);
                }
            }
            Shape::Disc {
                center,
                radius,
                fill,
            } => {
                let (x, y) = (center.0 as f32, center.1 as f32);
                if let Some(path) = PathBuilder::from_circle(x, y, *radius as f32) {
                    self.fill(&path, *fill);
                    self.stroke(&path, &Stroke::solid(Color(255, 255, 255), 1.0));
                }
            }
            Shape::Text(text) => {
                if let Some(path) = self.font.outline(text) {
                    self.fill(&path, Color::TEXT);
                }
            }
        }
    }

    fn fill(&mut self, path: &Path, color: Color) {
        self.pixmap
            .fill_path(path, &paint(color), FillRule::Winding, self.transform, None);
    }

    fn stroke(&mut self, path: &Path, stroke: &Stroke) {
        let style = tiny_skia::Stroke {
            width: stroke.width as f32,
            line_join: LineJoin::Round,
            dash: stroke
                .pattern()
                .and_then(|[on, off]| StrokeDash::new(vec![on as f32, off as f32], 0.0)),
            ..tiny_skia::Stroke::default()
        };
        self.pixmap
            .stroke_path(path, &paint(stroke.color), &style, self.transform, None);
    }
}

fn polyline(points: &[Point]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, point) in points.iter().enumerate() {
        let (x, y) = (point.0 as f32, point.1 as f32);
        if index == 0 {
            builder.move_to(x, y);
        } else {
            builder.line_to(x, y);
        }
    }
    builder.finish()
}

fn paint(color: Color) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(color.0, color.1, color.2, 255);
    paint
}
