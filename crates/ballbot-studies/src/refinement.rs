//! The nonlinear model's parameters b from the parameters p of a linear model, by least squares
//! on F(b) = p - h(b) (section IV-A of Karachalios and Abbas).

use ballbot::{Ballbot, Consistency, DriveFriction, Geometry, LinearParameters, limits};
use lpvmpc_design::{
    Fit, LeastSquaresError, LeastSquaresSettings, MatrixError, ResidualModel, gauss_newton,
    levenberg_marquardt,
};
use nalgebra::{Complex, DMatrix, DVector};

use crate::linear_model::LinearModel;

/// b0 = (b1, b2, b3, b4) for the paper's robot. The paper gives none; from this one its iteration
/// takes the five steps that it reports.
pub const PAPER_START: [f64; 4] = [0.0025, 0.06, 0.14, -0.07];

/// What is to be refined.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinementProblem {
    /// p.
    pub linear: LinearParameters<f64>,
    /// Lengths and gravity, which are known.
    pub geometry: Geometry<f64>,
    /// b0: b1, b2, b3 in m^2, b4 in m^2/s.
    pub start: [f64; 4],
    /// Tolerances, caps, and the weights of the six equations.
    pub settings: LeastSquaresSettings,
    /// The result is checked against mechanics for |theta| <= `tilt`, rad, at most pi.
    pub tilt: f64,
}

/// A refined model.
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    /// The paper's undamped iteration, converged or not.
    pub gauss_newton: Fit,
    /// The damped iteration, converged. It decides the result.
    pub damped: Fit,
    /// b, with the geometry.
    pub ballbot: Ballbot<f64>,
    /// p1 to p6 beside what b makes of them.
    pub equations: [Equation; 6],
    /// Poles of the linear model p, 1/s.
    pub identified_poles: Vec<Complex<f64>>,
    /// Poles of the linear model h(b), 1/s.
    pub refined_poles: Vec<Complex<f64>>,
    /// Whether a rigid body with these parameters exists.
    pub consistency: Consistency<f64>,
}

/// One equation p_i = h_i(b).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equation {
    /// p_i.
    pub identified: f64,
    /// h_i(b).
    pub refined: f64,
}

impl Equation {
    /// F_i = p_i - h_i(b).
    pub fn difference(&self) -> f64 {
        self.identified - self.refined
    }
}

/// Why there are no refined parameters.
#[derive(Debug, thiserror::Error)]
pub enum RefinementError {
    /// The problem makes no sense, or the damped iteration reached no minimum.
    #[error(
        "{0}. A start nearer to the robot ([start] in the file) or more iterations \
         ([settings] max_iterations) may help"
    )]
    LeastSquares(#[from] LeastSquaresError),
    /// The poles of a linear model.
    #[error("the linear model: {0}")]
    Poles(#[from] MatrixError),
}

impl RefinementProblem {
    /// The paper's robot, with p6 negative.
    pub fn paper() -> Self {
        Self {
            linear: LinearParameters::paper(),
            geometry: Geometry::paper(),
            start: PAPER_START,
            settings: LeastSquaresSettings::default(),
            tilt: limits::THETA,
        }
    }

    /// Runs both iterations and looks at the result.
    ///
    /// # Errors
    /// [`RefinementError::LeastSquares`] when the damped iteration does not converge. That the
    /// undamped one does not is no error: see [`Refinement::gauss_newton`].
    pub fn solve(&self) -> Result<Refinement, RefinementError> {
        let start = DVector::from_row_slice(&self.start);
        let damped = levenberg_marquardt(self, &start, &self.settings)?.require_converged()?;
        let gauss_newton = gauss_newton(self, &start, &self.settings)?;
        let ballbot = self.ballbot(&damped.parameters);
        let refined = ballbot.linear_parameters();
        let (p, h) = (self.linear.to_vector(), refined.to_vector());
        Ok(Refinement {
            gauss_newton,
            ballbot,
            equations: std::array::from_fn(|i| Equation {
                identified: p[i],
                refined: h[i],
            }),
            identified_poles: LinearModel::from(self.linear.matrices()).poles()?,
            refined_poles: LinearModel::from(refined.matrices()).poles()?,
            consistency: ballbot.consistency(self.tilt),
            damped,
        })
    }

    fn ballbot(&self, b: &DVector<f64>) -> Ballbot<f64> {
        Ballbot {
            b1: b[0],
            b2: b[1],
            b3: b[2],
            b4: b[3],
            drive: DriveFriction::none(),
            geometry: self.geometry,
        }
    }
}

impl ResidualModel for RefinementProblem {
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        let refined = self.ballbot(b).linear_parameters().to_vector();
        DVector::from_column_slice((self.linear.to_vector() - refined).as_slice())
    }

    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        let refined = self.ballbot(b).linear_parameters_jacobian();
        DMatrix::from_column_slice(6, 4, (-refined).as_slice())
    }
}

/// A start for any robot: the b that fulfils p1, p2, p3 and p4 exactly.
///
/// With k = b2 - l r_b and d = b1 b3 - k^2, the quotients b1/d, k/d and b3/d follow from p4, p1
/// and p3, and b1/d b3/d - (k/d)^2 = 1/d. Not finite when these p belong to no ballbot.
pub fn start_from(linear: &LinearParameters<f64>, geometry: &Geometry<f64>) -> [f64; 4] {
    let weight = geometry.gravity * geometry.centre_of_mass;
    let gear = geometry.ball_radius / geometry.wheel_radius;
    let b1_d = linear.p4 / weight;
    let k_d = linear.p1 / weight;
    let b3_d = linear.p3 / gear + k_d;
    let d = 1.0 / (b1_d * b3_d - k_d * k_d);
    let b2 = k_d * d + geometry.centre_of_mass * geometry.ball_radius;
    [b1_d * d, b2, b3_d * d, -linear.p2 / b3_d]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_start_fulfils_four_equations() {
        let problem = RefinementProblem::paper();
        let start = start_from(&problem.linear, &problem.geometry);
        let residual = problem.residual(&DVector::from_row_slice(&start));
        for i in 0..4 {
            let size = problem.linear.to_vector()[i].abs();
            assert!(residual[i].abs() < 1e-12 * size, "p{}: {residual}", i + 1);
        }
    }

    #[test]
    fn a_made_up_rigid_robot_is_found_again_from_its_linear_model() {
        let robot = Ballbot {
            b1: 0.12,
            b2: 0.03,
            b3: 0.31,
            b4: 0.4,
            drive: DriveFriction::none(),
            geometry: Geometry {
                centre_of_mass: 0.45,
                ball_radius: 0.1,
                ..Geometry::paper()
            },
        };
        let linear = robot.linear_parameters();
        let problem = RefinementProblem {
            linear,
            geometry: robot.geometry,
            start: start_from(&linear, &robot.geometry),
            ..RefinementProblem::paper()
        };
        let found = problem.solve().unwrap();
        for (found, made_up) in [
            (found.ballbot.b1, robot.b1),
            (found.ballbot.b2, robot.b2),
            (found.ballbot.b3, robot.b3),
            (found.ballbot.b4, robot.b4),
        ] {
            assert!((found - made_up).abs() < 1e-9, "{found} for {made_up}");
        }
        assert!(found.consistency.is_physical(), "{}", found.consistency);
    }

    #[test]
    fn the_result_is_a_minimum() {
        let found = RefinementProblem::paper().solve().unwrap();
        assert!((found.damped.residual_norm - 0.432_969).abs() < 1e-6);
        let gradient = found.damped.jacobian.transpose() * &found.damped.residual;
        for (slope, column) in gradient.iter().zip(found.damped.jacobian.column_iter()) {
            let cosine = slope.abs() / (column.norm() * found.damped.residual.norm());
            assert!(cosine < 1e-7, "cosine {cosine:e}");
        }
        assert!((4..=5).contains(&found.gauss_newton.steps()));
    }
}
