//! What a builder should know of a fit, in words.

mod judgement;

use crate::coordinates::LONGEST_DELAY;
use crate::parameter::Parameter;
use crate::structures::Structure;
use lpvmpc_design::ShootingTermination;
use thiserror::Error;

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

/// One statement about a fit; its sentence is its `Display`.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Verdict {
    /// The iteration did not end at a minimum.
    #[error(
        "the fit did not converge: {0}. Better starting values may help ([parameters] with start, or [body])"
    )]
    NotConverged(ShootingTermination),
    /// The segments had to be shorter than was asked for.
    #[error(
        "the robot could not be simulated over {wanted} s, and was fitted in segments of {used} s: the model is far from the robot, or its unstable mode is very fast"
    )]
    Shortened {
        /// Asked for, s.
        wanted: f64,
        /// Used, s.
        used: f64,
    },
    /// A stretch that the robot explains much worse than the rest.
    #[error("run {run}, {:.2} s to {:.2} s: the residuals are {ratio:.1} times those of the rest. Was the robot pushed, or did the ball slip? Leave this part of the log out", time.0, time.1)]
    Disturbed {
        /// Number of the run, counted from 1.
        run: usize,
        /// From when to when, s.
        time: (f64, f64),
        /// Its residuals over those of the others.
        ratio: f64,
    },
    /// Residuals that are not white, and too few segments to take their scatter.
    #[error(
        "the residuals are not white, and {segments} segments for {parameters} parameters are too few to take their scatter: the intervals are too narrow. Record for longer"
    )]
    TooShort {
        /// Segments.
        segments: usize,
        /// Parameters that were found.
        parameters: usize,
    },
    /// The held-back data could not be used.
    #[error("the data held back could not be used: {0}")]
    NotJudged(String),
    /// The residual is about the noise of the sensors.
    #[error("the robot explains the log to {normalised:.2} times the noise of its sensors")]
    ResidualIsNoise {
        /// Residual over noise.
        normalised: f64,
    },
    /// The residual is more than the noise of the sensors.
    #[error(
        "the residual of the {output} is {normalised:.1} times the noise of the sensor: the model misses something (delay, friction, offset, saturation, slip, unit or sign)"
    )]
    ResidualTooLarge {
        /// Which output.
        output: &'static str,
        /// Residual over noise.
        normalised: f64,
    },
    /// The residual is not white.
    #[error(
        "the residual of the {output} is not white (correlation {correlation:.2} over {lag} rows): a filtered sensor, disturbances, or a part of the model that is missing"
    )]
    Coloured {
        /// Which output.
        output: &'static str,
        /// Largest correlation with itself.
        correlation: f64,
        /// At so many rows.
        lag: isize,
    },
    /// A delay that was held at another value.
    #[error("delay alarm: the delay is held at {:.1} ms, the residuals ask for about {:.1} ms ({significance:.0} standard deviations). An ignored delay ruins the inertias: set delay_s = \"free\"", held * 1e3, wanted * 1e3)]
    DelayAlarm {
        /// Held at, s.
        held: f64,
        /// What the residuals ask for, s.
        wanted: f64,
        /// Over its standard deviation.
        significance: f64,
    },
    /// Another parameter that was held.
    #[error("{} is held at {held:.4}, the residuals ask for about {wanted:.4} {} ({significance:.0} standard deviations): set {parameter} = \"free\", and see whether the other parameters stay", parameter.words(), parameter.unit())]
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
    #[error("{}", at_bound(*.0))]
    AtBound(Parameter),
    /// The log does not tell it well.
    #[error("this log tells {} to {:.0} % only: 5 % need {factor:.1} times the amplitude (or {:.0} times the length); what helps is {}", parameter.words(), 100.0 * relative, factor * factor, parameter.excitation())]
    Weak {
        /// The parameter.
        parameter: Parameter,
        /// Relative standard deviation.
        relative: f64,
        /// How many times the excitation 5 % needs.
        factor: f64,
    },
    /// It cannot be told from zero.
    #[error("{} cannot be told from zero; it is below {most:.2e} {}. What would tell it is {}", parameter.words(), parameter.unit(), parameter.excitation())]
    IndistinctFromZero {
        /// The parameter.
        parameter: Parameter,
        /// Upper end of its interval.
        most: f64,
    },
    /// The log tells a delay badly.
    #[error("this log tells the delay to {:.1} ms only; what helps is {}", standard_deviation * 1e3, Parameter::Delay.excitation())]
    VagueDelay {
        /// Standard deviation, s.
        standard_deviation: f64,
    },
    /// Only a combination of two is known.
    #[error(
        "{one} and {other} have a correlation of {correlation:.3}: the log tells little more than one combination of them; fix one if you know it"
    )]
    Correlated {
        /// One.
        one: Parameter,
        /// The other.
        other: Parameter,
        /// Their correlation.
        correlation: f64,
    },
    /// No rigid body has these parameters.
    #[error("{0}")]
    Unphysical(String),
    /// A rigid body has these parameters.
    #[error("a rigid ballbot can have these parameters")]
    Physical,
    /// Held-back data are explained as well.
    #[error("the data held back are explained as well (chi^2 per value {chi_square:.2})")]
    HeldBackGood {
        /// chi^2 per value.
        chi_square: f64,
    },
    /// Held-back data are explained worse.
    #[error(
        "the data held back are explained worse (chi^2 per value {chi_square:.2}, where 1 is right): the robot or its surroundings changed, or the model is wrong"
    )]
    HeldBackBad {
        /// chi^2 per value.
        chi_square: f64,
    },
    /// Another structure explains held-back data better, or a smaller one as well.
    #[error("on the data held back friction that is {} does {} (chi^2 per value {chi_square:.3} against {own:.3})", structure.words(), if *chi_square < own - 0.01 { "better" } else { "as well" })]
    OtherStructure {
        /// The structure.
        structure: Structure,
        /// Its chi^2 per value on held-back data.
        chi_square: f64,
        /// That of this fit.
        own: f64,
    },
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

fn at_bound(parameter: Parameter) -> String {
    match parameter {
        Parameter::Delay => format!(
            "the delay is longer than the {LONGEST_DELAY} s that are looked at: are the columns \
             shifted against each other?"
        ),
        _ => format!(
            "{} is held at its bound: the data alone want it beyond what mechanics allows",
            parameter.words()
        ),
    }
}
