//! `[controller.terminal.certified]`: from the certificate of a terminal set to the guaranteed
//! controller.

use crate::builtin;
use crate::error::ScenarioError;
use crate::file::certificate::RobotTable;
use crate::file::certificate::TerminalCertificate;
use crate::file::schema::{CertifiedTable, ControllerTable, ModelKind, TerminalTable};
use crate::prepare::files::Files;
use crate::prepare::problem::dynamic;
use crate::prepare::rollout;
use crate::prepare::standing::Standing;
use ballbot::{Ballbot, ControllerSettings, GuaranteedSettings};
use lpvmpc::{GuaranteedIterations, Predictor, TerminalSet, Weights};
use lpvmpc_certificate::is_at_most;
use lpvmpc_certificate::read_certificate;
use nalgebra::{SMatrix, Vector4};
use std::fmt;
use std::path::Path;

const KEY: &str = "controller.terminal.certified";

/// Part of the bounds' width that programs keep away from them: what the rollout's integration error
/// may add up to, and too little to be seen.
const MARGIN: f64 = 4e-3;
/// Quadratic programs that look for a plan where none is known: at the start, after a push.
const SEARCH: usize = 30;
/// Price of a state bound exceeded by its width, in largest terminal costs of the set.
const SOFT_PRICE: f64 = 1e3;

/// What a certified terminal set makes of a controller.
pub(crate) struct Guarantee {
    /// The guaranteed controller's settings.
    pub settings: GuaranteedSettings<f64>,
    certificate: TerminalCertificate,
    file: Option<String>,
}

impl Guarantee {
    /// What is known of the certificate: to be asked last of all, since a proof may take minutes.
    ///
    /// # Errors
    /// A claim is false, or could not be shown.
    pub fn standing(&self, files: &dyn Files) -> Result<Standing, ScenarioError> {
        let Some(file) = &self.file else {
            return Ok(Standing::BuiltIn);
        };
        files.prove(file, &self.certificate)
    }
}

impl ControllerTable {
    /// The guaranteed controller, where the terminal set is certified.
    pub(crate) fn guaranteed(
        &self,
        ballbot: &Ballbot<f64>,
        settings: &ControllerSettings<f64>,
        files: &dyn Files,
    ) -> Result<Option<Guarantee>, ScenarioError> {
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
        table.guarantee(ballbot, settings, files).map(Some)
    }
}

/// A certificate, as it was written, with numbers that can be. It is not proved here: see
/// [`Files::prove`].
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
            let text = read_certificate(&path);
            let text = text.map_err(|source| ScenarioError::Read {
                path: path.clone(),
                source,
            })?;
            (path.display().to_string(), text)
        }
    };
    let refused = |error: &dyn fmt::Display| {
        ScenarioError::value(format!("{KEY}.certificate"), &origin, error.to_string())
    };
    let certificate = TerminalCertificate::from_json(&text).map_err(|error| refused(&error))?;
    TerminalCertificate::check_digest(&text).map_err(|error| refused(&error))?;
    certificate
        .check_numbers()
        .map_err(|error| refused(&error))?;
    Ok(certificate)
}

impl CertifiedTable {
    /// The guaranteed controller for the problem of `plain`.
    ///
    /// # Errors
    /// The certificate cannot be read, or is none of this robot, cost and bounds.
    fn guarantee(
        &self,
        ballbot: &Ballbot<f64>,
        plain: &ControllerSettings<f64>,
        files: &dyn Files,
    ) -> Result<Guarantee, ScenarioError> {
        let Predictor::StageConsistent(rk4) = plain.predictor else {
            return Err(ScenarioError::value(
                "controller.predictor",
                "(given)",
                "a guarantee needs the stage_consistent predictor, which is the default",
            ));
        };
        rollout::check_derivatives(ballbot, plain, rk4)?;
        let certificate = files.certificate(self.certificate.as_deref())?;
        check_plant(&certificate, ballbot, plain.t_s)?;
        check_cost(&certificate, &plain.weights)?;
        let terminal = TerminalSet {
            gain: certificate.terminal.k,
            p: certificate.terminal.p,
            level: certificate.terminal.level,
        };
        let room = check_bounds(&terminal, &certificate.state_limits, plain)?;
        let direction = Vector4::x();
        let stiffness = (terminal.p * direction).dot(&direction);
        let settings = GuaranteedSettings {
            t_s: plain.t_s,
            horizon: plain.horizon,
            rk4,
            rollout: rollout::accurate(ballbot, plain, &terminal, MARGIN, self.substeps)?,
            weights: plain.weights,
            terminal,
            x: plain.x,
            u: plain.u,
            direction,
            set_points: [plain.x.lower[0] + room, plain.x.upper[0] - room],
            offset_weight: self.offset_weight.unwrap_or(stiffness),
            margin: MARGIN,
            iterations: GuaranteedIterations {
                known: plain.iterations.most(),
                unknown: SEARCH.max(plain.iterations.most()),
            },
            soft_price: SOFT_PRICE * terminal.level,
            solver: plain.solver,
        };
        Ok(Guarantee {
            settings,
            certificate,
            file: self.certificate.clone(),
        })
    }
}

fn check_plant(
    certificate: &TerminalCertificate,
    ballbot: &Ballbot<f64>,
    t_s: f64,
) -> Result<(), ScenarioError> {
    let robot = RobotTable::try_from(ballbot)?;
    let pairs = robot.entries().into_iter().zip(certificate.plant.entries());
    for ((name, value), (_, certified)) in pairs {
        if value != certified {
            return Err(ScenarioError::value(
                format!("parameters.{name}"),
                value,
                format!(
                    "the certificate is of another robot, whose {name} is {certified}; write one of \
                     this robot with `ballbot certify` and name it as {KEY}.certificate"
                ),
            ));
        }
    }
    if certificate.t_s != t_s {
        let expected = format!("the certificate is for {} s", certificate.t_s);
        return Err(ScenarioError::value("controller.t_s", t_s, expected));
    }
    Ok(())
}

/// The certified decrease must pay for the stage cost: Q and R at most the certificate's, as
/// matrices.
fn check_cost(
    certificate: &TerminalCertificate,
    weights: &Weights<f64, 4, 1>,
) -> Result<(), ScenarioError> {
    if !is_at_most(&weights.q, &certificate.q) {
        return Err(ScenarioError::value(
            "controller.q",
            numbers(&weights.q.diagonal()),
            format!(
                "the certificate is for q = {}, and for less",
                rows(&certificate.q)
            ),
        ));
    }
    if !is_at_most(&weights.r, &certificate.r) {
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

/// The set, the motions between samples that start in it, and the law must lie within the bounds.
/// Returns how far the ball gets from the set point on either side: infinite where the certificate
/// does not say, and the bounds do not ask.
fn check_bounds(
    terminal: &TerminalSet<f64, 4, 1>,
    between_samples: &Vector4<f64>,
    plain: &ControllerSettings<f64>,
) -> Result<f64, ScenarioError> {
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
    let torque = reach(&terminal.gain);
    let (x, u) = (&plain.x, &plain.u);
    let rows = [
        ("theta_rad", between_samples[1], x.lower[1], x.upper[1]),
        ("phi_dot_rad_s", between_samples[2], x.lower[2], x.upper[2]),
        (
            "theta_dot_rad_s",
            between_samples[3],
            x.lower[3],
            x.upper[3],
        ),
        ("torque_nm", torque, u.lower[0], u.upper[0]),
    ];
    for (key, reach, lower, upper) in rows {
        // Negated, so that NaN fails.
        if !(lower <= -reach && reach <= upper) {
            return Err(ScenarioError::value(
                format!("bounds.{key}"),
                format!("[{lower}, {upper}]"),
                format!(
                    "what starts in the certified set reaches from {:.4} to {reach:.4}, as far as \
                     the certificate says; certify again within these bounds, or a smaller set \
                     with `ballbot certify --size`",
                    -reach
                ),
            ));
        }
    }
    let (lower, upper) = (x.lower[0], x.upper[0]);
    let room = between_samples[0];
    if !(lower.is_finite() || upper.is_finite()) {
        return Ok(room.min(reach(&Vector4::x().transpose())));
    }
    if !(room.is_finite() && upper - lower >= 2.0 * room) {
        return Err(ScenarioError::value(
            "bounds.phi_rad",
            format!("[{lower}, {upper}]"),
            format!(
                "what starts in the certified set around a set point is within {room:.4} rad of \
                 it, as far as the certificate says, and must fit in; `ballbot certify` writes \
                 certificates that say how far"
            ),
        ));
    }
    Ok(room)
}

fn numbers(values: &Vector4<f64>) -> String {
    format!("{:?}", values.as_slice())
}

/// The diagonal alone where there is nothing beside it.
fn rows(matrix: &SMatrix<f64, 4, 4>) -> String {
    let diagonal = matrix.diagonal();
    if *matrix == SMatrix::from_diagonal(&diagonal) {
        return numbers(&diagonal);
    }
    let rows: Vec<String> = matrix
        .row_iter()
        .map(|row| numbers(&row.transpose()))
        .collect();
    format!("[{}]", rows.join(", "))
}
