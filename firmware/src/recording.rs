//! A scenario's settings, states and references, as they stand in the flash.

use crate::{N, Window};
use ballbot::{BadWheels, Ballbot, Wheel, Wheels};
use lpvmpc::{
    Bounds, ControllerSettings, InputReference, Iterations, Penalty, Predictor, Rk4, Scheduling,
    SolverSettings, TerminalIngredient, Weights,
};
use nalgebra::{Matrix1, Matrix4, Vector1, Vector4};

/// A scenario and what happened in it.
#[derive(Clone, Copy, Debug)]
pub struct Recording {
    /// The scenario's name.
    pub name: &'static str,
    /// The robot, which is also the prediction model.
    pub ballbot: Ballbot<f32>,
    /// Angle of the wheels' contact points from the top of the ball, rad.
    pub zenith_angle: f32,
    /// Where the wheels stand, and which way they turn.
    pub wheels: [Wheel<f32>; 3],
    /// Sampling time, s.
    pub t_s: f32,
    /// Prediction horizon, samples.
    pub horizon: usize,
    /// Runge-Kutta steps per sample.
    pub substeps: usize,
    /// Diagonal of the state weight Q.
    pub q: [f32; 4],
    /// Weight R of the torque.
    pub r: f32,
    /// Terminal weight P, symmetric.
    pub p: [[f32; 4]; 4],
    /// Lower bounds of (phi, theta, phi_dot, theta_dot), rad and rad/s.
    pub state_lower: [f32; 4],
    /// Upper bounds of (phi, theta, phi_dot, theta_dot), rad and rad/s.
    pub state_upper: [f32; 4],
    /// Lower and upper bound of the torque, N m.
    pub torque: [f32; 2],
    /// One plane, or x and y.
    pub planes: &'static [Plane],
}

/// Iterations that descend on the cost of the nonlinear rollout.
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    /// See [`Iterations::Descent`].
    pub tolerance: f32,
    /// Quadratic programs per sample at most.
    pub most: usize,
    /// Prices of the state bounds per unit of excess; `None` for one that is hard, or none.
    pub prices: [Option<f32>; 4],
}

/// What happened in one plane.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// State (phi, theta, phi_dot, theta_dot) at every sample, rad and rad/s.
    pub states: &'static [[f32; 4]],
    /// phi_ref at every sample, and on to the end of the last sample's horizon, rad.
    pub phi_ref: &'static [f32],
}

impl Recording {
    /// The scenario's controller settings, rounded to `f32`.
    pub fn settings(&self) -> ControllerSettings<f32, 4, 1, 3> {
        let [lower, upper] = self.torque.map(Vector1::new);
        ControllerSettings {
            t_s: self.t_s,
            horizon: self.horizon,
            predictor: Predictor::FrozenRk4(Rk4 {
                substeps: self.substeps,
            }),
            weights: Weights {
                q: Matrix4::from_diagonal(&Vector4::from(self.q)),
                r: Matrix1::new(self.r),
            },
            terminal: TerminalIngredient::Cost(Matrix4::from(self.p)),
            x: Bounds {
                lower: Vector4::from(self.state_lower),
                upper: Vector4::from(self.state_upper),
            },
            u: Bounds { lower, upper },
            soft_x: [None; 4],
            raise_prices: false,
            input_reference: InputReference::SteadyState,
            scheduling: Scheduling::Predicted,
            iterations: Iterations::Fixed(1),
            solver: SolverSettings::default(),
        }
    }

    /// The same problem with what is default in scenarios: a descent, a plan that is consistent
    /// with its stages over `substeps` Runge-Kutta steps per sample, and soft state bounds.
    pub fn with_descent(
        &self,
        descent: &Descent,
        substeps: usize,
    ) -> ControllerSettings<f32, 4, 1, 3> {
        let Descent {
            tolerance,
            most,
            prices,
        } = *descent;
        ControllerSettings {
            predictor: Predictor::StageConsistent(Rk4 { substeps }),
            soft_x: prices.map(|price| {
                price.map(|linear| Penalty {
                    linear,
                    quadratic: 0.0,
                })
            }),
            raise_prices: true,
            iterations: Iterations::descent(tolerance, most),
            ..self.settings()
        }
    }

    /// The wheels, with their torque map.
    ///
    /// # Errors
    /// The torque map has no inverse.
    pub fn wheels(&self) -> Result<Wheels<f32>, BadWheels<f32>> {
        Wheels::new(self.zenith_angle, self.wheels)
    }

    /// Samples that were recorded.
    pub fn samples(&self) -> usize {
        self.planes.first().map_or(0, |plane| plane.states.len())
    }
}

impl Plane {
    /// The reference over the horizon that begins at sample `k`: phi_ref and rest. Beyond the
    /// recording it is zero.
    pub fn window(&self, k: usize) -> Window {
        let at = |i: usize| {
            let phi_ref = self.phi_ref.get(k + i).copied().unwrap_or(0.0);
            Vector4::new(phi_ref, 0.0, 0.0, 0.0)
        };
        Window {
            stages: core::array::from_fn(at),
            terminal: at(N),
        }
    }
}
