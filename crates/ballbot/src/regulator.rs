//! The sizes of a ballbot's plane as types of `lpvmpc`: 4 states, 1 input, 3 scheduling parameters.

use crate::Ballbot;

/// The LPVMPC controller of one plane.
pub type Controller<T> = lpvmpc::Controller<Ballbot<T>, T, 4, 1, 3>;

/// Its settings.
pub type ControllerSettings<T> = lpvmpc::ControllerSettings<T, 4, 1, 3>;

/// The program of a sample and the solver, which the controllers of both planes may share.
pub type Workspace<T> = lpvmpc::Workspace<T, 4, 1>;

/// The guaranteed controller of one plane.
pub type GuaranteedController<T> = lpvmpc::GuaranteedController<Ballbot<T>, T, 4, 1, 3>;

/// Its settings.
pub type GuaranteedSettings<T> = lpvmpc::GuaranteedSettings<T, 4, 1>;

/// Its program and solver: the set point is a fifth state there.
pub type GuaranteedWorkspace<T> = lpvmpc::GuaranteedWorkspace<T, 1, 5>;

/// The controller's settings where the torque moves in ramps: it is a fifth state.
pub type RampedSettings<T> = lpvmpc::ControllerSettings<T, 5, 1, 3>;

/// The estimator of one plane on readings of (phi, theta, phi_dot, theta_dot), with two disturbances: a
/// torque, N m, and an angle of the tilt, rad.
pub type Estimator<T> = lpvmpc::Estimator<Ballbot<T>, T, 4, 1, 3, 4, 2>;

/// Its settings.
pub type EstimatorSettings<T> = lpvmpc::EstimatorSettings<T, 4, 1, 4, 2>;

/// Its memory as arrays, for `K` instants.
pub type EstimatorArrays<T, const K: usize> = lpvmpc::EstimatorArrays<T, 4, 1, 4, 2, K>;

/// What is known of a plane's state.
pub type Belief<T> = lpvmpc::Belief<Ballbot<T>, T, 4, 1, 3, 4, 2>;

/// The planner `K` of one plane with all that stands around it.
pub type OutputFeedback<T, K> = lpvmpc::OutputFeedback<Ballbot<T>, K, T, 4, 1, 3, 4, 2>;

/// The planner whose torque is held over a sample.
pub type Held<T> = lpvmpc::Held<Ballbot<T>, T, 4, 1, 3>;

/// The planner whose torque moves in ramps.
pub type Ramped<T> = lpvmpc::Ramped<Ballbot<T>, T, 4, 1, 3, 5>;

/// The planner with a guarantee.
pub type Guaranteed<T> = lpvmpc::Guaranteed<Ballbot<T>, T, 4, 1, 3, 5>;

/// Any of the three.
pub type AnyPlanner<T> = lpvmpc::AnyPlanner<Ballbot<T>, T, 4, 1, 3, 5, 5>;
