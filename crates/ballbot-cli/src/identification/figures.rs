//! The figures of an identification.

use crate::html::CaptionedFigure;
use ballbot_identification::{HORIZONS, Identification, IdentifiedRobot, OUTPUTS, SegmentResidual};
use lpvmpc_design::{Correlation, NORMAL_95};
use lpvmpc_figures::{Dash, Figure, Panel, Role, Scale, Series, Style};

/// A figure shows so much of the log, s.
const SHOWN: f64 = 10.0;

const LABELS: [&str; 3] = ["φ [rad]", "θ [rad]", "θ\u{307} [rad/s]"];
const UNITS: [&str; 3] = ["rad", "rad", "rad/s"];

/// The names of all figures: of the only plane, of the plane x, of the plane y. The last of each is
/// only of data that were held back.
pub const NAMES: [[&str; 4]; 3] = [
    ["fit", "residuals", "correlations", "predictions"],
    ["fit_x", "residuals_x", "correlations_x", "predictions_x"],
    ["fit_y", "residuals_y", "correlations_y", "predictions_y"],
];

/// All figures of all planes.
pub fn figures(robot: &IdentifiedRobot) -> Vec<CaptionedFigure> {
    let planes = robot.planes.iter().enumerate();
    planes
        .flat_map(|(place, plane)| match robot.plane_name(place) {
            None => of_plane(plane, NAMES[0], ""),
            Some(name) => of_plane(plane, NAMES[1 + place], &format!(", plane {name}")),
        })
        .collect()
}

/// The figures of a plane, `title` being what follows the title of each.
fn of_plane(plane: &Identification, names: [&'static str; 4], title: &str) -> Vec<CaptionedFigure> {
    let figures = [
        Some(fit(plane)),
        Some(residuals(plane)),
        Some(correlations(plane)),
        predictions(plane),
    ];
    let named = figures.into_iter().zip(names).filter_map(|(figure, name)| {
        let mut figure = CaptionedFigure { name, ..figure? };
        figure.figure.title += title;
        Some(figure)
    });
    named.collect()
}

/// The first segments of the log, up to [`SHOWN`] seconds.
fn shown(identification: &Identification) -> Vec<&SegmentResidual> {
    let segments = &identification.simulated;
    let Some(first) = segments.first() else {
        return Vec::new();
    };
    let until = first.time[0] + SHOWN;
    let within = |segment: &&SegmentResidual| segment.run == first.run && segment.time[0] < until;
    segments.iter().take_while(within).collect()
}

/// A series over the segments, with a gap after each of them if `cut`.
fn series(
    segments: &[&SegmentResidual],
    label: &str,
    style: Style,
    role: Role,
    cut: bool,
    value: impl Fn(&SegmentResidual, usize) -> f64,
) -> Series {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for segment in segments {
        for row in 0..segment.time.len() {
            x.push(segment.time[row]);
            y.push(value(segment, row));
        }
        if cut {
            x.push(f64::NAN);
            y.push(f64::NAN);
        }
    }
    Series::new(label, &x, &y, style, role)
}

fn line() -> Style {
    Style::Line(Dash::Solid)
}

fn fit(identification: &Identification) -> CaptionedFigure {
    let segments = shown(identification);
    let mut panels: Vec<Panel> = measured_outputs(identification)
        .map(|output| {
            let measured = series(
                &segments,
                "measured",
                line(),
                Role::Linear,
                false,
                |s, row| s.measured[row][output],
            );
            let simulated = series(
                &segments,
                "simulated",
                line(),
                Role::Nonlinear,
                true,
                |s, row| s.simulated[row][output],
            );
            Panel::new("t [s]", LABELS[output], vec![measured, simulated])
        })
        .collect();
    let torque = series(
        &segments,
        "",
        Style::Steps(Dash::Solid),
        Role::Lpv,
        false,
        |s, row| s.torque[row],
    );
    panels.push(Panel::new("t [s]", "τ [N m]", vec![torque]));
    CaptionedFigure {
        name: NAMES[0][0],
        caption: format!(
            "Measured outputs and those of the fitted robot, simulated segment by segment, over the \
             first {SHOWN} s of the log. Below, the logged torque."
        ),
        figure: figure("Measured and simulated", panels, 2, 560.0),
    }
}

/// The outputs that have residuals.
fn measured_outputs(identification: &Identification) -> impl Iterator<Item = usize> {
    0..identification.residuals.len()
}

fn residuals(identification: &Identification) -> CaptionedFigure {
    let segments = shown(identification);
    let panels = measured_outputs(identification).map(|output| {
        let residual = series(&segments, "", line(), Role::Lpv, true, |s, row| {
            s.measured[row][output] - s.simulated[row][output]
        });
        let bound = NORMAL_95 * identification.floor[output];
        let bounds = [bound, -bound].map(|bound| {
            series(
                &segments,
                "95 % of the sensor's noise",
                line(),
                Role::Linear,
                false,
                |_, _| bound,
            )
        });
        let label = format!("{} [{}]", OUTPUTS[output], UNITS[output]);
        let mut all = vec![residual];
        all.extend(bounds);
        Panel::new("t [s]", &label, all)
    });
    CaptionedFigure {
        name: NAMES[0][1],
        caption: "Residuals, measured minus simulated, beside what the noise of the sensors alone \
                  would leave. They should look like noise."
            .to_owned(),
        figure: figure("Residuals", panels.collect(), 1, 620.0),
    }
}

fn correlations(identification: &Identification) -> CaptionedFigure {
    let mut panels = Vec::new();
    for (output, residual) in OUTPUTS.iter().zip(&identification.residuals) {
        panels.push(correlation(&residual.autocorrelation, output));
        panels.push(correlation(
            &residual.with_torque,
            &format!("{output}, torque"),
        ));
    }
    CaptionedFigure {
        name: NAMES[0][2],
        caption: "Left: correlation of each residual with itself some rows before; right: with the \
                  torque. Between the lines lie 95 % of the values if there is none (for the torque, \
                  which is not white, somewhat less). At lag 0 and to its left the torque answers to the \
                  noise: that is the loop, and no fault of the model."
            .to_owned(),
        figure: figure("Correlations of the residuals", panels, 2, 760.0),
    }
}

fn correlation(correlation: &Correlation, label: &str) -> Panel {
    let lags = 0..correlation.values.len();
    let lags: Vec<f64> = lags
        .map(|place| (correlation.first_lag + place as isize) as f64)
        .collect();
    let ends = [lags.first(), lags.last()].map(|end| end.copied().unwrap_or(0.0));
    let values = Series::new("", &lags, &correlation.values, Style::Markers, Role::Lpv);
    let bounds = [correlation.bound, -correlation.bound]
        .map(|bound| Series::new("95 %", &ends, &[bound; 2], line(), Role::Linear));
    let mut series = vec![values];
    series.extend(bounds);
    let mut panel = Panel::new("lag [rows]", label, series);
    let largest = correlation
        .values
        .iter()
        .fold(correlation.bound, |a, b| a.max(b.abs()));
    // A view that is never so narrow that chance looks like structure.
    let view = (1.2 * largest).max(0.2);
    panel.y_range = Some((-view, view));
    panel
}

/// Errors of predictions on held-back data; none if nothing was held back for long enough.
fn predictions(identification: &Identification) -> Option<CaptionedFigure> {
    let series = identification
        .structures
        .iter()
        .enumerate()
        .map(|(i, compared)| {
            let errors = compared.validation.errors.map(|error| error[1]);
            Series::new(
                compared.structure.words(),
                &HORIZONS,
                &errors,
                Style::MarkedLine(Dash::Solid),
                [Role::Linear, Role::Member(1), Role::Lpv, Role::RungeKutta][i % 4],
            )
        });
    let series: Vec<Series> = series.collect();
    let finite = series
        .iter()
        .flat_map(|one| &one.y)
        .any(|error| error.is_finite());
    let mut panel = Panel::new("horizon [s]", "tilt, error (rms) [rad]", series);
    panel.y_scale = Scale::Log;
    finite.then(|| CaptionedFigure {
        name: NAMES[0][3],
        caption: "Errors of predictions on data that were held back, for each structure of friction. \
                  Over a long horizon an error of the state grows with the unstable mode, whatever the \
                  structure: the shorter horizons and \u{3c7}\u{b2} tell structures apart."
            .to_owned(),
        figure: figure("Predictions on data held back", vec![panel], 1, 420.0),
    })
}

fn figure(title: &str, panels: Vec<Panel>, columns: usize, height: f64) -> Figure {
    Figure {
        title: title.to_owned(),
        panels,
        columns,
        width: 900.0,
        height,
    }
}
