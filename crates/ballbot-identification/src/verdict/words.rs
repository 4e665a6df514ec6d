//! The verdicts' sentences.

use super::Verdict;
use crate::coordinates::LONGEST_DELAY;
use crate::parameter::Parameter;
use std::fmt;

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
