//! What a builder should know of a fit, in words.

mod judgement;
mod words;

use crate::parameter::Parameter;
use crate::structures::Structure;
use lpvmpc_design::ShootingTermination;

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
