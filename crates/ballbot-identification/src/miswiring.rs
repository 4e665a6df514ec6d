//! What can be wrong between two planes, and in neither alone: tilts in each other's place, wheels in
//! another order or of another sense. A log of both planes is fitted again as it would be then.

use crate::joint::Joint;
use crate::log::Run;
use crate::segments::Stretch;
use crate::start::linear_fits;
use crate::suspects::{Suspect, explaining};
use crate::wheel_check::Arrangement;
use ballbot::Wheels;
use nalgebra::Vector3;
use std::fmt;

/// A mistake about both planes at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Miswiring {
    /// Each plane's tilt is the other's, with the other sign where it says so.
    Tilts {
        /// The tilt of the plane x is minus that column of the plane y, and the other way round.
        negated: [bool; 2],
    },
    /// The wheels have other columns than is said.
    Wheels {
        /// Which of their columns.
        columns: WheelColumns,
        /// Which of them, and with which sense.
        arrangement: Arrangement,
    },
}

/// Columns of the three wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WheelColumns {
    /// Those of the angles.
    Encoders,
    /// Those of the motors' torques.
    Torques,
    /// Both.
    All,
}

impl WheelColumns {
    fn words(self) -> &'static str {
        match self {
            Self::Encoders => "encoders",
            Self::Torques => "torques",
            Self::All => "encoders and torques",
        }
    }
}

/// So many of the mistakes are fitted: those under which a regression explains most.
const FITTED: usize = 4;

/// The wheels as they are said to be, and how they turn about the vertical in each run.
pub(crate) struct WheelsRead<'a> {
    pub(crate) wheels: Wheels<f64>,
    pub(crate) torques: bool,
    pub(crate) turns: &'a [Run],
}

/// The runs of both planes.
type Pair = [Vec<Run>; 2];

impl Joint<'_> {
    /// The mistakes about both planes under which a robot explains their stretches best, as
    /// [`crate::Task::suspects`] has those of one.
    pub(crate) fn miswirings(
        &self,
        stretches: &[&[Stretch]],
        read: Option<&WheelsRead<'_>>,
    ) -> Vec<Suspect> {
        let [x, y] = self.tasks.as_slice() else {
            return Vec::new();
        };
        let pair: Pair = [x.runs.to_vec(), y.runs.to_vec()];
        let own = self.chi_square_of(&pair, stretches);
        let signs = [[false, false], [false, true], [true, false], [true, true]];
        let mut mistakes = signs.map(|negated| Miswiring::Tilts { negated }).to_vec();
        mistakes.extend(
            read.into_iter()
                .flat_map(|read| wheel_mistakes(read.torques)),
        );
        let mut screened: Vec<(Miswiring, f64)> = mistakes
            .into_iter()
            .map(|mistake| {
                let left = self.unexplained(&mistake.corrected(&pair, read), stretches);
                (mistake, left)
            })
            .collect();
        screened.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        let tried = screened.into_iter().take(FITTED).map(|(mistake, _)| {
            let pair = mistake.corrected(&pair, read);
            (mistake, self.chi_square_of(&pair, stretches))
        });
        let mut found = explaining(own, tried.collect());
        let fewest = found.iter().map(|mistake| mistake.changes()).min();
        found.retain(|mistake| Some(mistake.changes()) == fewest);
        found.into_iter().map(Suspect::Planes).collect()
    }

    /// chi^2 per degree of freedom, the mean of the planes, each fitted by itself.
    fn chi_square_of(&self, pair: &Pair, stretches: &[&[Stretch]]) -> f64 {
        let planes = self.tasks.iter().zip(pair).zip(stretches);
        let planes = planes
            .map(|((task, runs), stretches)| task.chi_square_of(runs, task.ball_angle, stretches));
        planes.sum::<f64>() / 2.0
    }

    /// What a linear regression leaves in both planes.
    fn unexplained(&self, pair: &Pair, stretches: &[&[Stretch]]) -> f64 {
        let planes = self.tasks.iter().zip(pair).zip(stretches);
        let planes = planes.map(|((task, runs), stretches)| {
            let fits = linear_fits(runs, stretches, task.ball_angle, Some(TYPICAL_DELAY));
            fits.first().map_or(f64::INFINITY, |fit| fit.unexplained)
        });
        planes.sum()
    }
}

/// The delay that mistakes are compared with, s: of no matter beside what they change.
const TYPICAL_DELAY: f64 = 0.01;

/// All other orders and senses of the wheels.
fn wheel_mistakes(torques: bool) -> impl Iterator<Item = Miswiring> {
    let columns: &[WheelColumns] = match torques {
        true => &[
            WheelColumns::All,
            WheelColumns::Encoders,
            WheelColumns::Torques,
        ],
        false => &[WheelColumns::Encoders],
    };
    columns.iter().flat_map(|columns| {
        Arrangement::of_same_azimuths().map(|arrangement| Miswiring::Wheels {
            columns: *columns,
            arrangement,
        })
    })
}

impl Miswiring {
    /// How many things are otherwise than said.
    fn changes(&self) -> usize {
        match self {
            Self::Tilts { negated } => 1 + negated.iter().filter(|negated| **negated).count(),
            Self::Wheels { arrangement, .. } => arrangement.changes(),
        }
    }

    /// The runs as they are if this is the mistake.
    fn corrected(&self, pair: &Pair, read: Option<&WheelsRead<'_>>) -> Pair {
        let mut pair = pair.clone();
        let [x, y] = &mut pair;
        for (run, (x, y)) in x.iter_mut().zip(y).enumerate() {
            match (self, read) {
                (Self::Tilts { negated }, _) => interchange(x, y, *negated),
                (
                    Self::Wheels {
                        columns,
                        arrangement,
                    },
                    Some(read),
                ) => {
                    if let Some(turn) = read.turns.get(run) {
                        rewire(x, y, turn, &read.wheels, (*columns, arrangement));
                    }
                }
                (Self::Wheels { .. }, None) => {}
            }
        }
        pair
    }
}

/// Tilts and rates in each other's place.
fn interchange(x: &mut Run, y: &mut Run, negated: [bool; 2]) {
    let sign = negated.map(|negated| if negated { -1.0 } else { 1.0 });
    for (x, y) in x.outputs.iter_mut().zip(&mut y.outputs) {
        for output in [1, 2] {
            (x[output], y[output]) = (sign[0] * y[output], sign[1] * x[output]);
        }
    }
}

/// Ball angles and torques as they are if the wheels have these columns.
fn rewire(
    x: &mut Run,
    y: &mut Run,
    turn: &Run,
    wheels: &Wheels<f64>,
    (columns, arrangement): (WheelColumns, &Arrangement),
) {
    // psi = W' m of the angles.
    let of_angles = wheels.matrix().transpose();
    let Some(angles) = of_angles.try_inverse() else {
        return;
    };
    let rows = x.outputs.len().min(y.outputs.len()).min(turn.outputs.len());
    for row in 0..rows {
        if columns != WheelColumns::Torques {
            let psi = Vector3::new(x.outputs[row][0], y.outputs[row][0], turn.outputs[row][0]);
            let psi = of_angles * arrangement.of_wheels(&(angles * psi).into());
            (x.outputs[row][0], y.outputs[row][0]) = (psi[0], psi[1]);
        }
        if columns != WheelColumns::Encoders {
            let torques = Vector3::new(x.torque[row], y.torque[row], turn.torque[row]);
            let motors = arrangement.of_wheels(&wheels.motors(&torques).into());
            let torques = wheels.virtual_torques(&motors);
            (x.torque[row], y.torque[row]) = (torques[0], torques[1]);
        }
    }
}

impl fmt::Display for Miswiring {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tilts { negated } => {
                f.write_str(
                    "the tilts of the two planes stand in each other's place: interchange the \
                     columns of [log.theta] and [log.y.theta], and those of the rates",
                )?;
                let signs = match negated {
                    [false, false] => return Ok(()),
                    [true, false] => "those of the plane x",
                    [false, true] => "those of the plane y",
                    [true, true] => "all four",
                };
                write!(f, ", with factor = -1.0 for {signs}")?;
                if negated[0] != negated[1] {
                    f.write_str(
                        "; the inertial unit, or else the azimuths of the wheels, are a quarter \
                         turn off",
                    )?;
                }
                Ok(())
            }
            Self::Wheels {
                columns,
                arrangement,
            } => {
                let (words, mut changes) = (columns.words(), Vec::new());
                if arrangement.is_reordered() {
                    let [a, b, c] = arrangement.encoders.map(|place| place + 1);
                    changes.push(format!(
                        "the {words} of the wheels 1, 2, 3 are those that [log.wheels] names as {a}, \
                         {b}, {c}"
                    ));
                }
                let flipped = (0..3).filter(|wheel| arrangement.flipped[*wheel]);
                let flipped: Vec<String> = flipped.map(|wheel| (wheel + 1).to_string()).collect();
                if !flipped.is_empty() {
                    changes.push(format!(
                        "the {words} of wheel {} have the other sign",
                        flipped.join(" and ")
                    ));
                }
                f.write_str(&changes.join(", and "))
            }
        }
    }
}
