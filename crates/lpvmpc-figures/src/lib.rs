//! Figures of runs: plain numbers in, SVG and PNG out.
//!
//! [`Figure`] says what is drawn, and knows no controller; [`convergence`], [`models`],
//! [`closed_loop`], [`motor_torques`], [`two_planes`] and [`path_in_plane`] make the figures of
//! the paper from arrays. A figure becomes one scene of lines, rectangles, discs and texts, and
//! both formats are painted from that scene, so they show the same picture.
//!
//! ```
//! use lpvmpc_figures::{Dash, Figure, Panel, Role, Series, Style};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let t: Vec<f64> = (0..100).map(|k| 0.05 * f64::from(k)).collect();
//! let angle: Vec<f64> = t.iter().map(|t| (-t).exp()).collect();
//! let style = Style::Line(Dash::Solid);
//! let series = Series::new("angle", &t, &angle, style, Role::Lpv);
//! let figure = Figure {
//!     title: "Back to rest".to_owned(),
//!     panels: vec![Panel::new("t [s]", "angle [rad]", vec![series])],
//!     columns: 1,
//!     width: 600.0,
//!     height: 400.0,
//! };
//! let svg = figure.svg()?;
//! println!("{} bytes of SVG, {} of PNG", svg.len(), figure.png(2.0)?.len());
//! # Ok(())
//! # }
//! ```
//!
//! The layout is our own because the plotting libraries looked at fall short: kuva 0.6 restarts
//! the dashes at every sample in its PNG (a sampled reference becomes a solid line), smears
//! rotated labels and numbers its clip paths by a counter of the process, so that two figures in
//! one page collide; plotters 0.3 snaps to whole pixels. Lines are clipped here by geometry, so
//! the SVG needs no ids at all and can stand inline in a page any number of times.

#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod axis;
mod beginning;
mod closed_loop;
mod figure;
mod font;
mod layout;
mod legend;
mod models;
mod panel;
mod planes;
mod plans;
mod png;
mod scene;
mod svg;
#[cfg(test)]
mod tests;
mod ticks;

pub use closed_loop::{Limits, PlaneRun, Reference, closed_loop, motor_torques};
pub use figure::{Band, Dash, Figure, FigureError, Panel, Role, Scale, Series, Style};
pub use models::{ModelRuns, convergence, models};
pub use planes::{PathRun, path_in_plane, two_planes};
pub use plans::{GuaranteeRun, PlansRun, plans};
