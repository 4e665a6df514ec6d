//! Draws one panel into its area.

use super::axis::{Axes, Axis};
use super::figure::{Band, Dash, Panel, Scale, Series, Style};
use super::font::Font;
use super::scene::{Anchor, Color, Point, Rect, Scene, Shape, Stroke, Turn};
use super::ticks::{Ticks, common_power, power_label};

pub(super) const TICK_SIZE: f64 = 12.0;
pub(super) const LABEL_SIZE: f64 = 13.0;
pub(super) const LINE_WIDTH: f64 = 1.6;
pub(super) const DISC_RADIUS: f64 = 3.6;
/// From the frame to the labels of the ticks.
pub(super) const TICK_GAP: f64 = 8.0;
/// From the middle of a text to its baseline, as part of its size.
pub(super) const MIDDLE: f64 = 0.36;
const TICK_LENGTH: f64 = 4.0;
/// Tiles reach so far over the next ones, in pixels, that no background shows between them.
const OVERLAP: f64 = 0.5;
/// Deviations below this, in pixels, are not drawn.
const RESOLUTION: f64 = 0.1;

/// A panel with what the layout has settled about it.
pub(super) struct Placed<'a> {
    pub panel: &'a Panel,
    pub axes: Axes,
    pub y_ticks: Ticks,
    /// Inside of the frame.
    pub area: Rect,
    /// From the frame leftwards to the middle of the vertical label.
    pub label_distance: f64,
    /// Its name in the figure, where there are several.
    pub letter: Option<char>,
    /// From the frame leftwards to the letter.
    pub letter_distance: f64,
    pub has_x_label: bool,
}

impl Placed<'_> {
    pub fn draw(&self, font: &Font, scene: &mut Scene) {
        let x_ticks = self.x_ticks(font);
        self.draw_forbidden(scene);
        self.draw_grid(&x_ticks, scene);
        self.draw_bounds(scene);
        for series in &self.panel.series {
            self.draw_series(series, scene);
        }
        self.draw_frame(scene);
        self.draw_x_axis(&x_ticks, scene);
        self.draw_y_axis(scene);
    }

    /// As many ticks as have room for their labels.
    fn x_ticks(&self, font: &Font) -> Ticks {
        let whole = self
            .panel
            .series
            .iter()
            .flat_map(|series| &series.x)
            .all(|x| x.fract() == 0.0);
        let most = (self.area.width / 45.0) as usize;
        let ticks = |count| Ticks::of(&self.axes.x, count, whole);
        let fits = |ticks: &Ticks| {
            let widest = widest(font, ticks) + TICK_SIZE;
            ticks
                .labelled
                .windows(2)
                .all(|pair| self.x(pair[1].0) - self.x(pair[0].0) >= widest)
        };
        (2..=most)
            .rev()
            .map(ticks)
            .find(fits)
            .unwrap_or_else(|| ticks(2))
    }

    fn x(&self, value: f64) -> f64 {
        self.area.left + self.axes.x.fraction(value) * self.area.width
    }

    fn y(&self, value: f64) -> f64 {
        self.area.bottom() - self.axes.y.fraction(value) * self.area.height
    }

    fn draw_forbidden(&self, scene: &mut Scene) {
        let Some(band) = self.panel.band else { return };
        let [below, above] = bounds_in_view(band, &self.axes.y);
        let mut shade = |top: f64, bottom: f64| {
            let height = bottom - top;
            scene.rect(
                Rect {
                    top,
                    height,
                    ..self.area
                },
                Color::FORBIDDEN,
            );
        };
        if let Some(bound) = below {
            shade(self.y(bound), self.area.bottom());
        }
        if let Some(bound) = above {
            shade(self.area.top, self.y(bound));
        }
    }

    fn draw_bounds(&self, scene: &mut Scene) {
        let Some(band) = self.panel.band else { return };
        for bound in bounds_in_view(band, &self.axes.y).into_iter().flatten() {
            self.horizontal(self.y(bound), Stroke::solid(Color::BOUND, 1.2), scene);
        }
    }

    fn draw_grid(&self, x_ticks: &Ticks, scene: &mut Scene) {
        let stroke = Stroke::solid(Color::GRID, 0.8);
        for (value, _) in &x_ticks.labelled {
            let x = self.x(*value);
            scene.line(vec![(x, self.area.top), (x, self.area.bottom())], stroke);
        }
        for (value, _) in &self.y_ticks.labelled {
            self.horizontal(self.y(*value), stroke, scene);
        }
    }

    fn horizontal(&self, y: f64, stroke: Stroke, scene: &mut Scene) {
        scene.line(vec![(self.area.left, y), (self.area.right(), y)], stroke);
    }

    fn draw_series(&self, series: &Series, scene: &mut Scene) {
        let points: Vec<Point> = series
            .points()
            .map(|(x, y)| (self.x(x), self.y(y)))
            .collect();
        let fill = Color::of(series.role);
        let mut lines = |points: &[Point], dash: Dash| {
            let stroke = Stroke {
                color: fill,
                width: LINE_WIDTH,
                dash,
            };
            for run in points.split(|(x, y)| !(x.is_finite() && y.is_finite())) {
                for piece in clipped(&simplified(run), &self.area) {
                    scene.line(piece, stroke);
                }
            }
        };
        match series.style {
            Style::Line(dash) | Style::MarkedLine(dash) => lines(&points, dash),
            Style::Steps(dash) => lines(&held(&points), dash),
            Style::Markers => {}
            Style::Tiles { columns, rows } => {
                let width = self.area.width / f64::from(columns.max(1));
                let height = self.area.height / f64::from(rows.max(1));
                for (x, y) in points.iter().filter(|point| self.area.contains(**point)) {
                    let left = (x - width / 2.0).max(self.area.left);
                    let top = (y - height / 2.0).max(self.area.top);
                    let tile = Rect {
                        left,
                        top,
                        width: (x + width / 2.0 + OVERLAP).min(self.area.right()) - left,
                        height: (y + height / 2.0 + OVERLAP).min(self.area.bottom()) - top,
                    };
                    scene.rect(tile, fill);
                }
                return;
            }
        }
        let has_discs = matches!(series.style, Style::Markers | Style::MarkedLine(_));
        for (index, center) in points.iter().enumerate() {
            let alone = !has_discs && is_alone(&points, index);
            if (has_discs || alone) && self.area.contains(*center) {
                let radius = if alone { LINE_WIDTH } else { DISC_RADIUS };
                scene.shapes.push(Shape::Disc {
                    center: *center,
                    radius,
                    fill,
                });
            }
        }
    }

    fn draw_frame(&self, scene: &mut Scene) {
        let Rect { left, top, .. } = self.area;
        let (right, bottom) = (self.area.right(), self.area.bottom());
        let corners = vec![
            (left, top),
            (right, top),
            (right, bottom),
            (left, bottom),
            (left, top),
        ];
        scene.line(corners, Stroke::solid(Color::FRAME, 1.0));
        let middle = left + self.area.width / 2.0;
        let above = top - 7.0;
        if let Some(letter) = self.letter {
            let at = (left - self.letter_distance, above);
            let text = format!("({letter})");
            scene.text(&text, at, LABEL_SIZE, Anchor::Start, Turn::Upright);
        }
        scene.text(
            &self.panel.title,
            (middle, above),
            LABEL_SIZE,
            Anchor::Middle,
            Turn::Upright,
        );
    }

    fn draw_x_axis(&self, ticks: &Ticks, scene: &mut Scene) {
        let bottom = self.area.bottom();
        let stroke = Stroke::solid(Color::FRAME, 1.0);
        let baseline = bottom + TICK_GAP + 0.8 * TICK_SIZE;
        for (value, label) in &ticks.labelled {
            let x = self.x(*value);
            scene.line(vec![(x, bottom), (x, bottom + TICK_LENGTH)], stroke);
            scene.text(
                label,
                (x, baseline),
                TICK_SIZE,
                Anchor::Middle,
                Turn::Upright,
            );
        }
        if let Some(power) = common_power(&self.axes.x) {
            let at = (self.area.right(), baseline + 1.3 * TICK_SIZE);
            scene.text(
                &power_label(power),
                at,
                TICK_SIZE,
                Anchor::End,
                Turn::Upright,
            );
        }
        if self.has_x_label {
            let at = (
                self.area.left + self.area.width / 2.0,
                baseline + 1.5 * LABEL_SIZE,
            );
            scene.text(
                &self.panel.x_label,
                at,
                LABEL_SIZE,
                Anchor::Middle,
                Turn::Upright,
            );
        }
    }

    fn draw_y_axis(&self, scene: &mut Scene) {
        let left = self.area.left;
        let stroke = Stroke::solid(Color::FRAME, 1.0);
        for (value, label) in &self.y_ticks.labelled {
            let y = self.y(*value);
            scene.line(vec![(left - TICK_LENGTH, y), (left, y)], stroke);
            let at = (left - TICK_GAP, y + MIDDLE * TICK_SIZE);
            scene.text(label, at, TICK_SIZE, Anchor::End, Turn::Upright);
        }
        for value in &self.y_ticks.minor {
            let y = self.y(*value);
            scene.line(vec![(left - TICK_LENGTH / 2.0, y), (left, y)], stroke);
        }
        if let Some(power) = common_power(&self.axes.y) {
            let at = (left, self.area.top - 5.0);
            scene.text(
                &power_label(power),
                at,
                TICK_SIZE,
                Anchor::Start,
                Turn::Upright,
            );
        }
        let middle = self.area.top + self.area.height / 2.0;
        let at = (left - self.label_distance + MIDDLE * LABEL_SIZE, middle);
        scene.text(
            &self.panel.y_label,
            at,
            LABEL_SIZE,
            Anchor::Middle,
            Turn::Upwards,
        );
    }
}

/// The lower and the upper bound, where they are inside the view.
pub(super) fn bounds_in_view(band: Band, y: &Axis) -> [Option<f64>; 2] {
    let positive = |bound: &f64| y.scale == Scale::Linear || *bound > 0.0;
    [band.lower, band.upper].map(|bound| Some(bound).filter(|b| y.contains(*b) && positive(b)))
}

/// Width of the widest label.
pub(super) fn widest(font: &Font, ticks: &Ticks) -> f64 {
    let widths = ticks
        .labelled
        .iter()
        .map(|(_, label)| font.width(label, TICK_SIZE));
    widths.fold(0.0, f64::max)
}

/// A point without finite neighbours, which lines would not show.
fn is_alone(points: &[Point], index: usize) -> bool {
    let finite = |(x, y): &Point| x.is_finite() && y.is_finite();
    let before = index
        .checked_sub(1)
        .and_then(|before| points.get(before))
        .is_some_and(finite);
    let after = points.get(index + 1).is_some_and(finite);
    points.get(index).is_some_and(finite) && !before && !after
}

/// Each value is held until the next point, but for one of an unknown place.
fn held(points: &[Point]) -> Vec<Point> {
    let corners = points.windows(2).flat_map(|pair| {
        let value = if pair[0].0.is_finite() {
            pair[0].1
        } else {
            f64::NAN
        };
        [pair[0], (pair[1].0, value)]
    });
    corners.chain(points.last().copied()).collect()
}

/// Without the points that lie on the line within [`RESOLUTION`] (Douglas and Peucker 1973).
fn simplified(points: &[Point]) -> Vec<Point> {
    let mut kept = vec![false; points.len()];
    let mut open = vec![(0, points.len().saturating_sub(1))];
    while let Some((first, last)) = open.pop() {
        for end in [first, last] {
            if let Some(end) = kept.get_mut(end) {
                *end = true;
            }
        }
        let farthest = (first + 1..last)
            .map(|index| (index, distance(points[index], points[first], points[last])))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((index, _)) = farthest.filter(|(_, distance)| *distance > RESOLUTION) {
            open.extend([(first, index), (index, last)]);
        }
    }
    points
        .iter()
        .zip(kept)
        .filter_map(|(point, kept)| kept.then_some(*point))
        .collect()
}

/// From `point` to the segment between `a` and `b`.
fn distance(point: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let square = dx * dx + dy * dy;
    let along = (point.0 - a.0) * dx + (point.1 - a.1) * dy;
    let part = if square > 0.0 {
        (along / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point.0 - a.0 - part * dx).hypot(point.1 - a.1 - part * dy)
}

/// The pieces of a line inside `area`.
fn clipped(points: &[Point], area: &Rect) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    for pair in points.windows(2) {
        let Some((start, end)) = area.clip(pair[0], pair[1]) else {
            continue;
        };
        match pieces.last_mut() {
            Some(piece) if piece.last() == Some(&start) => piece.push(end),
            _ => pieces.push(vec![start, end]),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_hold_until_the_next_point() {
        let corners = held(&[(0.0, 1.0), (1.0, 3.0), (2.0, 2.0)]);
        assert_eq!(
            corners,
            [(0.0, 1.0), (1.0, 1.0), (1.0, 3.0), (2.0, 3.0), (2.0, 2.0)]
        );
    }

    #[test]
    fn a_value_of_an_unknown_place_is_not_held() {
        let corners = held(&[(f64::NAN, 1.0), (1.0, 3.0)]);
        assert!(
            corners[1].1.is_nan() && corners[2] == (1.0, 3.0),
            "{corners:?}"
        );
    }

    #[test]
    fn a_line_from_far_outside_ends_at_the_edge() {
        let area = Rect {
            left: 0.0,
            top: 0.0,
            width: 10.0,
            height: 10.0,
        };
        for far in [1e18, -1e18] {
            let pieces = clipped(&[(5.0, far), (5.0, 4.0), (far, 4.0)], &area);
            let edge = if far > 0.0 { 10.0 } else { 0.0 };
            assert_eq!(pieces, [[(5.0, edge), (5.0, 4.0), (edge, 4.0)]]);
        }
    }

    #[test]
    fn a_line_that_leaves_the_area_comes_back_as_a_second_piece() {
        let area = Rect {
            left: 0.0,
            top: 0.0,
            width: 10.0,
            height: 10.0,
        };
        let pieces = clipped(&[(0.0, 5.0), (5.0, 15.0), (10.0, 5.0)], &area);
        assert_eq!(
            pieces,
            [[(0.0, 5.0), (2.5, 10.0)], [(7.5, 10.0), (10.0, 5.0)]]
        );
    }

    #[test]
    fn simplifying_keeps_the_shape() {
        let wave: Vec<Point> = (0..=5000)
            .map(|k| f64::from(k) * 0.1)
            .map(|x| (x, 100.0 * (x / 40.0).sin()))
            .collect();
        let simple = simplified(&wave);
        assert!(simple.len() < 300, "{}", simple.len());
        assert_eq!((simple.first(), simple.last()), (wave.first(), wave.last()));
        for point in &wave {
            let nearest = simple
                .windows(2)
                .map(|pair| distance(*point, pair[0], pair[1]));
            assert!(nearest.fold(f64::MAX, f64::min) <= RESOLUTION);
        }
    }

    #[test]
    fn simplifying_takes_any_number_of_points() {
        let point = (1.0, 2.0);
        for count in 0..4 {
            let kept = simplified(&vec![point; count]);
            assert_eq!(kept.len(), count.min(2));
        }
    }
}
