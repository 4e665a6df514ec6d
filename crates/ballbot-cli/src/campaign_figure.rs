//! The figure of a campaign.

use ballbot_studies::Outcome;
use lpvmpc_figures::{Band, Dash, Figure, Panel, Role, Series, Style};

/// Per variant: the largest tilts, and the share of the runs that did not keep all bounds.
pub fn figure(outcomes: &[Outcome], theta: Band) -> Figure {
    let mut tilts = Panel::new(
        "share of the runs",
        "largest |θ| [rad]",
        outcomes.iter().enumerate().map(tilts).collect(),
    );
    tilts.band = Some(theta);
    tilts.y_range = Some((0.0, 1.2 * theta.upper));
    let mut shares = Panel::new(
        "variant, numbered as in the legend",
        "runs that left the bounds or had no plan [%]",
        outcomes.iter().enumerate().map(lost).collect(),
    );
    shares.x_range = Some((0.0, outcomes.len() as f64 + 1.0));
    Figure {
        title: "Campaign".to_owned(),
        panels: vec![tilts, shares],
        columns: 1,
        width: 900.0,
        height: 860.0,
    }
}

fn label(index: usize, outcome: &Outcome) -> String {
    format!("{}: {}", index + 1, outcome.variant)
}

/// Colour and line of a variant.
fn style(index: usize) -> (Role, Dash) {
    let roles = [
        Role::Lpv,
        Role::Linear,
        Role::RungeKutta,
        Role::Member(0),
        Role::Nonlinear,
    ];
    let dashes = [Dash::Solid, Dash::Dashed, Dash::Dotted];
    (
        roles[index % roles.len()],
        dashes[index / roles.len() % dashes.len()],
    )
}

fn tilts((index, outcome): (usize, &Outcome)) -> Series {
    let records = outcome.records.iter();
    let mut tilts: Vec<f64> = records.map(|record| record.largest_tilt_rad).collect();
    tilts.sort_by(f64::total_cmp);
    let count = tilts.len() as f64;
    let shares: Vec<f64> = (1..=tilts.len()).map(|i| i as f64 / count).collect();
    let (role, dash) = style(index);
    let label = label(index, outcome);
    Series::new(&label, &shares, &tilts, Style::Line(dash), role)
}

fn lost((index, outcome): (usize, &Outcome)) -> Series {
    let tally = &outcome.tally;
    let kept = tally.runs_within_bounds as f64 / tally.runs.max(1) as f64;
    let (role, _) = style(index);
    let label = label(index, outcome);
    let place = [index as f64 + 1.0];
    Series::new(
        &label,
        &place,
        &[100.0 * (1.0 - kept)],
        Style::Markers,
        role,
    )
}
