//! The fit itself: from runs and choices to parameters with their covariance.

use crate::coordinates::{Coordinates, LONGEST_DELAY};
use crate::joint::Joint;
use crate::log::{BallAngle, Run};
use crate::model::{Segment, SegmentedRuns};
use crate::parameter::{Choice, Parameter, Values};
use crate::segments::{Stretch, segments, spread};
use crate::start::{linear_fits, typical};
use crate::suspects::{Suspects, Tables};
use ballbot::Geometry;
use lpvmpc_design::number_text;
use lpvmpc_design::{
    Prior, ShootingError, ShootingFit, ShootingModel, ShootingProblem, ShootingSettings, Unknown,
};
use nalgebra::{DMatrix, Vector3, Vector4};

/// What is to be fitted, and to what.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// The runs.
    pub runs: &'a [Run],
    /// What phi is relative to.
    pub ball_angle: BallAngle,
    /// Lengths and gravity, known.
    pub geometry: Geometry<f64>,
    /// What is done with each parameter.
    pub choices: Values<Choice>,
    /// Only a robot that mechanics allows.
    pub physical: bool,
    /// Length of a segment, s.
    pub segment: f64,
    /// Whether the torque is in N m.
    pub torque_known: bool,
    /// Known noise of ball angle, tilt and tilt rate, for the weights; what is `None` is found.
    pub noise: [Option<f64>; 3],
    /// Where the columns are configured, for messages.
    pub tables: Tables,
}

/// A fitted robot, as one plane shows it.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// All parameters, held ones included.
    pub values: Values,
    /// Their covariance from the information of the fit, in the order of [`Parameter::ALL`]; zero for
    /// what was held, by choice or at a bound.
    pub covariance: DMatrix<f64>,
    /// Their covariance from the scatter of the segments, never below that of the information: for
    /// coloured residuals.
    pub scatter_covariance: DMatrix<f64>,
    /// What became of each parameter.
    pub status: Values<Status>,
    /// Standard deviation of the residuals of ball angle, tilt and tilt rate.
    pub spread: Vector3<f64>,
    /// What the outputs are weighted by: what was known of their noise, otherwise the spread, that of
    /// the ball angle times the root of how many rows of coloured residuals count as one.
    pub noise: Vector3<f64>,
    /// Where the fit ended, in its coordinates.
    pub coordinates: Vec<f64>,
    /// The fit, of all planes that were fitted together.
    pub fit: ShootingFit<4>,
    /// This plane's segments.
    pub segments: Vec<Segment>,
    /// Their initial states.
    pub initial: Vec<Vector4<f64>>,
    /// Length of a segment, s; less than was asked for if the robot could not be simulated so long.
    pub segment: f64,
}

/// A fit to a few short segments, weighted by the noise that the sensors have by themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coarse {
    /// All parameters, held ones included.
    pub values: Values,
    /// chi^2 per degree of freedom: 1 if a robot explains the log.
    pub chi_square: f64,
}

/// What became of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Held by choice.
    Held,
    /// Found.
    Found,
    /// Wanted beyond what mechanics allows, and was held at the bound.
    AtBound,
}

impl Status {
    /// In a word or two.
    pub fn word(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Found => "found",
            Self::AtBound => "at its bound",
        }
    }
}

/// Why there is no estimate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimateError {
    /// The segments are longer than what there is.
    #[error(
        "no stretch of the log is long enough for a segment of {segment} s after the first {lead} s",
        segment = number_text(*segment),
        lead = number_text(*lead)
    )]
    NoSegments {
        /// Length of a segment, s.
        segment: f64,
        /// Left out at the begin, s.
        lead: f64,
    },
    /// No start from which the robot can be simulated.
    #[error(
        "from none of the starting values can the log be simulated: {0}. Are units, signs and \
         lengths right?"
    )]
    NoStart(ShootingError),
    /// The fit.
    #[error(transparent)]
    Shooting(#[from] ShootingError),
    /// Of one plane of two.
    #[error("plane {plane}: {error}")]
    Plane {
        /// The plane, x or y.
        plane: &'static str,
        /// What is wrong with it.
        error: Box<EstimateError>,
    },
    /// No robot explains the log as it is, but one would if its columns were others.
    #[error("{error} A robot explains the log if {suspects}")]
    Suspect {
        /// What is wrong.
        suspects: Suspects,
        /// Why there is no estimate as it is.
        error: Box<EstimateError>,
    },
}

impl EstimateError {
    /// Whether there is nothing to fit, whatever the columns are.
    pub(crate) fn is_too_short(&self) -> bool {
        match self {
            Self::NoSegments { .. } => true,
            Self::Plane { error, .. } => error.is_too_short(),
            _ => false,
        }
    }
}

/// Told the number of steps of the fit so far.
pub type Progress<'a> = &'a dyn Fn(usize);

/// Segments of the first, coarse fit: so short that the unstable mode hardly grows, so few that
/// trying several starts costs nothing, s.
pub(crate) const COARSE: f64 = 0.25;
pub(crate) const START: Effort = Effort {
    segments: 80,
    max_iterations: 40,
};

/// How much a coarse fit may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Segments, at most.
    pub segments: usize,
    /// Steps from each start, at most.
    pub max_iterations: usize,
}

impl Task<'_> {
    /// Time at the begin of a stretch whose torque a delay may need, s.
    pub fn lead(&self) -> f64 {
        match self.choices[Parameter::Delay] {
            Choice::Fixed(delay) => delay,
            _ => LONGEST_DELAY,
        }
    }

    /// Fits the robot to these stretches. `floor` is the noise to begin with.
    ///
    /// # Errors
    /// [`EstimateError`].
    pub fn estimate(
        &self,
        stretches: &[Stretch],
        floor: Vector3<f64>,
        progress: Progress<'_>,
    ) -> Result<Estimate, EstimateError> {
        let alone = Joint::alone(self.clone());
        let estimate = alone.estimate(&[stretches], &[floor], progress)?;
        Ok(estimate.first())
    }

    /// The runs cut into segments, as data of a fit.
    pub fn model(&self, segments: Vec<Segment>, noise: Vector3<f64>) -> SegmentedRuns<'_> {
        SegmentedRuns {
            runs: self.runs,
            segments,
            coordinates: Coordinates::new(&self.choices, self.geometry, self.torque_known),
            ball_angle: self.ball_angle,
            noise,
        }
    }

    /// The best of several starts after a coarse fit.
    ///
    /// # Errors
    /// [`EstimateError::NoSegments`] or [`EstimateError::NoStart`].
    pub fn coarse(
        &self,
        stretches: &[Stretch],
        floor: Vector3<f64>,
        effort: Effort,
        progress: Progress<'_>,
    ) -> Result<Coarse, EstimateError> {
        let lead = self.lead();
        let coarse = segments(self.runs, stretches, COARSE, lead);
        if coarse.is_empty() {
            return Err(EstimateError::NoSegments {
                segment: COARSE,
                lead,
            });
        }
        let model = self.model(spread(&coarse, effort.segments), self.known(floor));
        let priors = self.priors(&model.coordinates);
        let mut best: Option<Coarse> = None;
        let mut refused = None;
        let settings = ShootingSettings {
            reduction_tolerance: 1e-2,
            max_iterations: effort.max_iterations,
        };
        for start in self.candidates(stretches) {
            let unknowns = self.unknowns(&start, &model.coordinates);
            let start = model.coordinates.values(&starts(&unknowns));
            let problem = problem(&model, &unknowns, &priors);
            match problem.fit(model.initial_states(&start), &settings, progress) {
                Ok(fit) => {
                    let chi_square = fit.chi_square / fit.degrees_of_freedom();
                    if best.is_none_or(|best| chi_square < best.chi_square) {
                        best = Some(Coarse {
                            values: model.coordinates.values(&fit.parameters),
                            chi_square,
                        });
                    }
                }
                Err(error) => refused = Some(error),
            }
        }
        match (best, refused) {
            (Some(best), _) => Ok(best),
            (None, Some(error)) => Err(EstimateError::NoStart(error)),
            (None, None) => Ok(Coarse {
                values: typical(&self.geometry, 0.0),
                chi_square: f64::INFINITY,
            }),
        }
    }

    /// Where the coarse fits start.
    fn candidates(&self, stretches: &[Stretch]) -> Vec<Values> {
        let delay = match self.choices[Parameter::Delay] {
            Choice::Fixed(delay) => Some(delay),
            Choice::Free { start } => start,
            Choice::Prior { mean, .. } => Some(mean),
        };
        let fits = linear_fits(self.runs, stretches, self.ball_angle, delay);
        let best = fits.first().map_or(0.0, |fit| fit.delay);
        let mut candidates = vec![typical(&self.geometry, delay.unwrap_or(best))];
        let robots = fits.iter().filter_map(|fit| fit.robot(&self.geometry));
        candidates.extend(robots.take(2));
        candidates
    }

    /// Known noise before found noise.
    pub(crate) fn known(&self, found: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|output, _| self.noise[output].unwrap_or(found[output]))
    }

    /// The unknowns of the fit, from a start that the choices overrule and mechanics bounds.
    pub fn unknowns(&self, start: &Values, coordinates: &Coordinates) -> Vec<Unknown> {
        let mut values = *start;
        for parameter in Parameter::ALL {
            let value = &mut values[parameter];
            match self.choices[parameter] {
                Choice::Fixed(fixed) => *value = fixed,
                Choice::Free { start: Some(start) } => *value = start,
                Choice::Free { start: None } => {}
                // A prior is a start only where nothing was found.
                Choice::Prior { mean, .. } if !value.is_finite() => *value = mean,
                Choice::Prior { .. } => {}
            }
        }
        let bounds = coordinates.bounds(&values, self.physical);
        let scales = coordinates.scales();
        let starts = coordinates.of(&values);
        let unknown = |parameter: Parameter| {
            let free = self.choices[parameter].is_free();
            let (lower, upper) = if free {
                bounds[parameter]
            } else {
                (f64::NEG_INFINITY, f64::INFINITY)
            };
            Unknown {
                start: starts[parameter.index()].max(lower).min(upper),
                lower,
                upper,
                scale: scales[parameter],
                free,
                // Where the torque changes at a row or at a step of the integration, the tilt rate there
                // begins to change at once.
                kinked: parameter == Parameter::Delay,
            }
        };
        Parameter::ALL.map(unknown).to_vec()
    }

    /// What is known of a parameter beforehand, in the fit's coordinates.
    pub(crate) fn prior(&self, parameter: Parameter, coordinates: &Coordinates) -> Option<Prior> {
        let Choice::Prior {
            mean,
            standard_deviation,
        } = self.choices[parameter]
        else {
            return None;
        };
        let jacobian = coordinates.jacobian();
        let origin = coordinates.values(&[0.0; Parameter::ALL.len()]);
        Some(Prior {
            coefficients: jacobian.row(parameter.index()).iter().copied().collect(),
            mean: mean - origin[parameter],
            standard_deviation,
        })
    }

    /// What is known of all parameters beforehand.
    pub fn priors(&self, coordinates: &Coordinates) -> Vec<Prior> {
        let all = Parameter::ALL.into_iter();
        all.filter_map(|parameter| self.prior(parameter, coordinates))
            .collect()
    }
}

/// The fit's problem.
pub fn problem<'a, M: ShootingModel<4, 3>>(
    model: &'a M,
    unknowns: &'a [Unknown],
    priors: &'a [Prior],
) -> ShootingProblem<'a, M, 4, 3> {
    ShootingProblem {
        model,
        unknowns,
        priors,
        state_scale: Vector4::repeat(1.0),
    }
}

fn starts(unknowns: &[Unknown]) -> Vec<f64> {
    unknowns.iter().map(|unknown| unknown.start).collect()
}
