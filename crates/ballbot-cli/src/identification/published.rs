//! The published chain beside the trajectory fit: p by linear regression, b by refinement.

use super::tables::{Sheet, decimal};
use ballbot_identification::Identification;
use ballbot_studies::{RefinementProblem, start_from};
use std::fmt::Write as _;

/// p of the regression with the standard deviations it claims, and p of the fitted robot. Empty if
/// the regression has no result.
pub fn linear_parameters(identification: &Identification) -> Sheet {
    let mut sheet = Sheet::new(&[
        "",
        "regression",
        "claimed std. dev.",
        "trajectories",
        "unit",
    ]);
    let (Some(published), Some(fitted)) = (
        &identification.published,
        identification.linear_parameters(),
    ) else {
        return sheet;
    };
    let (p, fitted) = (published.parameters.to_vector(), fitted.to_vector());
    let units = ["1/s^2", "1/s", "rad/(s^2 N m)"];
    for i in 0..6 {
        sheet.rows.push(vec![
            format!("p{}", i + 1),
            decimal(p[i], 3),
            decimal(published.standard_deviations[i], 3),
            decimal(fitted[i], 3),
            units[i % 3].to_owned(),
        ]);
    }
    sheet
}

/// What the refinement makes of that p, in words.
pub fn refined(identification: &Identification) -> String {
    let Some(published) = &identification.published else {
        return "The rows do not tell p: the regression has no result.".to_owned();
    };
    let mut text = "Differentiation multiplies the noise of the sensors, and the loop ties the torque \
                    to that noise: the regression is biased, and its own standard deviations do not \
                    say so. "
        .to_owned();
    let geometry = identification.ballbot().geometry;
    let problem = RefinementProblem {
        linear: published.parameters,
        geometry,
        start: start_from(&published.parameters, &geometry),
        ..RefinementProblem::paper()
    };
    // Writing to a string cannot fail.
    let _ = match problem.solve() {
        Ok(refinement) => {
            let b = refinement.ballbot;
            write!(
                text,
                "Refined from that p (with the torque gain of the trajectory fit): b1 = {:.5}, b2 = \
                 {:.5}, b3 = {:.5} m^2, b4 = {:.5} m^2/s, residual {:.3}. {}",
                b.b1, b.b2, b.b3, b.b4, refinement.damped.residual_norm, refinement.consistency
            )
        }
        Err(error) => write!(text, "No b can be refined from that p: {error}."),
    };
    text
}
