//! What a certificate is for, and what it is not.

use crate::check::Names;
use crate::error::MpcError;
use crate::estimator::EstimatorSettings;
use crate::settings::{Limits, MpcSettings, TerminalSet};
use lpvmpc_plant::PlantData;
use nalgebra::DMatrix;

/// Whether the set is one for the plant, and for these settings.
pub(super) fn check(
    names: &Names,
    data: &PlantData,
    settings: &MpcSettings,
    set: &TerminalSet,
) -> Result<(), MpcError> {
    check_sizes(names, set)?;
    check_settings(settings, set)?;
    let bounded = data
        .outputs
        .iter()
        .any(|y| y.lower.is_some() || y.upper.is_some());
    if bounded {
        let fault = "the plant's outputs have bounds, of which the certificate says nothing";
        return Err(MpcError::new("terminal", fault));
    }
    Ok(())
}

/// Whether the set, which reaches by `reach` about `at`, is within the bounds.
pub(super) fn check_reach(
    place: &str,
    names: &[String],
    (at, reach): (&[f64], &[f64]),
    bounds: &Limits,
) -> Result<(), MpcError> {
    for i in 0..names.len() {
        let (lower, upper) = (at[i] - reach[i], at[i] + reach[i]);
        // Rounding apart, since the limits were made of such bounds.
        let slack = 1e-9 * (1.0 + at[i].abs());
        let within = lower >= bounds.lower[i] - slack && upper <= bounds.upper[i] + slack;
        if !within {
            let fault = format!(
                "{} is bounded by {} to {}, and in the certified set it reaches {lower} to {upper}; \
                 certify with these bounds",
                names[i], bounds.lower[i], bounds.upper[i]
            );
            return Err(MpcError::new(place, fault));
        }
    }
    Ok(())
}

/// Beside an input, a disturbance is taken off what is commanded; elsewhere it moves the equilibrium.
pub(crate) fn check_estimator(names: &Names, settings: &EstimatorSettings) -> Result<(), MpcError> {
    let mut disturbances = settings.disturbances.iter();
    let moves =
        disturbances.find(|one| !names.inputs.contains(&one.on) && names.states.contains(&one.on));
    match moves {
        None => Ok(()),
        Some(one) => {
            let fault = format!(
                "{} is a state: a disturbance there moves the equilibrium that the certificate is about; with a \
                 certified terminal set it must be beside an input ({})",
                one.on,
                names.inputs.join(", ")
            );
            Err(MpcError::new("estimator, disturbances", fault))
        }
    }
}

fn check_sizes(names: &Names, set: &TerminalSet) -> Result<(), MpcError> {
    let (n, m) = (names.states.len(), names.inputs.len());
    let right = set.x.len() == n
        && set.u.len() == m
        && set.k.shape() == (m, n)
        && set.p.shape() == (n, n)
        && set.q.shape() == (n, n)
        && set.r.shape() == (m, m)
        && set.state_limits.len() == n
        && set.input_limits.len() == m;
    let numbers = set
        .k
        .iter()
        .chain(set.p.iter())
        .chain(set.x.iter())
        .chain(set.u.iter());
    let finite = numbers.chain([&set.level]).all(|value| value.is_finite());
    match right && finite && set.level > 0.0 {
        true => Ok(()),
        false => {
            let fault = format!(
                "the certificate must be one of {n} states and {m} inputs, with finite numbers"
            );
            Err(MpcError::new("terminal", fault))
        }
    }
}

/// The decrease is proved for the certificate's sampling time and weights, and so for smaller weights.
fn check_settings(settings: &MpcSettings, set: &TerminalSet) -> Result<(), MpcError> {
    if settings.t_s != set.t_s {
        let fault = format!(
            "it is {} s, that of the certificate {} s",
            settings.t_s, set.t_s
        );
        return Err(MpcError::new("t_s", fault));
    }
    for (place, own, proved) in [("q", &settings.q, &set.q), ("r", &settings.r, &set.r)] {
        if own.shape() != proved.shape() {
            // Named with the weights.
            continue;
        }
        if !is_at_most(own, proved) {
            let fault = "it is larger than the certificate's, for which alone the decrease of the cost is proved";
            return Err(MpcError::new(place, fault));
        }
    }
    for (place, there) in [
        ("rows", !settings.rows.is_empty()),
        ("q_y", settings.q_y.is_some()),
        ("y_bounds", settings.y_bounds.is_some()),
        ("r_du", settings.r_du.is_some()),
        ("du_bounds", settings.du_bounds.is_some()),
        ("u_ref", settings.u_ref.is_some()),
    ] {
        if there {
            let fault = "the certificate says nothing of it; leave it out, or take another terminal ingredient";
            return Err(MpcError::new(place, fault));
        }
    }
    Ok(())
}

/// Whether `proved` - `own` is positive semidefinite, up to rounding of each weight by itself: they are of as many units as
/// there are states, so none is rounding beside another.
fn is_at_most(own: &DMatrix<f64>, proved: &DMatrix<f64>) -> bool {
    let size = |i: usize| own[(i, i)].max(proved[(i, i)]).sqrt();
    let unit = |i: usize| if size(i) > 0.0 { size(i) } else { 1.0 };
    let rest = DMatrix::from_fn(own.nrows(), own.ncols(), |i, j| {
        (proved[(i, j)] - own[(i, j)]) / unit(i) / unit(j)
    });
    rest.symmetric_eigenvalues().min() >= -1e-12
}
