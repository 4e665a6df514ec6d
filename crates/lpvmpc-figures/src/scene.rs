//! A picture as lines, rectangles, discs and texts, in CSS pixels with y downwards.

use super::figure::{Dash, Role};

/// A point: horizontal to the right, vertical downwards.
pub(super) type Point = (f64, f64);

/// Everything a painter has to draw, the first shape at the back.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub width: f64,
    pub height: f64,
    pub shapes: Vec<Shape>,
}

/// One thing to draw.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// Joined points without fill.
    Line { points: Vec<Point>, stroke: Stroke },
    /// A filled rectangle.
    Rect { area: Rect, fill: Color },
    /// A filled disc with a white rim.
    Disc {
        center: Point,
        radius: f64,
        fill: Color,
    },
    /// One line of text.
    Text(Text),
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub color: Color,
    pub width: f64,
    pub dash: Dash,
}

/// One line of text at its baseline.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub at: Point,
    pub content: String,
    pub size: f64,
    pub anchor: Anchor,
    pub turn: Turn,
}

/// Which part of a text stands at its point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Direction of reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Upright,
    /// From the bottom to the top.
    Upwards,
}

/// An area with its sides parallel to the axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

/// Red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Color(pub u8, pub u8, pub u8);

impl Color {
    pub const TEXT: Self = Self(0x1a, 0x1a, 0x1a);
    pub const FRAME: Self = Self(0x40, 0x40, 0x40);
    pub const GRID: Self = Self(0xe4, 0xe4, 0xe4);
    pub const FORBIDDEN: Self = Self(0xdc, 0xdc, 0xdc);
    pub const BOUND: Self = Self(0x80, 0x80, 0x80);

    /// Okabe and Ito, <https://jfly.uni-koeln.de/color/>.
    pub fn of(role: Role) -> Self {
        match role {
            Role::Reference => Self(0x33, 0x33, 0x33),
            Role::Lpv => Self(0x00, 0x72, 0xb2),
            Role::Linear => Self(0xd5, 0x5e, 0x00),
            Role::Nonlinear => Self(0x00, 0x00, 0x00),
            Role::RungeKutta => Self(0x00, 0x9e, 0x73),
            Role::Member(index) => match index % 3 {
                0 => Self(0xcc, 0x79, 0xa7),
                1 => Self(0xe6, 0x9f, 0x00),
                _ => Self(0x56, 0xb4, 0xe9),
            },
            Role::Share(percent) => Self::of_share(percent),
        }
    }
}

impl Color {
    /// Ever darker, so that it can be read without colours.
    fn of_share(percent: u8) -> Self {
        const COLORS: [[f64; 3]; 5] = [
            [232.0, 242.0, 250.0],
            [255.0, 220.0, 150.0],
            [240.0, 140.0, 60.0],
            [200.0, 50.0, 20.0],
            [90.0, 0.0, 20.0],
        ];
        let place = f64::from(percent.min(100)) / 25.0;
        let below = (place as usize).min(COLORS.len() - 2);
        let part = place - below as f64;
        let channel = |i: usize| {
            let [from, to] = [COLORS[below][i], COLORS[below + 1][i]];
            (from + part * (to - from)).round() as u8
        };
        Self(channel(0), channel(1), channel(2))
    }
}

impl Stroke {
    pub fn solid(color: Color, width: f64) -> Self {
        Self {
            color,
            width,
            dash: Dash::Solid,
        }
    }

    /// Lengths in pixels of line and gap.
    pub fn pattern(&self) -> Option<[f64; 2]> {
        match self.dash {
            Dash::Solid => None,
            Dash::Dashed => Some([6.0, 4.0]),
            Dash::Dotted => Some([2.0, 2.5]),
        }
    }
}

impl Rect {
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub fn contains(&self, (x, y): Point) -> bool {
        (self.left..=self.right()).contains(&x) && (self.top..=self.bottom()).contains(&y)
    }

    /// The part of the segment from `a` to `b` inside (Liang and Barsky 1984).
    pub fn clip(&self, a: Point, b: Point) -> Option<(Point, Point)> {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        // The parts of the segment at which it crosses an edge into and out of the area, with that edge.
        let (mut enter, mut leave) = ((0.0_f64, None), (1.0_f64, None));
        let edges = [
            (-dx, a.0 - self.left, Edge::At(self.left)),
            (dx, self.right() - a.0, Edge::At(self.right())),
            (-dy, a.1 - self.top, Edge::Level(self.top)),
            (dy, self.bottom() - a.1, Edge::Level(self.bottom())),
        ];
        for (slope, distance, edge) in edges {
            let part = distance / slope;
            if slope == 0.0 {
                if distance < 0.0 {
                    return None;
                }
            } else if slope < 0.0 && part > enter.0 {
                enter = (part, Some(edge));
            } else if slope > 0.0 && part < leave.0 {
                leave = (part, Some(edge));
            }
        }
        // What comes from far outside is rounded by more than the area is large.
        let crossing = |part: f64, edge: Edge| match edge {
            Edge::At(x) => (x, (a.1 + part * dy).clamp(self.top, self.bottom())),
            Edge::Level(y) => ((a.0 + part * dx).clamp(self.left, self.right()), y),
        };
        (enter.0 <= leave.0).then(|| {
            let start = enter.1.map_or(a, |edge| crossing(enter.0, edge));
            let end = leave.1.map_or(b, |edge| crossing(leave.0, edge));
            (start, end)
        })
    }
}

/// A side of an area.
#[derive(Clone, Copy)]
enum Edge {
    /// Upright, at this x.
    At(f64),
    /// Level, at this y.
    Level(f64),
}

impl Scene {
    pub fn line(&mut self, points: Vec<Point>, stroke: Stroke) {
        self.shapes.push(Shape::Line { points, stroke });
    }

    pub fn rect(&mut self, area: Rect, fill: Color) {
        self.shapes.push(Shape::Rect { area, fill });
    }

    pub fn text(&mut self, content: &str, at: Point, size: f64, anchor: Anchor, turn: Turn) {
        if !content.is_empty() {
            self.shapes.push(Shape::Text(Text {
                at,
                content: content.to_owned(),
                size,
                anchor,
                turn,
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Rect = Rect {
        left: 0.0,
        top: 0.0,
        width: 10.0,
        height: 10.0,
    };

    #[test]
    fn segments_are_cut_at_the_border() {
        assert_eq!(
            AREA.clip((-5.0, 5.0), (15.0, 5.0)),
            Some(((0.0, 5.0), (10.0, 5.0)))
        );
        assert_eq!(
            AREA.clip((2.0, 2.0), (3.0, 8.0)),
            Some(((2.0, 2.0), (3.0, 8.0)))
        );
        assert_eq!(AREA.clip((-1.0, 5.0), (-1.0, 6.0)), None);
        // Past a corner without touching it.
        assert_eq!(AREA.clip((-2.0, 1.0), (1.0, -2.0)), None);
    }
}
