//! What was identified as plain numbers and words, for other programs: parameters with their intervals,
//! poles, residuals, verdicts. Units are part of the keys, or beside the values.

use crate::estimate::Status;
use crate::identification::Identification;
use crate::parameter::Parameter;
use crate::residuals::OUTPUTS;
use crate::robot::IdentifiedRobot;
use serde::{Serialize, Serializer};

/// A table whose entries keep their order.
type Entries<K, V> = Vec<(K, V)>;

/// An identified robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// What is odd about each log.
    pub logs: Vec<LogSummary>,
    /// Time that was fitted, s.
    pub fitted_s: f64,
    /// Time that was held back to judge the fit, s.
    pub held_back_s: f64,
    /// Segments of the fit.
    pub segments: usize,
    /// Values that were fitted.
    pub values: usize,
    /// Whether mechanics was imposed.
    pub physical: bool,
    /// l, m, as it was given.
    pub centre_of_mass_m: f64,
    /// r_b, m, as it was given.
    pub ball_radius_m: f64,
    /// r_w, m, as it was given.
    pub wheel_radius_m: f64,
    /// g, m/s^2, as it was given.
    pub gravity_m_s2: f64,
    /// The parameters that the planes share, by their keys: of one plane all.
    #[serde(serialize_with = "table")]
    pub parameters: Entries<&'static str, ParameterSummary>,
    /// What the only plane shows.
    #[serde(flatten)]
    pub only: Option<PlaneSummary>,
    /// What each plane of two shows, under its name.
    #[serde(serialize_with = "table", skip_serializing_if = "Vec::is_empty")]
    pub planes: Entries<&'static str, PlaneSummary>,
    /// All that is to be said, the gravest first.
    pub verdicts: Vec<VerdictSummary>,
}

/// What is odd about a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogSummary {
    /// Its name.
    pub log: String,
    /// In words.
    pub findings: Vec<String>,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterSummary {
    /// Its value.
    pub value: f64,
    /// The value's unit.
    pub unit: &'static str,
    /// What became of it: held, found, at its bound.
    pub status: &'static str,
    /// How well it was found, if it was.
    #[serde(flatten)]
    pub uncertainty: Option<Uncertainty>,
}

/// How well a parameter was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Uncertainty {
    /// In the parameter's unit.
    pub standard_deviation: f64,
    /// Its ends.
    pub interval_95: [f64; 2],
}

/// What one plane shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlaneSummary {
    /// Poles upright, 1/s.
    pub poles_1_s: Vec<PoleSummary>,
    /// Of each measured output.
    pub residuals: Vec<ResidualSummary>,
    /// Mean square of the normalised errors on the data that were held back, if any were and could be
    /// judged.
    pub held_back_chi_square: Option<f64>,
    /// The parameters that each plane of two has for itself.
    #[serde(serialize_with = "table", skip_serializing_if = "Vec::is_empty")]
    pub parameters: Entries<&'static str, ParameterSummary>,
}

/// A pole, 1/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoleSummary {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
    /// Standard deviation of the real part.
    pub standard_deviation_re: f64,
    /// Standard deviation of the imaginary part.
    pub standard_deviation_im: f64,
}

/// The residuals of an output, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResidualSummary {
    /// Its name.
    pub output: &'static str,
    /// Root mean square.
    pub rms: f64,
    /// Noise of the sensor.
    pub noise: f64,
    /// Whether they are white.
    pub white: bool,
}

/// A verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerdictSummary {
    /// How much it matters: good, note, warning, no result.
    pub weight: &'static str,
    /// In words.
    pub text: String,
    /// The plane that it is of, where it is not of the whole robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<&'static str>,
}

/// Entries as a table, in their order.
fn table<V: Serialize, S: Serializer>(
    entries: &Entries<&'static str, V>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(entries.iter().map(|(key, value)| (key, value)))
}

impl IdentifiedRobot {
    /// The robot and what speaks for and against it, in numbers and words.
    pub fn summary(&self) -> Summary {
        let first = self.first();
        let (fitted_s, held_back_s) = first.times;
        let logs = self
            .findings()
            .into_iter()
            .map(|(log, findings)| LogSummary {
                log,
                findings: findings.iter().map(ToString::to_string).collect(),
            });
        let is_own = |parameter: &Parameter| self.variables.is_own(*parameter);
        let alone = self.planes.len() == 1;
        let planes = self.planes.iter().enumerate().filter_map(|(place, plane)| {
            let mut shown = PlaneSummary::of(plane);
            shown.parameters = parameters(plane, is_own);
            Some((self.plane_name(place)?, shown))
        });
        let verdicts = self.verdicts().into_iter().map(|(plane, verdict)| {
            let text = verdict.to_string();
            VerdictSummary {
                weight: verdict.weight().word(),
                text,
                plane: plane.and_then(|plane| self.plane_name(plane)),
            }
        });
        Summary {
            logs: logs.collect(),
            fitted_s,
            held_back_s,
            segments: self.estimate().fit.initial.len(),
            values: self.estimate().fit.values,
            physical: first.physical,
            centre_of_mass_m: first.geometry.centre_of_mass,
            ball_radius_m: first.geometry.ball_radius,
            wheel_radius_m: first.geometry.wheel_radius,
            gravity_m_s2: first.geometry.gravity,
            parameters: parameters(first, |parameter| !is_own(parameter)),
            only: alone.then(|| PlaneSummary::of(first)),
            planes: planes.collect(),
            verdicts: verdicts.collect(),
        }
    }
}

impl PlaneSummary {
    /// Without parameters.
    fn of(plane: &Identification) -> Self {
        let poles = plane.poles.iter().map(|pole| PoleSummary {
            re: pole.value.re,
            im: pole.value.im,
            standard_deviation_re: pole.standard_deviation.0,
            standard_deviation_im: pole.standard_deviation.1,
        });
        let residuals = OUTPUTS.iter().zip(&plane.residuals);
        let residuals = residuals.map(|(output, residual)| ResidualSummary {
            output,
            rms: residual.spread,
            noise: residual.floor,
            white: residual.is_white(),
        });
        let validation = plane.validation.as_ref();
        let validation = validation.and_then(|validation| validation.as_ref().ok());
        Self {
            poles_1_s: poles.collect(),
            residuals: residuals.collect(),
            held_back_chi_square: validation.map(|validation| validation.chi_square),
            parameters: Vec::new(),
        }
    }
}

fn parameters(
    plane: &Identification,
    wanted: impl Fn(&Parameter) -> bool,
) -> Entries<&'static str, ParameterSummary> {
    let all = Parameter::ALL.into_iter().filter(wanted);
    all.map(|one| (one.key(), parameter(plane, one))).collect()
}

fn parameter(plane: &Identification, parameter: Parameter) -> ParameterSummary {
    let status = plane.estimate.status[parameter];
    let uncertainty = || {
        let (least, most) = plane.interval(parameter);
        Uncertainty {
            standard_deviation: plane.standard_deviation(parameter),
            interval_95: [least, most],
        }
    };
    ParameterSummary {
        value: plane.estimate.values[parameter],
        unit: parameter.unit(),
        status: status.word(),
        uncertainty: (status == Status::Found).then(uncertainty),
    }
}
