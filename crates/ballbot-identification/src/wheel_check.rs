//! Whether order, sense and azimuths of the wheels are those of a configuration, from what the
//! encoders show when the ball is moved by hand.

use crate::log::{Problem, WheelEncoders};
use nalgebra::Vector3;
use std::fmt;

/// What was done with the ball while the body was held, motors off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Push {
    /// It was rolled so that the robot would move along +x.
    AlongX,
    /// The same along +y, to the left of +x.
    AlongY,
    /// It was turned about the vertical, counter-clockwise seen from above.
    Turn,
}

impl fmt::Display for Push {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AlongX => "along x",
            Self::AlongY => "along y",
            Self::Turn => "turned",
        })
    }
}

/// How the wheels may be wired and stand, against what a configuration says of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrangement {
    /// Which of the configuration's encoders belongs to each wheel.
    pub encoders: [usize; 3],
    /// Which wheels turn the other way than it says.
    pub flipped: [bool; 3],
    /// By how much all azimuths are larger, degrees.
    pub turned_deg: f64,
}

impl Arrangement {
    const AS_SAID: Self = Self {
        encoders: [0, 1, 2],
        flipped: [false; 3],
        turned_deg: 0.0,
    };

    /// Whether the order of the encoders is another.
    pub(crate) fn is_reordered(&self) -> bool {
        self.encoders != Self::AS_SAID.encoders
    }

    /// What the wheels show of what the encoders, in the order of the configuration, do.
    pub(crate) fn of_wheels(&self, encoders: &[f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|wheel, _| {
            let sense = if self.flipped[wheel] { -1.0 } else { 1.0 };
            sense * encoders[self.encoders[wheel]]
        })
    }

    /// All that are wired otherwise than said, on wheels that stand where they are said to.
    pub(crate) fn of_same_azimuths() -> impl Iterator<Item = Self> {
        Self::all().filter(|one| one.turned_deg == 0.0 && *one != Self::AS_SAID)
    }

    /// How many things are otherwise than said.
    pub(crate) fn changes(&self) -> usize {
        usize::from(self.is_reordered())
            + self.flipped.iter().filter(|flipped| **flipped).count()
            + usize::from(self.turned_deg != 0.0)
    }

    fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] = [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [2, 1, 0],
            [1, 2, 0],
            [2, 0, 1],
        ];
        let senses = (0..8).map(|bits| [0, 1, 2].map(|i| bits >> i & 1 == 1));
        senses.flat_map(|flipped| {
            ORDERS.into_iter().flat_map(move |encoders| {
                [0.0, 90.0, -90.0, 180.0].map(|turned_deg| Self {
                    encoders,
                    flipped,
                    turned_deg,
                })
            })
        })
    }

    /// The cosine of the angle between what the encoders show and what they would, for the push
    /// that fits worst.
    fn fit(&self, said: &WheelEncoders, seen: &[(Push, [f64; 3])]) -> Result<f64, Problem> {
        let mut encoders = said.clone();
        for azimuth in &mut encoders.azimuths_deg {
            *azimuth += self.turned_deg;
        }
        let expected = encoders.wheels()?.motor_angles(1.0);
        let fits = seen.iter().map(|(push, angles)| {
            self.of_wheels(angles)
                .normalize()
                .dot(&expected.column(*push as usize).normalize())
        });
        Ok(fits.fold(1.0, f64::min))
    }
}

impl fmt::Display for Arrangement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut changes = Vec::new();
        if self.is_reordered() {
            let [a, b, c] = self.encoders.map(|place| place + 1);
            changes.push(format!(
                "the wheels 1, 2, 3 have the encoders {a}, {b}, {c}"
            ));
        }
        for (wheel, _) in self
            .flipped
            .iter()
            .enumerate()
            .filter(|(_, flipped)| **flipped)
        {
            changes.push(format!("wheel {} turns the other way", wheel + 1));
        }
        if self.turned_deg != 0.0 {
            let which = if self.turned_deg < 0.0 {
                "smaller"
            } else {
                "larger"
            };
            let by = self.turned_deg.abs();
            changes.push(format!("all azimuths are {by} degrees {which}"));
        }
        f.write_str(&changes.join(", "))
    }
}

/// What pushes by hand say of a configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelCheck {
    /// By how much what is seen is off what the configuration says, degrees, in the push that fits
    /// worst: the angle between the two as vectors of the three wheels.
    pub off_deg: f64,
    /// What the encoders should show in each push, of a ball that turns by one rad.
    pub expected: Vec<[f64; 3]>,
    /// Encoders, of the configuration's, that hardly move in any push, though one is to move them.
    pub still: Vec<usize>,
    /// What would agree, with the least changes; empty if the configuration does, or nothing would.
    pub instead: Vec<Arrangement>,
}

/// A push by hand goes astray by so much at most, degrees.
const ASTRAY_DEG: f64 = 15.0;

/// An encoder that turns by less than this share of the one that turns most shows noise. A wheel on whose axle the ball
/// rolls turns by more: no hand pushes to half a degree.
const STILL: f64 = 0.01;

/// Whether the encoder of a wheel hardly moves where the largest of the three angles is much larger.
fn is_still(angles: &[f64; 3], wheel: usize) -> bool {
    let largest = angles.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
    angles[wheel].abs() < STILL * largest
}

impl WheelCheck {
    /// Compares what a configuration says with what its encoders show: pushes, and how far the
    /// encoders turned (in any common unit, after their factors).
    ///
    /// # Errors
    /// [`Problem`] if the wheels of the configuration cannot turn the ball.
    pub fn new(said: &WheelEncoders, seen: &[(Push, [f64; 3])]) -> Result<Self, Problem> {
        let least = ASTRAY_DEG.to_radians().cos();
        let fit = Arrangement::AS_SAID.fit(said, seen)?;
        let mut instead = Vec::new();
        if fit < least {
            for arrangement in Arrangement::all() {
                if arrangement.fit(said, seen)? >= least {
                    instead.push(arrangement);
                }
            }
        }
        let fewest = instead.iter().map(Arrangement::changes).min();
        instead.retain(|arrangement| Some(arrangement.changes()) == fewest);
        let angles = said.wheels()?.motor_angles(1.0);
        let columns = seen.iter().map(|(push, _)| angles.column(*push as usize));
        let expected: Vec<[f64; 3]> = columns
            .map(|column| [column[0], column[1], column[2]])
            .collect();
        let is_dead = |wheel: &usize| {
            seen.iter().all(|(_, angles)| is_still(angles, *wheel))
                && expected.iter().any(|angles| !is_still(angles, *wheel))
        };
        Ok(Self {
            off_deg: fit.clamp(-1.0, 1.0).acos().to_degrees(),
            still: (0..3).filter(is_dead).collect(),
            expected,
            instead,
        })
    }

    /// Whether order, sense and azimuths agree with the configuration.
    pub fn agrees(&self) -> bool {
        self.off_deg <= ASTRAY_DEG
    }
}

/// The wheels' azimuths in degrees that the pushes along x and along y show, where a wheel is not
/// reversed; a reversed one stands opposite.
pub fn azimuths_seen(along_x: &[f64; 3], along_y: &[f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|wheel| (-along_x[wheel]).atan2(along_y[wheel]).to_degrees())
}
