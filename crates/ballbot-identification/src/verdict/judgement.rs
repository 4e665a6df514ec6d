//! From numbers to verdicts. The one place of their limits.

use super::{Verdict, Weight};
use crate::estimate::Status;
use crate::identification::Identification;
use crate::log::quantile;
use crate::parameter::{Choice, Parameter};
use crate::residuals::{Difference, OUTPUTS, SegmentResidual};
use crate::structures::{Structure, best};
use crate::suspects::Suspect;
use lpvmpc_design::ShootingTermination;

/// Residual over noise from which on a model misses something.
const TOO_LARGE: f64 = 1.3;

/// Residuals of a segment over the usual ones from which on it stands out. Chance gives 1.2 with a
/// hundred rows.
const STANDS_OUT: f64 = 3.0;

/// A parameter known worse than this is weak.
const WEAK: f64 = 0.1;

/// What is asked of a good log.
const WANTED: f64 = 0.05;

/// A delay should be known to this, s.
const VAGUE_DELAY: f64 = 2e-3;

/// Held-back data may be explained so much worse, chi^2 per value.
const HELD_BACK: f64 = 1.3;

/// From here on, errors of twice those of the fit, what was fitted is not what is there.
const HELD_BACK_REFUSED: f64 = 4.0;

/// Residual over motion from which on a robot is not what moved.
const UNEXPLAINED: f64 = 0.5;

/// A relative error of the inertias that is no reason for a warning.
const SMALL_ERROR: f64 = 0.02;

/// A torque that holds the body at this tilt is no reason for a warning, rad.
const SMALL_TILT: f64 = 1e-3;

/// A parameter may be so many standard deviations from what was known of it.
const CONTRADICTED: f64 = 4.0;

/// From here on one of the two is wrong.
const REFUTED: f64 = 10.0;

/// A body's mass or inertia that is known worse than this, relative to itself, is not known.
const UNTOLD: f64 = 0.5;

impl Identification {
    /// All that is to be said, the gravest first.
    pub fn verdicts(&self) -> Vec<Verdict> {
        let mut verdicts = Vec::new();
        self.judge_residuals(&mut verdicts);
        self.judge_held(&mut verdicts);
        self.judge_priors(&mut verdicts);
        self.judge_found(&mut verdicts);
        self.judge_held_back(&mut verdicts);
        verdicts.extend(self.suspects.clone().map(|suspects| Verdict::WrongColumns {
            suspects,
            accepted: self.columns_accepted,
        }));
        verdicts.extend(self.judge_ball_angle());
        let consistency = self.consistency();
        // The range of tilts is that of the paper's constraints.
        if !consistency.is_physical() {
            verdicts.push(Verdict::Unphysical(consistency.to_string()));
        } else if !self.is_inertia_imposed() {
            verdicts.push(Verdict::Physical);
        }
        if verdicts.iter().any(|one| one.weight() == Weight::Refusal) {
            verdicts.retain(|one| one.weight() != Weight::Good);
        }
        verdicts.sort_by_key(|verdict| std::cmp::Reverse(verdict.rank()));
        verdicts
    }

    /// Whether the ball angle is relative to what was said.
    fn judge_ball_angle(&self) -> Option<Verdict> {
        let other = self.other_reading?;
        let reading = Suspect::BallAngle(other.ball_angle);
        if other.is_better() {
            Some(Verdict::OtherBallAngle {
                reading,
                better_by: other.better_by,
                accepted: self.columns_accepted,
            })
        } else if other.is_worse() || self.misfits() {
            None
        } else {
            Some(Verdict::BallAngleUntold {
                reading,
                b1: other.values[Parameter::B1],
            })
        }
    }

    /// Whether it is only the bounds of mechanics that make the inertias those of a rigid body.
    fn is_inertia_imposed(&self) -> bool {
        [Parameter::B1, Parameter::B2, Parameter::B3]
            .into_iter()
            .any(|inertia| self.estimate.status[inertia] == Status::AtBound)
    }

    fn judge_residuals(&self, verdicts: &mut Vec<Verdict>) {
        let termination = self.estimate.fit.termination;
        if termination != ShootingTermination::Converged {
            verdicts.push(Verdict::NotConverged(termination));
        }
        if self.estimate.segment < self.segment {
            verdicts.push(Verdict::Shortened {
                wanted: self.segment,
                used: self.estimate.segment,
            });
        }
        verdicts.extend(self.disturbed());
        let (mut noise, mut unexplained) = (true, None);
        for (output, residual) in OUTPUTS.into_iter().zip(&self.residuals) {
            if exceeds(residual.normalised(), TOO_LARGE) {
                noise = false;
                let part = residual.unexplained();
                if exceeds(part, UNEXPLAINED) {
                    unexplained = Some(Verdict::Unexplained { output, part });
                }
                verdicts.push(Verdict::ResidualTooLarge {
                    output,
                    normalised: residual.normalised(),
                    part,
                });
            }
            if !residual.is_white() {
                let (lag, correlation) = residual.autocorrelation.largest();
                verdicts.push(Verdict::Coloured {
                    output,
                    correlation,
                    lag,
                });
            }
        }
        verdicts.extend(unexplained);
        if noise {
            let normalised = self.normalised_residual();
            verdicts.push(Verdict::ResidualIsNoise { normalised });
        }
    }

    /// The worst segment, if it stands out.
    fn disturbed(&self) -> Option<Verdict> {
        let spread = |segment: &SegmentResidual| {
            let residuals = segment.measured.iter().zip(&segment.simulated);
            let squares = residuals
                .map(|(measured, simulated)| (measured - simulated).component_div(&self.floor))
                .flat_map(|residual| [residual[0], residual[1], residual[2]])
                .filter(|residual| !residual.is_nan())
                .map(|residual| residual * residual);
            let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), s| (sum + s, count + 1.0));
            (sum / f64::max(count, 1.0)).sqrt()
        };
        let spreads: Vec<f64> = self.simulated.iter().map(spread).collect();
        let usual = quantile(&mut spreads.clone(), 0.5);
        let worst = (0..spreads.len()).max_by(|a, b| spreads[*a].total_cmp(&spreads[*b]))?;
        let segment = &self.simulated[worst];
        let ratio = spreads[worst] / usual;
        let ends = segment.time.first().zip(segment.time.last())?;
        (ratio > STANDS_OUT).then_some(Verdict::Disturbed {
            run: segment.run + 1,
            time: (*ends.0, *ends.1),
            ratio,
        })
    }

    fn judge_held(&self, verdicts: &mut Vec<Verdict>) {
        for score in self.scores.iter().filter(|score| score.is_alarm()) {
            let significance = score.change.abs() / score.standard_deviation;
            let (held, wanted) = (score.held, score.held + score.change);
            verdicts.push(match score.parameter {
                Parameter::Delay => Verdict::DelayAlarm {
                    held,
                    wanted,
                    significance,
                },
                parameter => Verdict::HeldParameter {
                    parameter,
                    held,
                    wanted,
                    significance,
                    matters: self.matters(parameter, score.change),
                },
            });
        }
    }

    /// What is said of a parameter that the planes share and would rather not.
    pub(crate) fn planes_differ(&self, difference: &Difference) -> Verdict {
        let Difference {
            parameter,
            value,
            change,
            ..
        } = *difference;
        let relative = (change / value).abs();
        Verdict::PlanesDiffer {
            parameter,
            value,
            change,
            significance: difference.significance(),
            matters: self.matters(parameter, change) && exceeds(relative, WANTED),
        }
    }

    /// Whether a controller would notice that change of a parameter that was held.
    fn matters(&self, parameter: Parameter, change: f64) -> bool {
        let weight = self.geometry.gravity * self.geometry.centre_of_mass;
        let gain = self.estimate.values[Parameter::TorqueGain];
        match parameter {
            Parameter::CreepBall | Parameter::CreepTilt => self.creep_error() > SMALL_ERROR,
            Parameter::TorqueBias => (gain * change).abs() > SMALL_TILT * weight,
            Parameter::DriveCoulomb => change.abs() > SMALL_TILT * weight,
            _ => true,
        }
    }

    /// What was known beforehand, against what was found.
    fn judge_priors(&self, verdicts: &mut Vec<Verdict>) {
        for parameter in Parameter::ALL {
            let Choice::Prior {
                mean,
                standard_deviation,
            } = self.choices[parameter]
            else {
                continue;
            };
            let found = self.estimate.values[parameter];
            let significance = distance(parameter, found, mean, standard_deviation);
            if exceeds(significance, CONTRADICTED) {
                verdicts.push(Verdict::PriorContradicted {
                    parameter,
                    mean,
                    found,
                    significance,
                    refused: exceeds(significance, REFUTED),
                });
            }
        }
    }

    fn judge_found(&self, verdicts: &mut Vec<Verdict>) {
        if !self.torque_known {
            verdicts.push(Verdict::NoTorque);
        } else if matches!(self.choices[Parameter::TorqueGain], Choice::Free { .. }) {
            verdicts.push(Verdict::BodyNotWeighed);
        }
        for parameter in Parameter::ALL {
            match self.estimate.status[parameter] {
                Status::Held => continue,
                Status::AtBound if self.is_at_limit(parameter) => {
                    verdicts.push(Verdict::BeyondLimits {
                        parameter,
                        value: self.estimate.values[parameter],
                        masses: self.coordinates.masses(),
                        lever: self.geometry.centre_of_mass,
                    });
                }
                // Without delay, noise wants a negative one half of the time.
                Status::AtBound if parameter == Parameter::Delay => {}
                Status::AtBound => verdicts.push(Verdict::AtBound {
                    parameter,
                    // A ball without mass and a body without extension do not exist; wheels may
                    // be light.
                    refused: matches!(parameter, Parameter::B1 | Parameter::B3) && self.misfits(),
                }),
                Status::Found => verdicts.extend(self.judge_precision(parameter)),
            }
        }
        for (i, one) in Parameter::ALL.into_iter().enumerate() {
            for other in Parameter::ALL.into_iter().skip(i + 1) {
                let correlation = self.correlation(one, other);
                let vague = |parameter: Parameter| {
                    let value = self.estimate.values[parameter].abs();
                    exceeds(self.standard_deviation(parameter), WANTED * value)
                };
                // Two that are known well may be as correlated as they like.
                if correlation.abs() > 0.98 && (vague(one) || vague(other)) {
                    verdicts.push(Verdict::Correlated {
                        one,
                        other,
                        correlation,
                    });
                }
            }
        }
    }

    /// Whether more than noise is left of any output.
    fn misfits(&self) -> bool {
        let mut outputs = self.residuals.iter();
        outputs.any(|residual| exceeds(residual.normalised(), TOO_LARGE))
    }

    /// Whether the fit ended where no robot of these lengths is.
    fn is_at_limit(&self, parameter: Parameter) -> bool {
        let coordinate = self.estimate.coordinates[parameter.index()];
        self.coordinates.is_at_limit(parameter, coordinate)
    }

    fn judge_precision(&self, parameter: Parameter) -> Option<Verdict> {
        let (value, deviation) = (
            self.estimate.values[parameter],
            self.standard_deviation(parameter),
        );
        if !(value.is_finite() && deviation.is_finite()) {
            return Some(Verdict::Untold { parameter });
        }
        match parameter {
            Parameter::B1 | Parameter::B3 | Parameter::TorqueGain
                if exceeds(deviation, UNTOLD * value.abs()) =>
            {
                Some(Verdict::Untold { parameter })
            }
            Parameter::TiltOffset
            | Parameter::GyroBias
            | Parameter::TorqueBias
            | Parameter::CreepBall
            | Parameter::CreepTilt => None,
            Parameter::Delay => exceeds(deviation, VAGUE_DELAY).then_some(Verdict::VagueDelay {
                standard_deviation: deviation,
            }),
            Parameter::RollingFriction | Parameter::DriveFriction | Parameter::DriveCoulomb => {
                let (least, most) = self.interval(parameter);
                (least <= 0.0 && most >= 0.0)
                    .then_some(Verdict::IndistinctFromZero { parameter, most })
            }
            Parameter::B1 | Parameter::B2 | Parameter::B3 | Parameter::TorqueGain => {
                let relative = (deviation / value).abs();
                exceeds(relative, WEAK).then_some(Verdict::Weak {
                    parameter,
                    relative,
                    factor: relative / WANTED,
                })
            }
        }
    }

    fn judge_held_back(&self, verdicts: &mut Vec<Verdict>) {
        let validation = match &self.validation {
            None => return,
            Some(Err(error)) => return verdicts.push(Verdict::NotJudged(error.to_string())),
            Some(Ok(validation)) => validation,
        };
        let chi_square = validation.chi_square;
        verdicts.push(if chi_square <= HELD_BACK {
            Verdict::HeldBackGood { chi_square }
        } else {
            Verdict::HeldBackBad {
                chi_square,
                refused: exceeds(chi_square, HELD_BACK_REFUSED),
            }
        });
        let own = |structure: Structure| {
            [
                Parameter::RollingFriction,
                Parameter::DriveFriction,
                Parameter::DriveCoulomb,
            ]
            .into_iter()
            .all(|friction| {
                self.choices[friction].is_free() == structure.parameters().contains(&friction)
            })
        };
        if let Some(best) = best(&self.structures)
            && !own(best.structure)
        {
            verdicts.push(Verdict::OtherStructure {
                structure: best.structure,
                chi_square: best.validation.chi_square,
                own: chi_square,
            });
        }
    }
}

/// How many standard deviations a parameter is from what was known of it.
///
/// The gain is the inverse of a mass. One that is far too small, down to nothing, is never further away
/// than mean / standard deviation, while the mass goes to infinity. So the distance of the mass counts
/// where it is the larger one; to first order the mass is known as well as the gain, relative to itself.
fn distance(parameter: Parameter, found: f64, mean: f64, standard_deviation: f64) -> f64 {
    let distance = (found - mean).abs() / standard_deviation;
    match parameter {
        Parameter::TorqueGain => distance * f64::max(1.0, mean / found),
        _ => distance,
    }
}

/// Whether a value is above a limit; one that is NaN is.
fn exceeds(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}
