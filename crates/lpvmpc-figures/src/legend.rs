//! The legend of a figure: rows of samples with their names, between title and panels, where
//! they cannot cover data.

use super::axis::Axes;
use super::figure::{Panel, Style};
use super::font::Font;
use super::panel::{DISC_RADIUS, LABEL_SIZE, LINE_WIDTH, MIDDLE, bounds_in_view};
use super::scene::{Anchor, Color, Rect, Scene, Shape, Stroke, Turn};

/// Width of a sample.
const SAMPLE: f64 = 30.0;
/// From a sample to its name.
const GAP: f64 = 7.0;
/// From a name to the next sample.
const BETWEEN: f64 = 26.0;
/// Height of one row.
const ROW: f64 = 22.0;

/// The entries, each with its width, broken into rows.
pub(super) struct Legend {
    rows: Vec<Vec<(Entry, f64)>>,
}

struct Entry {
    label: String,
    sample: Sample,
}

enum Sample {
    Series { color: Color, style: Style },
    Forbidden,
}

impl Legend {
    /// The legend of `panels` in rows of at most `width`; each name is listed once.
    pub fn of(panels: &[(&Panel, Axes)], font: &Font, width: f64) -> Self {
        let mut rows: Vec<Vec<(Entry, f64)>> = Vec::new();
        for entry in entries(panels) {
            let own = SAMPLE + GAP + font.width(&entry.label, LABEL_SIZE);
            match rows.last_mut() {
                Some(row) if row_width(row) + BETWEEN + own <= width => row.push((entry, own)),
                _ => rows.push(vec![(entry, own)]),
            }
        }
        Self { rows }
    }

    pub fn height(&self) -> f64 {
        self.rows.len() as f64 * ROW
    }

    /// Draws every row centred at `middle`, the first from `top`.
    pub fn draw(&self, middle: f64, top: f64, scene: &mut Scene) {
        for (index, row) in self.rows.iter().enumerate() {
            let y = top + (index as f64 + 0.5) * ROW;
            let mut left = middle - row_width(row) / 2.0;
            for (entry, width) in row {
                entry.draw(left, y, scene);
                left += width + BETWEEN;
            }
        }
    }
}

impl Entry {
    fn draw(&self, left: f64, y: f64, scene: &mut Scene) {
        let right = left + SAMPLE;
        match self.sample {
            Sample::Series { color, style } => {
                if let Style::Line(dash) | Style::Steps(dash) | Style::MarkedLine(dash) = style {
                    let stroke = Stroke {
                        color,
                        width: LINE_WIDTH,
                        dash,
                    };
                    scene.line(vec![(left, y), (right, y)], stroke);
                }
                if let Style::Tiles { .. } = style {
                    let sample = Rect {
                        left,
                        top: y - 6.0,
                        width: SAMPLE,
                        height: 12.0,
                    };
                    scene.rect(sample, color);
                }
                if let Style::Markers | Style::MarkedLine(_) = style {
                    let center = (left + SAMPLE / 2.0, y);
                    scene.shapes.push(Shape::Disc {
                        center,
                        radius: DISC_RADIUS,
                        fill: color,
                    });
                }
            }
            Sample::Forbidden => {
                let area = Rect {
                    left,
                    top: y - 5.0,
                    width: SAMPLE,
                    height: 10.0,
                };
                scene.rect(area, Color::FORBIDDEN);
                let edge = vec![(left, area.bottom()), (right, area.bottom())];
                scene.line(edge, Stroke::solid(Color::BOUND, 1.2));
            }
        }
        let at = (right + GAP, y + MIDDLE * LABEL_SIZE);
        scene.text(&self.label, at, LABEL_SIZE, Anchor::Start, Turn::Upright);
    }
}

fn row_width(row: &[(Entry, f64)]) -> f64 {
    let gaps = row.len().saturating_sub(1) as f64 * BETWEEN;
    row.iter().map(|(_, width)| width).sum::<f64>() + gaps
}

fn entries(panels: &[(&Panel, Axes)]) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for series in panels.iter().flat_map(|(panel, _)| &panel.series) {
        let known = entries.iter().any(|entry| entry.label == series.label);
        if !known && !series.label.is_empty() {
            let sample = Sample::Series {
                color: Color::of(series.role),
                style: series.style,
            };
            entries.push(Entry {
                label: series.label.clone(),
                sample,
            });
        }
    }
    let bounds = |(panel, axes): &(&Panel, Axes)| {
        panel
            .band
            .is_some_and(|band| bounds_in_view(band, &axes.y).iter().any(Option::is_some))
    };
    if panels.iter().any(bounds) {
        entries.push(Entry {
            label: "outside the bounds".to_owned(),
            sample: Sample::Forbidden,
        });
    }
    entries
}
