//! Figures of runs: plain numbers in, SVG and PNG out.
//!
//! [`Figure`] says what is drawn, and knows no controller; [`convergence`], [`models`],
//! [`closed_loop`], [`motor_torques`], [`two_planes`] and [`path_in_plane`] make the figures of
//! the paper from arrays. A figure becomes one scene of lines, rectangles, discs and texts, and
//! both formats are painted from that scene, so they show the same picture.
//!
//! The layout is our own because the plotting libraries looked at fall short: kuva 0.6 restarts
//! the dashes at every sample in its PNG (a sampled reference becomes a solid line), smears
//! rotated labels and numbers its clip paths by a counter of the process, so that two figures in
//! one page collide; plotters 0.3 snaps to whole pixels. Lines are clipped here by geometry, so
//! the SVG needs no ids at all and can stand inline in a page any number of times.

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
pub use plans::{GuardRun, PlansRun, plans};
