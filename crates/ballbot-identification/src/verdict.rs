//! What a builder should know of a fit, in words.

mod judgement;

use crate::ball_angle::DECIDES;
use crate::coordinates::LONGEST_DELAY;
use crate::parameter::Parameter;
use crate::structures::Structure;
use crate::suspects::{Suspect, Suspects, Tables};
use crate::words::{number, percent, times};
use lpvmpc_design::ShootingTermination;
use lpvmpc_design::number_text;
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
    /// There is no result: what was found is no robot, or none that the log tells.
    Refusal,
}

impl Weight {
    /// In a word or two.
    pub fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Refusal => "no result",
        }
    }

    /// How a verdict is introduced.
    pub fn mark(self) -> &'static str {
        match self {
            Self::Good => "good:",
            Self::Note => "note:",
            Self::Warning => "WARNING:",
            Self::Refusal => "NO RESULT:",
        }
    }
}

/// One statement about a fit; its sentence is its `Display`.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Verdict {
    /// The iteration did not end at a minimum.
    #[error(
        "the fit did not converge: {0}. Better starting values may help ([parameters] with start, or [body]), if signs, units and lengths are right and it is the log of a ballbot"
    )]
    NotConverged(ShootingTermination),
    /// A robot would explain the log if its columns were others.
    #[error("a robot explains the log much better if {suspects}{}", if *accepted { "" } else { ACCEPT })]
    WrongColumns {
        /// What is wrong.
        suspects: Suspects,
        /// The builder insists on the columns as they are.
        accepted: bool,
    },
    /// The log speaks for the other reading of the ball angle.
    #[error("the log is explained better (chi^2 lower by {better_by:.0}, where {DECIDES:.0} is no chance) by another robot if {}{}", reading.words(Tables::default()), if *accepted { "" } else { ACCEPT })]
    OtherBallAngle {
        /// The other reading.
        reading: Suspect,
        /// By how much chi^2 is lower with it.
        better_by: f64,
        /// The builder insists on the columns as they are.
        accepted: bool,
    },
    /// The log does not tell what the ball angle is relative to.
    #[error("the log is explained as well by another robot (b1 = {} m^2) if {}. Weigh the body, and set body_mass_kg in [body]; or log with a larger torque", number(*b1), reading.words(Tables::default()))]
    BallAngleUntold {
        /// The other reading.
        reading: Suspect,
        /// b1 of the robot that fits with it, m^2.
        b1: f64,
    },
    /// A parameter ended where no robot is.
    #[error("{}", beyond(*parameter, *value, masses, *lever))]
    BeyondLimits {
        /// The parameter.
        parameter: Parameter,
        /// Its value.
        value: f64,
        /// The lightest and the heaviest body of this size, kg.
        masses: (f64, f64),
        /// Height of the centre of mass, m.
        lever: f64,
    },
    /// What was found is not what was known beforehand.
    #[error("{} was expected at {} and is found at {} {}, {} standard deviations away: {}", parameter.words(), number(*mean), number(*found), parameter.unit(), times(*significance), contradiction(*parameter))]
    PriorContradicted {
        /// The parameter.
        parameter: Parameter,
        /// Expected.
        mean: f64,
        /// Found.
        found: f64,
        /// The difference over the standard deviation of what was known.
        significance: f64,
        /// No uncertainty of what was known explains it.
        refused: bool,
    },
    /// The log does not tell a parameter at all.
    #[error("the log does not determine {}: hold {parameter} at what you know of it, in [parameters]", parameter.words())]
    Untold {
        /// The parameter.
        parameter: Parameter,
    },
    /// The motion is not that of a robot under this torque.
    #[error(
        "no robot explains the {output}: {} of its motion is left. Do the columns belong together \
         (one plane: the tilt about the axis about which the torque acts), and is it the log of a \
         ballbot of these lengths?", percent(*part)
    )]
    Unexplained {
        /// Which output.
        output: &'static str,
        /// Residual over motion.
        part: f64,
    },
    /// The segments had to be shorter than was asked for.
    #[error(
        "the robot could not be simulated over {wanted} s, and was fitted in segments of {used} s: the model is far from the robot, or its unstable mode is very fast",
        wanted = number_text(*wanted),
        used = number_text(*used)
    )]
    Shortened {
        /// Asked for, s.
        wanted: f64,
        /// Used, s.
        used: f64,
    },
    /// A stretch that the robot explains much worse than the rest.
    #[error("run {run}, {:.2} s to {:.2} s: the residuals are {} times those of the rest. Was the robot pushed, or did the ball slip? Leave this part of the log out: --leave-out {run}:{:.2},{:.2}", time.0, time.1, times(*ratio), time.0, time.1)]
    Disturbed {
        /// Number of the run, counted from 1.
        run: usize,
        /// From when to when, s.
        time: (f64, f64),
        /// Its residuals over those of the others.
        ratio: f64,
    },
    /// The held-back data could not be used.
    #[error("the data held back could not be used: {0}")]
    NotJudged(String),
    /// The residual is about the noise of the sensors.
    #[error("the robot explains the log to {} times the noise of its sensors", times(*normalised))]
    ResidualIsNoise {
        /// Residual over noise.
        normalised: f64,
    },
    /// The residual is more than the noise of the sensors.
    #[error(
        "the residual of the {output} is {} times the noise of the sensor and {} of the motion: {}; the intervals are widened for it", times(*normalised), percent(*part), if *part > MATTERS { "the model misses something (delay, friction, offset, saturation, slip, unit or sign)" } else { "small beside the motion, as of contacts that creep or gears with play" }
    )]
    ResidualTooLarge {
        /// Which output.
        output: &'static str,
        /// Residual over noise.
        normalised: f64,
        /// Residual over motion.
        part: f64,
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
    #[error("delay alarm: the delay is held at {:.1} ms, the residuals ask for about {:.1} ms ({} standard deviations). An ignored delay ruins the inertias: set delay_s = \"free\"", held * 1e3, wanted * 1e3, times(*significance))]
    DelayAlarm {
        /// Held at, s.
        held: f64,
        /// What the residuals ask for, s.
        wanted: f64,
        /// Over its standard deviation.
        significance: f64,
    },
    /// Another parameter that was held.
    #[error("{} is held at {}, the residuals ask for about {} {} ({} standard deviations): {}", parameter.words(), number(*held), number(*wanted), parameter.unit(), times(*significance), advice(*parameter))]
    HeldParameter {
        /// The parameter.
        parameter: Parameter,
        /// Held at.
        held: f64,
        /// What the residuals ask for.
        wanted: f64,
        /// Over its standard deviation.
        significance: f64,
        /// The difference is one that a controller would notice.
        matters: bool,
    },
    /// A parameter that the planes share, and that they want to be two.
    #[error("{} is one for both planes, {}, and the plane y asks for {} {} more ({} standard deviations): {}", parameter.words(), number(*value), number(*change), parameter.unit(), times(*significance), if *parameter == Parameter::B3 { "the body is not symmetric; set symmetric_body = false in [fit]" } else { "the wheels are not alike, or stand otherwise than is said, or something in one of the planes is not as it should be" })]
    PlanesDiffer {
        /// The parameter.
        parameter: Parameter,
        /// Its value, of both planes.
        value: f64,
        /// By how much that of the plane y would be larger.
        change: f64,
        /// Over its standard deviation.
        significance: f64,
        /// The difference is one that a controller would notice.
        matters: bool,
    },
    /// Nothing is said of the body's mass.
    #[error(
        "the body's mass is not given: weigh the body, and set body_mass_kg in [body]. Without it the \
         torque gain and the inertias are told from each other by little, and contacts that creep \
         shift them together by tens of per cent, beyond their intervals"
    )]
    BodyNotWeighed,
    /// A voltage or a duty cycle of unknown torque.
    #[error(
        "the torque is given by a current, a voltage or a duty cycle without the torque per unit: the \
         torque gain is per that unit, the back-EMF is in the friction of the drive, and a controller \
         made from these parameters decides on that unit, not on N m"
    )]
    NoTorque,
    /// Mechanics held a parameter at its bound.
    #[error("{} is held at its bound: the data alone want it beyond what mechanics allows{}", parameter.words(), if *refused { NO_ROBOT_WITHIN } else { "" })]
    AtBound {
        /// The parameter.
        parameter: Parameter,
        /// And so it does not explain the log.
        refused: bool,
    },
    /// The log does not tell it well.
    #[error("this log determines {} only to within {}: 5 % need {} times the amplitude (or {} times the length); what helps is {}", parameter.words(), percent(*relative), times(*factor), times(factor * factor), parameter.excitation())]
    Weak {
        /// The parameter.
        parameter: Parameter,
        /// Relative standard deviation.
        relative: f64,
        /// How many times the excitation 5 % needs.
        factor: f64,
    },
    /// It cannot be told from zero.
    #[error("{} cannot be distinguished from zero; it is below {} {}. What would determine it is {}", parameter.words(), number(*most), parameter.unit(), parameter.excitation())]
    IndistinctFromZero {
        /// The parameter.
        parameter: Parameter,
        /// Upper end of its interval.
        most: f64,
    },
    /// The log tells a delay badly.
    #[error("this log determines the delay only to within {:.1} ms; what helps is {}", standard_deviation * 1e3, Parameter::Delay.excitation())]
    VagueDelay {
        /// Standard deviation, s.
        standard_deviation: f64,
    },
    /// Only a combination of two is known.
    #[error(
        "{one} and {other} have a correlation of {correlation:.3}: the log determines little more than one combination of them; fix one if you know it"
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
    #[error("the data held back are explained as well (chi^2 per value {})", times(*chi_square))]
    HeldBackGood {
        /// chi^2 per value.
        chi_square: f64,
    },
    /// Held-back data are explained worse.
    #[error(
        "the data held back are explained worse (chi^2 per value {}, where 1 is right{}): the robot or its surroundings changed, or the model is wrong", times(*chi_square), if *refused { HELD_BACK_LIMIT } else { "" }
    )]
    HeldBackBad {
        /// chi^2 per value.
        chi_square: f64,
        /// It is beyond what can be a robot's.
        refused: bool,
    },
    /// Another structure explains held-back data better, or a smaller one as well.
    #[error("on the data held back friction that is {} does {} (chi^2 per value {} against {})", structure.words(), if *chi_square < own - 0.01 { "better" } else { "as well" }, times(*chi_square), times(*own))]
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
    /// What comes before what: by weight, and a wrong column, which is the cause of all else, first.
    pub(crate) fn rank(&self) -> (Weight, bool) {
        let cause = matches!(
            self,
            Self::WrongColumns { .. } | Self::OtherBallAngle { .. }
        );
        (self.weight(), cause)
    }

    /// How much it matters.
    pub fn weight(&self) -> Weight {
        match self {
            Self::NotConverged(_)
            | Self::WrongColumns {
                accepted: false, ..
            }
            | Self::OtherBallAngle {
                accepted: false, ..
            }
            | Self::BeyondLimits { .. }
            | Self::Untold { .. }
            | Self::Unexplained { .. }
            | Self::PriorContradicted { refused: true, .. }
            | Self::AtBound { refused: true, .. }
            | Self::HeldBackBad { refused: true, .. } => Weight::Refusal,
            Self::Shortened { .. }
            | Self::WrongColumns { .. }
            | Self::OtherBallAngle { .. }
            | Self::BallAngleUntold { .. }
            | Self::PriorContradicted { .. }
            | Self::NotJudged(_)
            | Self::Disturbed { .. }
            | Self::DelayAlarm { .. }
            | Self::HeldParameter { matters: true, .. }
            | Self::PlanesDiffer { matters: true, .. }
            | Self::Unphysical(_)
            | Self::HeldBackBad { .. } => Weight::Warning,
            Self::ResidualTooLarge { part, .. } => {
                if *part > MATTERS {
                    Weight::Warning
                } else {
                    Weight::Note
                }
            }
            Self::Coloured { .. }
            | Self::HeldParameter { .. }
            | Self::PlanesDiffer { .. }
            | Self::BodyNotWeighed
            | Self::NoTorque
            | Self::AtBound { .. }
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

/// A residual is a part of the motion that the model should have, not an imperfection of the robot,
/// from this part on.
const MATTERS: f64 = 0.1;

const ACCEPT: &str = " (or accept_suspicious_units = true there, if they are right)";

const NO_ROBOT_WITHIN: &str = ", and no robot within that explains them: the mass, a length, a unit or \
    what ball_angle is relative to is wrong, or the contacts slip";

const HELD_BACK_LIMIT: &str = " and 4 the most that is accepted";

/// What to do about a parameter that was held elsewhere than the residuals want it.
fn advice(parameter: Parameter) -> String {
    match parameter {
        Parameter::TorqueGain => "check the body's mass, the unit of the torque and the torque per \
             ampere, but do not set it free on a body that was weighed: contacts that creep look like \
             that, too"
            .to_owned(),
        Parameter::DriveCoulomb | Parameter::TorqueBias => format!(
            "contacts that creep and a floor that rubs look like that, too: set {parameter} = \
             \"free\" only if the data held back are explained better with it"
        ),
        Parameter::CreepBall | Parameter::CreepTilt => "the contacts of the ball creep under their \
             forces, or the encoders are read late: set creep_phi_s = \"free\" and creep_theta_s = \
             \"free\""
            .to_owned(),
        _ => format!(
            "set {parameter} = \"free\", and see whether the other parameters stay"
        ),
    }
}

fn contradiction(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::TorqueGain => {
            "check the body's mass, the unit of the torque and the torque per ampere"
        }
        _ => "check what you know of it, or make its standard deviation larger",
    }
}

/// What it means that a fit ended at the limit of a parameter.
fn beyond(parameter: Parameter, value: f64, masses: &(f64, f64), lever: f64) -> String {
    let words = parameter.words();
    match parameter {
        Parameter::Delay => format!(
            "the delay is longer than the {LONGEST_DELAY} s that are looked at: are the columns \
             shifted against each other?"
        ),
        Parameter::TorqueGain => {
            let (lightest, heaviest) = *masses;
            let (body, unit) = if value * heaviest <= 2.0 {
                (
                    "heavier",
                    "in a smaller unit than is said (mN m), has the other sign,",
                )
            } else {
                ("lighter", "in a larger unit than is said")
            };
            format!(
                "the torque gain is {} 1/kg: with its centre of mass at {} m a body weighs from {} \
                 to {} kg, and this one would be {body}. The torque is {unit} or is not the one that \
                 moves the robot; or the lengths are wrong",
                number(value),
                number(lever),
                number(lightest),
                number(heaviest),
            )
        }
        Parameter::CreepBall | Parameter::CreepTilt => format!(
            "{words} goes to {} s, the limit: the contacts slip rather than creep, or the columns are \
             shifted against each other",
            number(value)
        ),
        Parameter::TiltOffset | Parameter::GyroBias => format!(
            "{words} goes to {} {}, the limit: is the sensor mounted askew, or are units or signs \
             wrong?",
            number(value),
            parameter.unit()
        ),
        _ => format!(
            "{words} goes to {} {}, more than any robot of these lengths has: units, signs or lengths \
             are wrong, or it is not the log of a ballbot",
            number(value),
            parameter.unit()
        ),
    }
}
