//! The variables of a fit: what the planes of a robot share is one of them, what each has of its own
//! is one for each.

use crate::coordinates::Coordinates;
use crate::parameter::{Parameter, Values};
use nalgebra::DMatrix;

/// Which parameter of which plane is which variable. The first variables are the parameters of the
/// first plane, in the order of [`Parameter::ALL`]; the second plane's own follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variables {
    planes: usize,
    own: Values<bool>,
}

impl Variables {
    /// The variables of a robot of which one or two planes were logged. The planes share ball, wheels
    /// and drive, and the body's mass and height; each has its own sensors and constant torque, and,
    /// if the body is not symmetric, its own inertia of the tilt, b3.
    pub fn of_robot(planes: usize, symmetric: bool) -> Self {
        let own = |parameter| match parameter {
            Parameter::TiltOffset | Parameter::GyroBias | Parameter::TorqueBias => true,
            Parameter::B3 => !symmetric,
            _ => false,
        };
        let own = Values(Parameter::ALL.map(own));
        Self { planes, own }
    }

    /// The same planes as those of robots of which nothing is shared.
    pub(crate) fn apart(self) -> Self {
        Self {
            own: Values([true; Parameter::ALL.len()]),
            ..self
        }
    }

    /// The planes.
    pub fn planes(self) -> usize {
        self.planes
    }

    /// Whether each plane has its own of a parameter.
    pub fn is_own(self, parameter: Parameter) -> bool {
        self.planes > 1 && self.own[parameter]
    }

    /// All variables in their order: the parameter, and the plane that it is read from, which for a
    /// shared one is the first.
    pub fn all(self) -> impl Iterator<Item = (usize, Parameter)> {
        let planes = (0..self.planes).flat_map(|plane| Parameter::ALL.map(|one| (plane, one)));
        planes.filter(move |(plane, parameter)| *plane == 0 || self.is_own(*parameter))
    }

    /// How many there are.
    pub fn count(self) -> usize {
        self.all().count()
    }

    /// The place of a parameter of a plane.
    pub fn place(self, plane: usize, parameter: Parameter) -> usize {
        if plane == 0 || !self.is_own(parameter) {
            return parameter.index();
        }
        let own = Parameter::ALL.into_iter().filter(|one| self.is_own(*one));
        let (count, before) = own.fold((0, 0), |(count, before), one| {
            (count + 1, before + usize::from(one < parameter))
        });
        Parameter::ALL.len() + (plane - 1) * count + before
    }

    /// The places of a plane's parameters.
    pub fn places(self, plane: usize) -> Values<usize> {
        Values(Parameter::ALL.map(|parameter| self.place(plane, parameter)))
    }

    /// A plane's rows and columns of a matrix of all variables.
    pub(crate) fn part(self, matrix: &DMatrix<f64>, plane: usize) -> DMatrix<f64> {
        let places = &self.places(plane).0;
        matrix.select_rows(places).select_columns(places)
    }

    /// Derivative of the planes' parameters, in the order of the variables, by the fit's coordinates,
    /// square.
    pub(crate) fn jacobian(self, planes: &[Coordinates]) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.count(), self.count());
        for (plane, parameter) in self.all() {
            let row = self.place(plane, parameter);
            let of_plane = planes[plane].jacobian();
            for by in Parameter::ALL {
                let entry = of_plane[(parameter.index(), by.index())];
                jacobian[(row, self.place(plane, by))] = entry;
            }
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_has_its_place() {
        for (planes, symmetric, count) in
            [(1, true, 13), (1, false, 13), (2, true, 16), (2, false, 17)]
        {
            for (variables, count) in [
                (Variables::of_robot(planes, symmetric), count),
                (Variables::of_robot(planes, symmetric).apart(), 13 * planes),
            ] {
                let places = variables
                    .all()
                    .map(|(plane, one)| variables.place(plane, one));
                assert_eq!(places.collect::<Vec<_>>(), (0..count).collect::<Vec<_>>());
            }
        }
        let robot = Variables::of_robot(2, true);
        assert_eq!(robot.place(1, Parameter::B3), Parameter::B3.index());
        assert_eq!(robot.place(1, Parameter::TiltOffset), 13);
    }
}
