//! What a builder should know of a fit, in words.

use crate::coordinates::LONGEST_DELAY;
use crate::estimate::Status;
use crate::identification::Identification;
use crate::log::quantile;
use crate::parameter::Parameter;
use crate::residuals::{OUTPUTS, SegmentResidual};
use crate::structures::{Structure, best};
use lpvmpc_design::ShootingTermination;
use std::fmt;

/// How much a verdict matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// As it should be.
    Good,
    /// Worth knowing.
    Note,
    /// Do not use the result before this is understood.
    Warning,
}

/// One statement about a fit.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The iteration did not end at a minimum.
    NotConverged(ShootingTermination),
    /// The segments had to be shorter than was asked for.
    Shortened {
        /// Asked for, s.
        wanted: f64,
        /// Used, s.
        used: f64,
    },
    /// A stretch that the robot explains much worse than the rest.
    Disturbed {
        /// Number of the run, counted from 1.
        run: usize,
        /// From when to when, s.
        time: (f64, f64),
        /// Its residuals over those of the others.
        ratio: f64,
    },
    /// Residuals that are not white, and too few segments to take their scatter.
    TooShort {
        /// Segments.
        segments: usize,
        /// Parameters that were found.
        parameters: usize,
    },
    /// The held-back data could not be used.
    NotJudged(String),
    /// The residual is about the noise of the sensors.
    ResidualIsNoise {
        /// Residual over noise.
        normalised: f64,
    },
    /// The residual is more than the noise of the sensors.
    ResidualTooLarge {
        /// Which output.
        output: &'static str,
        /// Residual over noise.
        normalised: f64,
    },
    /// The residual is not white.
    Coloured {
        /// Which output.
        output: &'static str,
        /// Largest correlation with itself.
        correlation: f64,
        /// At so many rows.
        lag: isize,
    },
    /// A delay that was held at another value.
    DelayAlarm {
        /// Held at, s.
        held: f64,
        /// What the residuals ask for, s.
        wanted: f64,
        /// Over its standard deviation.
        significance: f64,
    },
    /// Another parameter that was held.
    HeldParameter {
        /// The parameter.
        parameter: Parameter,
        /// Held at.
        held: f64,
        /// What the residuals ask for.
        wanted: f64,
        /// Over its standard deviation.
        significance: f64,
    },
    /// Mechanics held a parameter at its bound.
    AtBound(Parameter),
    /// The log does not tell it well.
    Weak {
        /// The parameter.
        parameter: Parameter,
        /// Relative standard deviation.
        relative: f64,
        /// How many times the excitation 5 % needs.
        factor: f64,
    },
    /// It cannot be told from zero.
    IndistinctFromZero {
        /// The parameter.
        parameter: Parameter,
        /// Upper end of its interval.
        most: f64,
    },
    /// The log tells a delay badly.
    VagueDelay {
        /// Standard deviation, s.
        standard_deviation: f64,
    },
    /// Only a combination of two is known.
    Correlated {
        /// One.
        one: Parameter,
        /// The other.
        other: Parameter,
        /// Their correlation.
        correlation: f64,
    },
    /// No rigid body has these parameters.
    Unphysical(String),
    /// A rigid body has these parameters.
    Physical,
    /// Held-back data are explained as well.
    HeldBackGood {
        /// chi^2 per value.
        chi_square: f64,
    },
    /// Held-back data are explained worse.
    HeldBackBad {
        /// chi^2 per value.
        chi_square: f64,
    },
    /// Another structure explains held-back data better, or a smaller one as well.
    OtherStructure {
        /// The structure.
        structure: Structure,
        /// Its chi^2 per value on held-back data.
        chi_square: f64,
        /// That of this fit.
        own: f64,
    },
}

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

impl Identification {
    /// All that is to be said, the gravest first.
    pub fn verdicts(&self) -> Vec<Verdict> {
        let mut verdicts = Vec::new();
        self.judge_residuals(&mut verdicts);
        self.judge_held(&mut verdicts);
        self.judge_found(&mut verdicts);
        self.judge_held_back(&mut verdicts);
        let consistency = self.consistency();
        // The range of tilts is that of the paper's constraints.
        verdicts.push(if consistency.is_physical() {
            Verdict::Physical
        } else {
            Verdict::Unphysical(consistency.to_string())
        });
        verdicts.sort_by_key(|verdict| std::cmp::Reverse(verdict.weight()));
        verdicts
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
        if !self.is_white() && self.has_few_segments() {
            verdicts.push(Verdict::TooShort {
                segments: self.estimate.segments.len(),
                parameters: self.estimate.fit.reduced.indices.len(),
            });
        }
        verdicts.extend(self.disturbed());
        let mut noise = true;
        for (output, residual) in OUTPUTS.into_iter().zip(&self.residuals) {
            if residual.normalised() > TOO_LARGE {
                noise = false;
                verdicts.push(Verdict::ResidualTooLarge {
                    output,
                    normalised: residual.normalised(),
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
                },
            });
        }
    }

    fn judge_found(&self, verdicts: &mut Vec<Verdict>) {
        for parameter in Parameter::ALL {
            match self.estimate.status[parameter] {
                Status::Held => continue,
                // Without delay, noise wants a negative one half of the time.
                Status::AtBound
                    if parameter == Parameter::Delay
                        && self.estimate.values[parameter] < LONGEST_DELAY => {}
                Status::AtBound => verdicts.push(Verdict::AtBound(parameter)),
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

    fn judge_precision(&self, parameter: Parameter) -> Option<Verdict> {
        let (value, deviation) = (
            self.estimate.values[parameter],
            self.standard_deviation(parameter),
        );
        match parameter {
            Parameter::TiltOffset | Parameter::GyroBias | Parameter::TorqueBias => None,
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
            Verdict::HeldBackBad { chi_square }
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

/// Whether a deviation is above a limit; one that is no number is.
fn exceeds(deviation: f64, limit: f64) -> bool {
    deviation.is_nan() || deviation > limit
}

impl Verdict {
    /// How much it matters.
    pub fn weight(&self) -> Weight {
        match self {
            Self::NotConverged(_)
            | Self::Shortened { .. }
            | Self::NotJudged(_)
            | Self::TooShort { .. }
            | Self::Disturbed { .. }
            | Self::ResidualTooLarge { .. }
            | Self::DelayAlarm { .. }
            | Self::HeldParameter { .. }
            | Self::Unphysical(_)
            | Self::HeldBackBad { .. } => Weight::Warning,
            Self::Coloured { .. }
            | Self::AtBound(_)
            | Self::Weak { .. }
            | Self::IndistinctFromZero { .. }
            | Self::VagueDelay { .. }
            | Self::Correlated { .. }
            | Self::OtherStructure { .. } => Weight::Note,
            Self::ResidualIsNoise { .. } | Self::Physical | Self::HeldBackGood { .. } => {
                Weight::Good
            }
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotConverged(termination) => write!(
                f,
                "the fit did not converge: {termination}. Better starting values may help \
                 ([parameters] with start, or [body])"
            ),
            Self::Shortened { wanted, used } => write!(
                f,
                "the robot could not be simulated over {wanted} s, and was fitted in segments of {used} \
                 s: the model is far from the robot, or its unstable mode is very fast"
            ),
            Self::Disturbed { run, time, ratio } => write!(
                f,
                "run {run}, {:.2} s to {:.2} s: the residuals are {ratio:.1} times those of the rest. Was \
                 the robot pushed, or did the ball slip? Leave this part of the log out",
                time.0, time.1
            ),
            Self::TooShort {
                segments,
                parameters,
            } => write!(
                f,
                "the residuals are not white, and {segments} segments for {parameters} parameters are \
                 too few to take their scatter: the intervals are too narrow. Record for longer"
            ),
            Self::NotJudged(why) => write!(f, "the data held back could not be used: {why}"),
            Self::ResidualIsNoise { normalised } => write!(
                f,
                "the robot explains the log to {normalised:.2} times the noise of its sensors"
            ),
            Self::ResidualTooLarge { output, normalised } => write!(
                f,
                "the residual of the {output} is {normalised:.1} times the noise of the sensor: the \
                 model misses something (delay, friction, offset, saturation, slip, unit or sign)"
            ),
            Self::Coloured {
                output,
                correlation,
                lag,
            } => write!(
                f,
                "the residual of the {output} is not white (correlation {correlation:.2} over {lag} \
                 rows): a filtered sensor, disturbances, or a part of the model that is missing"
            ),
            Self::DelayAlarm {
                held,
                wanted,
                significance,
            } => write!(
                f,
                "delay alarm: the delay is held at {:.1} ms, the residuals ask for about {:.1} ms \
                 ({significance:.0} standard deviations). An ignored delay ruins the inertias: set \
                 delay_s = \"free\"",
                held * 1e3,
                wanted * 1e3
            ),
            Self::HeldParameter {
                parameter,
                held,
                wanted,
                significance,
            } => write!(
                f,
                "{} is held at {held:.4}, the residuals ask for about {wanted:.4} {} \
                 ({significance:.0} standard deviations): set {parameter} = \"free\", and see \
                 whether the other parameters stay",
                parameter.words(),
                parameter.unit()
            ),
            Self::AtBound(Parameter::Delay) => write!(
                f,
                "the delay is longer than the {LONGEST_DELAY} s that are looked at: are the columns \
                 shifted against each other?"
            ),
            Self::AtBound(parameter) => write!(
                f,
                "{} is held at its bound: the data alone want it beyond what mechanics allows",
                parameter.words()
            ),
            Self::Weak {
                parameter,
                relative,
                factor,
            } => write!(
                f,
                "this log tells {} to {:.0} % only: 5 % need {factor:.1} times the amplitude (or {:.0} \
                 times the length); what helps is {}",
                parameter.words(),
                100.0 * relative,
                factor * factor,
                parameter.excitation()
            ),
            Self::IndistinctFromZero { parameter, most } => write!(
                f,
                "{} cannot be told from zero; it is below {most:.2e} {}. What would tell it is {}",
                parameter.words(),
                parameter.unit(),
                parameter.excitation()
            ),
            Self::VagueDelay { standard_deviation } => write!(
                f,
                "this log tells the delay to {:.1} ms only; what helps is {}",
                standard_deviation * 1e3,
                Parameter::Delay.excitation()
            ),
            Self::Correlated {
                one,
                other,
                correlation,
            } => write!(
                f,
                "{one} and {other} have a correlation of {correlation:.3}: the log tells little more \
                 than one combination of them; fix one if you know it"
            ),
            Self::Unphysical(why) => f.write_str(why),
            Self::Physical => write!(f, "a rigid ballbot can have these parameters"),
            Self::HeldBackGood { chi_square } => write!(
                f,
                "the data held back are explained as well (chi^2 per value {chi_square:.2})"
            ),
            Self::HeldBackBad { chi_square } => write!(
                f,
                "the data held back are explained worse (chi^2 per value {chi_square:.2}, where 1 is \
                 right): the robot or its surroundings changed, or the model is wrong"
            ),
            Self::OtherStructure {
                structure,
                chi_square,
                own,
            } => write!(
                f,
                "on the data held back friction that is {} does {} (chi^2 per value {chi_square:.3} \
                 against {own:.3})",
                structure.words(),
                if *chi_square < own - 0.01 {
                    "better"
                } else {
                    "as well"
                }
            ),
        }
    }
}
