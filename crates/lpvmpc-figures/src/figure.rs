//! What a figure shows: panels, series and allowed ranges.

use super::{layout, png, svg};

/// One figure: a title above a grid of panels, filled row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Title above the panels; empty for none.
    pub title: String,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Number of panels side by side, at least 1.
    pub columns: usize,
    /// Width in CSS pixels.
    pub width: f64,
    /// Height in CSS pixels.
    pub height: f64,
}

/// One pair of axes with its series.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Title above the axes; empty for none.
    pub title: String,
    /// Label of the horizontal axis with its unit, such as `t [s]`.
    pub x_label: String,
    /// Label of the vertical axis with its unit, such as `θ [rad]`.
    pub y_label: String,
    /// What is drawn, the first at the back.
    pub series: Vec<Series>,
    /// Allowed range of the vertical quantity. The view is widened to a bound that is near the
    /// data; where a bound is in view it is drawn, and what lies beyond it is shaded.
    pub band: Option<Band>,
    /// Scale of the vertical axis.
    pub y_scale: Scale,
    /// View of the horizontal axis; `None` takes it from the data.
    pub x_range: Option<(f64, f64)>,
    /// View of the vertical axis; `None` takes it from the data.
    pub y_range: Option<(f64, f64)>,
    /// One unit is as long on both axes.
    pub equal_aspect: bool,
}

/// A sequence of points. A point that is not finite, or not positive on a logarithmic axis,
/// leaves a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; empty for no entry. One name is listed once per figure.
    pub label: String,
    /// Horizontal coordinates.
    pub x: Vec<f64>,
    /// Vertical coordinates, as many as `x`. [`Style::Steps`] also takes one less: the last
    /// value is then held until the last `x`.
    pub y: Vec<f64>,
    /// How the points are joined.
    pub style: Style,
    /// What it stands for, which settles the colour.
    pub role: Role,
}

/// How the points of a series are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Straight lines.
    Line(Dash),
    /// Each value is held until the next point (zero-order hold).
    Steps(Dash),
    /// Discs only.
    Markers,
    /// Discs joined by straight lines.
    MarkedLine(Dash),
    /// Filled rectangles around the points, at the back: the view is divided into so many columns
    /// and rows of them.
    Tiles {
        /// Rectangles side by side.
        columns: u32,
        /// Rectangles one above the other.
        rows: u32,
    },
}

/// Pattern of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    /// An unbroken line.
    Solid,
    /// Long dashes.
    Dashed,
    /// Short dashes.
    Dotted,
}

/// What a series stands for. The colours are those of Okabe and Ito, which colour-blind readers
/// can tell apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A reference or a value to compare with: dark grey.
    Reference,
    /// The LPV model or its controller: blue.
    Lpv,
    /// The linear model or its controller: vermilion.
    Linear,
    /// The nonlinear model or its controller: black.
    Nonlinear,
    /// The discrete-time Runge-Kutta model: green.
    RungeKutta,
    /// One of several alike, such as a motor: purple, orange, sky blue, in turn.
    Member(usize),
    /// A share in percent, of failures, say: from pale blue at none to dark red at all.
    Share(u8),
}

/// An allowed range; an infinite side is no bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Lower bound, in the unit of the panel.
    pub lower: f64,
    /// Upper bound, in the unit of the panel.
    pub upper: f64,
}

/// Scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal distances for equal differences.
    Linear,
    /// Equal distances for equal ratios; only positive values are drawn.
    Log,
}

/// Why a figure cannot be drawn or written.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// No panel, or no column.
    #[error(
        "figure \"{title}\" has {panels} panels in {columns} columns; it needs at least one of each"
    )]
    Empty {
        /// Title of the figure.
        title: String,
        /// Number of panels.
        panels: usize,
        /// Number of columns.
        columns: usize,
    },
    /// The coordinates of a series do not pair up.
    #[error(
        "panel \"{panel}\", series \"{series}\": {x} horizontal and {y} vertical values; they must be as many (steps may have one vertical value less)"
    )]
    Lengths {
        /// Vertical label of the panel.
        panel: String,
        /// Label of the series.
        series: String,
        /// Number of horizontal values.
        x: usize,
        /// Number of vertical values.
        y: usize,
    },
    /// No series of the panel has a point that can be drawn.
    #[error(
        "panel \"{panel}\" has nothing to draw: no point is finite, in view, and positive where the axis is logarithmic"
    )]
    NoData {
        /// Vertical label of the panel.
        panel: String,
    },
    /// A view that is not a range.
    #[error(
        "panel \"{panel}\": the {axis} view from {lower:?} to {upper:?} must be increasing, positive where the axis is logarithmic, and of a size between 1e-290 and 1e290"
    )]
    View {
        /// Vertical label of the panel.
        panel: String,
        /// `horizontal` or `vertical`.
        axis: &'static str,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// An allowed range that is none.
    #[error(
        "panel \"{panel}\": the lower bound {lower:?} must not be above the upper bound {upper:?}"
    )]
    Band {
        /// Vertical label of the panel.
        panel: String,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The size leaves no room for the axes.
    #[error(
        "{width} x {height} pixels are no size for {rows} rows and {columns} columns of panels: each needs about 160 x 120 with its labels"
    )]
    Size {
        /// Width of the figure.
        width: f64,
        /// Height of the figure.
        height: f64,
        /// Rows of panels.
        rows: usize,
        /// Columns of panels.
        columns: usize,
    },
    /// The PNG would be empty or too large.
    #[error("a PNG of {width} x {height} pixels cannot be made: each side must be from 1 to 20000")]
    PngSize {
        /// Width in pixels.
        width: f64,
        /// Height in pixels.
        height: f64,
    },
    /// The built-in font cannot be read.
    #[error("the built-in font cannot be read: {0}")]
    Font(ttf_parser::FaceParsingError),
    /// The PNG could not be encoded.
    #[error("the PNG could not be encoded: {0}")]
    Encode(String),
}

impl Figure {
    /// The figure as a self-contained SVG document, which can also stand inline in HTML: it has
    /// no ids, scripts, style sheets or outside references.
    ///
    /// # Errors
    /// Data, views or sizes that cannot be drawn; see [`FigureError`].
    pub fn svg(&self) -> Result<String, FigureError> {
        Ok(svg::document(&layout::scene(self)?, &self.title))
    }

    /// The figure as a PNG of `scale` pixels per CSS pixel (2 for print).
    ///
    /// # Errors
    /// As [`Figure::svg`], and a size beyond 20000 pixels.
    pub fn png(&self, scale: f64) -> Result<Vec<u8>, FigureError> {
        png::encode(&layout::scene(self)?, scale)
    }

    /// The figure as the files `name`.svg and `name`.png, this one at two pixels per CSS pixel.
    ///
    /// # Errors
    /// As [`Figure::svg`].
    pub fn files(&self, name: &str) -> Result<[(String, Vec<u8>); 2], FigureError> {
        Ok([
            (format!("{name}.svg"), self.svg()?.into_bytes()),
            (format!("{name}.png"), self.png(2.0)?),
        ])
    }
}

impl Panel {
    /// Linear axes with views from the data, without title and bounds.
    pub fn new(x_label: &str, y_label: &str, series: Vec<Series>) -> Self {
        Self {
            title: String::new(),
            x_label: x_label.to_owned(),
            y_label: y_label.to_owned(),
            series,
            band: None,
            y_scale: Scale::Linear,
            x_range: None,
            y_range: None,
            equal_aspect: false,
        }
    }
}

impl Series {
    /// A series from slices; see the fields for what is asked of them.
    pub fn new(label: &str, x: &[f64], y: &[f64], style: Style, role: Role) -> Self {
        Self {
            label: label.to_owned(),
            x: x.to_vec(),
            y: y.to_vec(),
            style,
            role,
        }
    }

    /// The points to draw; steps with one value less hold the last one.
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let held = self.y.last().filter(|_| self.y.len() < self.x.len());
        self.x
            .iter()
            .copied()
            .zip(self.y.iter().chain(held).copied())
    }
}
