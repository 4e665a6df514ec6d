//! What is guaranteed, and at what price, in tables and a figure.

use super::tables::Sheet;
use crate::html::CaptionedFigure;
use crate::run_figures::{self, Shown};
use ballbot_scenario::Prepared;
use ballbot_studies::reproduction::Guarantee;
use lpvmpc_figures::Role;

/// Prediction and robot's model at the end of the horizon, scenario 3.
fn gap_sheet(guarantee: &Guarantee) -> Sheet {
    let title = "Scenario 3: nonlinear rollout minus prediction at the end of the horizon; costs \
                 over the whole 4 s";
    let headers = [
        "",
        "first sample, phi [rad]",
        "first sample, theta [rad]",
        "largest in the run",
        "closed-loop cost",
        "time per step, mean [us]",
    ];
    let mut sheet = Sheet::new("gap", title, &headers);
    for (name, run) in [
        (
            "the paper: frozen scheduling, one Runge-Kutta step",
            &guarantee.frozen,
        ),
        (
            "stage-consistent, one program per sample",
            &guarantee.consistent,
        ),
        ("stage-consistent, until converged", &guarantee.converged),
    ] {
        let samples = &run.trajectories[0].samples;
        let first = samples
            .first()
            .map_or([f64::NAN; 4], |sample| sample.gap.into());
        let gaps = samples.iter().map(|sample| sample.gap.amax());
        let metrics = &run.metrics[0];
        let cells = [
            format!("{:.1e}", first[0].abs()),
            format!("{:.1e}", first[1].abs()),
            format!("{:.1e}", gaps.fold(0.0, f64::max)),
            format!("{:.1}", metrics.closed_loop_cost),
            format!("{:.1}", metrics.mean_step_us),
        ];
        sheet.row(name, cells);
    }
    sheet
}

/// Cost and time of the guarantee. Scenario 3 asks for its set point from the beginning on;
/// in scenario 1 the loop without a guarantee knows of a set point one horizon ahead.
fn price_sheet(guarantee: &Guarantee) -> Sheet {
    let title = "The price of the guarantee: stage-consistent predictor, of two steps per sample where \
                 nothing is guaranteed and of four where it is; costs and largest values over the whole 4 s";
    let headers = [
        "",
        "closed-loop cost",
        "largest tilt [rad]",
        "time per step, mean [us]",
        "longest [us]",
    ];
    let mut sheet = Sheet::new("price", title, &headers);
    for (name, run) in [
        (
            "scenario 3, terminal equality, one program",
            &guarantee.consistent,
        ),
        (
            "scenario 3, terminal equality, until converged",
            &guarantee.converged,
        ),
        (
            "scenario 3, guaranteed, one program",
            &guarantee.guaranteed_once,
        ),
        (
            "scenario 3, guaranteed, three programs",
            &guarantee.guaranteed_single,
        ),
        ("scenario 1, terminal cost, no guarantee", &guarantee.fine),
        (
            "scenario 1, guaranteed, three programs",
            &guarantee.guaranteed,
        ),
    ] {
        let metrics = &run.metrics[0];
        let cells = [
            format!("{:.1}", metrics.closed_loop_cost),
            format!("{:.3}", metrics.largest_tilt_rad),
            format!("{:.1}", metrics.mean_step_us),
            format!("{:.1}", metrics.longest_step_us),
        ];
        sheet.row(name, cells);
    }
    sheet
}

/// The tables of the chapter.
pub fn sheets(guarantee: &Guarantee) -> [Sheet; 2] {
    [gap_sheet(guarantee), price_sheet(guarantee)]
}

/// The far set points.
pub fn figure(guarantee: &Guarantee) -> CaptionedFigure {
    let shown = Shown {
        label: "ballbot",
        role: Role::Lpv,
        columns: &guarantee.far.columns[0],
    };
    let Prepared { title, .. } = &guarantee.far.prepared;
    CaptionedFigure {
        name: "far-setpoints",
        caption: "Set points far apart, each given at the jump and not before: guaranteed at \
                  every sample."
            .to_owned(),
        figure: run_figures::one_plane(title, &guarantee.far.prepared, &[shown]),
    }
}
