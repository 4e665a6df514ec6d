//! The heading: between the directions of the floor and those of the robot.

use lpvmpc::{Number, Scalar};
use nalgebra::Vector2;

/// The robot's x axis is turned by the heading from the floor's, counter-clockwise seen from
/// above.
///
/// The planes' equations are the same in all directions, so the planes can be those of the
/// floor however the robot stands: what is measured on the robot (tilt, tilt rate) is turned to
/// the floor, and the planes' torques are turned to the robot before
/// [`Wheels::motors`](crate::Wheels::motors). While the robot turns slowly compared with its
/// tilting, nothing else is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading<T> {
    sin: T,
    cos: T,
}

impl<T: Scalar + Number> Heading<T> {
    /// The heading `angle` in rad.
    pub fn new(angle: T) -> Self {
        let (sin, cos) = Number::sin_cos(angle);
        Self { sin, cos }
    }

    /// A pair (along x, along y) of the robot as a pair of the floor.
    pub fn to_floor(&self, robot: &Vector2<T>) -> Vector2<T> {
        Vector2::new(
            self.cos * robot[0] - self.sin * robot[1],
            self.sin * robot[0] + self.cos * robot[1],
        )
    }

    /// A pair (along x, along y) of the floor as a pair of the robot.
    pub fn to_robot(&self, floor: &Vector2<T>) -> Vector2<T> {
        Vector2::new(
            self.cos * floor[0] + self.sin * floor[1],
            self.cos * floor[1] - self.sin * floor[0],
        )
    }
}
