//! `[controller.terminal.certified]`: from the certificate of a terminal set to the guarded
//! controller.

use crate::certificate::TerminalCertificate;
use crate::error::ScenarioError;
use crate::files::Files;
use crate::problem::dynamic;
use crate::schema::{CertifiedTable, ControllerTable, ModelKind, TerminalTable};
use crate::{RobotTable, builtin, rollout};
use ballbot::Ballbot;
use lpvmpc::{
    ControllerSettings, GuardedIterations, GuardedSettings, Predictor, TerminalSet, Weights,
};
use nalgebra::{SMatrix, Vector4};
use std::path::Path;

const KEY: &str = "controller.terminal.certified";

/// Part of the bounds' width that programs keep away from them: what the rollout's integration error
/// may add up to, and too little to be seen.
const MARGIN: f64 = 4e-3;
/// Quadratic programs that look for a plan where none is known: at the start, after a push.
const SEARCH: usize = 30;
/// Price of a state bound exceeded by its width, in largest terminal costs of the set.
const SOFT_PRICE: f64 = 1e3;

impl ControllerTable {
    /// The guarded controller's settings, where the terminal set is certified.
    pub(crate) fn guarded(
        &self,
        ballbot: &Ballbot<f64>,
        settings: &ControllerSettings<f64, 4, 1, 3>,
        files: &dyn Files,
    ) -> Result<Option<GuardedSettings<f64, 4, 1>>, ScenarioError> {
        let TerminalTable::Certified(table) = &self.terminal else {
            return Ok(None);
        };
        if self.model == ModelKind::Linear {
            return Err(ScenarioError::value(
                "controller.model",
                "linear",
                "a guarantee needs the nonlinear prediction, \"lpv\"",
            ));
        }
        table.settings(ballbot, settings, files).map(Some)
    }
}

/// A certificate, as it was written. It is not proved again here: `ballbot verify` does.
pub(crate) fn read(
    file: Option<&str>,
    directory: &Path,
) -> Result<TerminalCertificate, ScenarioError> {
    let (origin, text) = match file {
        None => (
            "(built-in)".to_owned(),
            builtin::TERMINAL_CERTIFICATE.into(),
        ),
        Some(file) => {
            let path = directory.join(file);
            let text = std::fs::read_to_string(&path);
            let text = text.map_err(|source| ScenarioError::Read {
                path: path.clone(),
                source,
            })?;
            (path.display().to_string(), text)
        }
    };
    let certificate = TerminalCertificate::from_json(&text);
    certificate
        .and_then(|read| TerminalCertificate::check_digest(&text).map(|()| read))
        .map_err(|error| {
            let key = format!("{KEY}.certificate");
            ScenarioError::value(key, origin, error.to_string())
        })
}

impl CertifiedTable {
    /// The guarded controller's settings for the problem of `plain`.
    ///
    /// # Errors
    /// The certificate cannot be read, or is none of this robot, cost and bounds.
    fn settings(
        &self,
        ballbot: &Ballbot<f64>,
        plain: &ControllerSettings<f64, 4, 1, 3>,
        files: &dyn Files,
    ) -> Result<GuardedSettings<f64, 4, 1>, ScenarioError> {
        let Predictor::StageConsistent(rk4) = plain.predictor else {
            return Err(ScenarioError::value(
                "controller.predictor",
                "(given)",
                "a guarantee needs the stage_consistent predictor, which is the default",
            ));
        };
        let certificate = files.certificate(self.certificate.as_deref())?;
        check_plant(&certificate, ballbot, plain.t_s)?;
        check_cost(&certificate, &plain.weights)?;
        let terminal = TerminalSet {
            gain: certificate.terminal.k,
            p: certificate.terminal.p,
            level: certificate.terminal.level,
        };
        let semi_axes = check_bounds(&terminal, plain)?;
        let direction = Vector4::x();
        let stiffness = (terminal.p * direction).dot(&direction);
        Ok(GuardedSettings {
            t_s: plain.t_s,
            horizon: plain.horizon,
            rk4,
            rollout: rollout::accurate(ballbot, plain, &terminal, MARGIN)?,
            weights: plain.weights,
            terminal,
            x: plain.x,
            u: plain.u,
            direction,
            set_points: [
                plain.x.lower[0] + semi_axes[0],
                plain.x.upper[0] - semi_axes[0],
            ],
            offset_weight: self.offset_weight.unwrap_or(stiffness),
            margin: MARGIN,
            iterations: GuardedIterations {
                known: plain.iterations.most(),
                unknown: SEARCH.max(plain.iterations.most()),
            },
            soft_price: SOFT_PRICE * terminal.level,
            solver: plain.solver,
        })
    }
}

fn check_plant(
    certificate: &TerminalCertificate,
    ballbot: &Ballbot<f64>,
    t_s: f64,
) -> Result<(), ScenarioError> {
    let robot = RobotTable::try_from(ballbot)?;
    if certificate.plant != robot {
        return Err(ScenarioError::value(
            "parameters",
            format!("{robot:?}"),
            format!(
                "the certificate is of another robot, {:?}; write one of this robot with \
                 `ballbot certify` and name it as {KEY}.certificate",
                certificate.plant
            ),
        ));
    }
    if certificate.t_s != t_s {
        let expected = format!("the certificate is for {} s", certificate.t_s);
        return Err(ScenarioError::value("controller.t_s", t_s, expected));
    }
    Ok(())
}

/// The certified decrease must pay for the stage cost: Q and R at most the certificate's.
fn check_cost(
    certificate: &TerminalCertificate,
    weights: &Weights<f64, 4, 1>,
) -> Result<(), ScenarioError> {
    let rest = certificate.q - weights.q;
    if dynamic(&rest).symmetric_eigenvalues().min() < 0.0 {
        return Err(ScenarioError::value(
            "controller.q",
            numbers(&weights.q.diagonal()),
            format!(
                "the certificate is for q = {}, and for less",
                numbers(&certificate.q.diagonal())
            ),
        ));
    }
    if weights.r[0] > certificate.r[0] {
        return Err(ScenarioError::value(
            "controller.r",
            weights.r[0],
            format!(
                "the certificate is for r = {}, and for less",
                certificate.r[0]
            ),
        ));
    }
    Ok(())
}

/// The set and the law in it must lie within the bounds. Returns the set's semi-axes: its
/// largest |x_i|.
fn check_bounds(
    terminal: &TerminalSet<f64, 4, 1>,
    plain: &ControllerSettings<f64, 4, 1, 3>,
) -> Result<Vector4<f64>, ScenarioError> {
    let inverse = dynamic(&terminal.p).lu().try_inverse().ok_or_else(|| {
        ScenarioError::value(
            format!("{KEY}.certificate"),
            "P",
            "it must be positive definite",
        )
    })?;
    let reach = |row: &SMatrix<f64, 1, 4>| {
        let square = terminal.level * (row * &inverse * row.transpose())[0];
        square.sqrt()
    };
    let semi_axes = Vector4::from_fn(|i, _| reach(&Vector4::ith(i, 1.0).transpose()));
    let torque = reach(&terminal.gain);
    let rows = [
        (
            "theta_rad",
            semi_axes[1],
            plain.x.lower[1],
            plain.x.upper[1],
        ),
        (
            "phi_dot_rad_s",
            semi_axes[2],
            plain.x.lower[2],
            plain.x.upper[2],
        ),
        (
            "theta_dot_rad_s",
            semi_axes[3],
            plain.x.lower[3],
            plain.x.upper[3],
        ),
        ("torque_nm", torque, plain.u.lower[0], plain.u.upper[0]),
    ];
    for (key, reach, lower, upper) in rows {
        if -reach < lower || reach > upper {
            return Err(ScenarioError::value(
                format!("bounds.{key}"),
                format!("[{lower}, {upper}]"),
                format!(
                    "the certified set reaches from {:.4} to {reach:.4}; certify a smaller one \
                     with `ballbot certify --size`",
                    -reach
                ),
            ));
        }
    }
    if plain.x.upper[0] - plain.x.lower[0] < 2.0 * semi_axes[0] {
        return Err(ScenarioError::value(
            "bounds.phi_rad",
            format!("[{}, {}]", plain.x.lower[0], plain.x.upper[0]),
            format!(
                "the certified set around a set point is {:.4} rad wide and must fit in",
                2.0 * semi_axes[0]
            ),
        ));
    }
    Ok(semi_axes)
}

fn numbers(values: &Vector4<f64>) -> String {
    format!("{:?}", values.as_slice())
}
