//! What differs from the nominal closed loop.

use super::run::{ImpossibleSetPoints, Loop, Record, SetPoints};
use super::{Campaign, Scenarios, paper};
use ballbot::Ballbot;
use ballbot_scenario::{Prepared, ScenarioError};
use lpvmpc_sim::{Actuation, Random};
use nalgebra::{Vector1, Vector4};
use std::fmt;

/// The kinds of closed loops in a campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variant {
    /// The plant is the model, the torque acts as commanded.
    Nominal,
    /// The same from the edge of the certified set.
    Edge,
    /// The same with set points that a robot cannot follow.
    Unfollowable(ImpossibleSetPoints),
    /// The same with no programs but for the first plan: the rest of it is all there is.
    Candidates,
    /// The same with this horizon.
    Horizon(usize),
    /// Now and then a push changes the rates by up to so much of their bounds.
    Pushes(f64),
    /// b1, b2 and b3 of the plant differ by up to this part of their values, each for itself. A
    /// plant whose mass matrix is singular at some tilt within the bounds is drawn again.
    Parameters(f64),
    /// The torque has a normally distributed error with this standard deviation, N m.
    TorqueNoise(f64),
    /// The torque acts so many seconds late.
    Delay(f64),
    /// The paper's scheme to the letter: terminal equality for a predictor whose scheduling is
    /// frozen, one Runge-Kutta step, set points up to so many rad apart. The negative control.
    Paper(f64),
}

impl Variant {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 20] = [
        Self::Nominal,
        Self::Edge,
        Self::Unfollowable(ImpossibleSetPoints::EverySample),
        Self::Unfollowable(ImpossibleSetPoints::Alternating),
        Self::Unfollowable(ImpossibleSetPoints::RunningAway),
        Self::Unfollowable(ImpossibleSetPoints::Huge),
        Self::Candidates,
        Self::Horizon(5),
        Self::Horizon(10),
        Self::Horizon(40),
        Self::Horizon(60),
        Self::Pushes(0.1),
        Self::Pushes(0.4),
        Self::Parameters(0.05),
        Self::Parameters(0.2),
        Self::TorqueNoise(0.05),
        Self::TorqueNoise(0.2),
        Self::Delay(0.01),
        Self::Delay(0.03),
        Self::Paper(2.0 * std::f64::consts::PI),
    ];

    /// Run `number` of the campaign.
    pub(super) fn run(
        &self,
        scenarios: &Scenarios,
        campaign: &Campaign,
        number: usize,
    ) -> Result<Record, ScenarioError> {
        let mut random = Random::new(campaign.seed, number);
        let prepared = &scenarios.guaranteed;
        match self {
            Self::Paper(farthest) => {
                let start = Loop::start(prepared, false, &mut random)?;
                let wanted = SetPoints::draw(&mut random, campaign.samples, *farthest);
                paper::run(&scenarios.paper, start, &wanted, campaign.samples)
            }
            _ => {
                let mut run = Loop::new(prepared, self, &mut random)?;
                let wanted = match *self {
                    Self::Unfollowable(course) => {
                        SetPoints::of(course, &mut random, campaign.samples, FARTHEST)
                    }
                    _ => SetPoints::draw(&mut random, campaign.samples, FARTHEST),
                };
                Ok(run.record(self, &wanted, campaign.samples, &mut random))
            }
        }
    }

    /// Whether the plant is the model, so that what is guaranteed must hold.
    pub fn is_nominal(&self) -> bool {
        matches!(
            self,
            Self::Nominal
                | Self::Edge
                | Self::Unfollowable(_)
                | Self::Candidates
                | Self::Horizon(_)
        )
    }

    pub(super) fn plant(
        &self,
        prepared: &Prepared,
        random: &mut Random,
    ) -> Result<Ballbot<f64>, ScenarioError> {
        let nominal = prepared.ballbot;
        let Self::Parameters(part) = *self else {
            return Ok(nominal);
        };
        let tilt = prepared.settings.x.upper[1];
        for _ in 0..MOST_DRAWS {
            let mut factor = || 1.0 + part * random.symmetric();
            let plant = Ballbot {
                b1: nominal.b1 * factor(),
                b2: nominal.b2 * factor(),
                b3: nominal.b3 * factor(),
                ..nominal
            };
            // With a singular mass matrix there is no motion to run.
            if plant.consistency(tilt).mass_invertible {
                return Ok(plant);
            }
        }
        Err(ScenarioError::Parameters(format!(
            "of {MOST_DRAWS} robots whose b1 to b3 are drawn within {:.0} % of these, none has an \
             invertible mass matrix at all tilts up to {:.1} degrees: det M = b1 b3 - (b2 - l r_b \
             cos theta)^2 has a zero there. A rigid robot has none; a narrower bounds.theta_rad helps, \
             too",
            100.0 * part,
            tilt.to_degrees()
        )))
    }

    /// The push before sample `k`, in state units.
    pub(super) fn push(&self, prepared: &Prepared, random: &mut Random) -> Option<Vector4<f64>> {
        let Self::Pushes(part) = *self else {
            return None;
        };
        let rates = prepared.settings.x.upper * part;
        let (phi_dot, theta_dot) = (random.symmetric(), random.symmetric());
        (random.uniform() < PUSHES)
            .then(|| Vector4::new(0.0, 0.0, phi_dot * rates[2], theta_dot * rates[3]))
    }

    /// What becomes of the torque in a sample.
    pub(super) fn actuation(&self, random: &mut Random) -> Actuation<1> {
        let ideal = Actuation::ideal();
        match *self {
            Self::TorqueNoise(deviation) => Actuation {
                error: Vector1::new(deviation * random.normal()),
                ..ideal
            },
            Self::Delay(delay) => Actuation { delay, ..ideal },
            _ => ideal,
        }
    }
}

/// Largest distance of a set point from phi = 0, rad.
const FARTHEST: f64 = 100.0;
/// As many robots are drawn until one can move: of those around a robot that can, far more than are
/// needed.
const MOST_DRAWS: usize = 1000;
/// Part of the samples that begin with a push.
const PUSHES: f64 = 0.02;

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nominal => f.write_str("nominal"),
            Self::Edge => f.write_str("nominal, from the set's edge"),
            Self::Unfollowable(ImpossibleSetPoints::EverySample) => {
                f.write_str("nominal, new set points at every sample")
            }
            Self::Unfollowable(ImpossibleSetPoints::Alternating) => {
                f.write_str("nominal, alternating set points")
            }
            Self::Unfollowable(ImpossibleSetPoints::RunningAway) => {
                f.write_str("nominal, set points that run away")
            }
            Self::Unfollowable(ImpossibleSetPoints::Huge) => {
                f.write_str("nominal, set points to 1e300, NaN")
            }
            Self::Candidates => f.write_str("nominal, candidates only"),
            Self::Horizon(horizon) => write!(f, "nominal, {horizon} samples"),
            Self::Pushes(part) => write!(f, "pushes, {:.0} % of the rates' bounds", 100.0 * part),
            Self::Parameters(part) => write!(f, "b1 to b3 ±{:.0} %", 100.0 * part),
            Self::TorqueNoise(deviation) => write!(f, "torque noise {deviation} N m"),
            Self::Delay(delay) => write!(f, "torque {:.0} ms late", 1e3 * delay),
            Self::Paper(_) => f.write_str("the paper's scheme"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Scenarios;

    #[test]
    fn robots_that_cannot_be_drawn_are_refused() {
        let mut prepared = Scenarios::built_in().unwrap().guaranteed;
        let variant = Variant::Parameters(0.2);
        let mut random = Random::new(1, 0);
        variant.plant(&prepared, &mut random).unwrap();
        // det M = b1 b3 - (b2 - l r_b cos theta)^2 changes its sign on the way to the floor.
        let ballbot = &mut prepared.ballbot;
        (ballbot.b1, ballbot.b2, ballbot.b3) = (0.016, 0.04, 0.143);
        prepared.settings.x.upper[1] = 3.1;
        let said = variant
            .plant(&prepared, &mut random)
            .unwrap_err()
            .to_string();
        for word in ["20 %", "det M", "177.6 degrees"] {
            assert!(said.contains(word), "{said}");
        }
    }
}
