//! The sizes of a ballbot's plane as types of `lpvmpc`: 4 states, 1 input, 3 scheduling parameters.

use crate::Ballbot;

/// The LPVMPC controller of one plane.
pub type Controller<T> = lpvmpc::Controller<Ballbot<T>, T, 4, 1, 3>;

/// Its settings.
pub type ControllerSettings<T> = lpvmpc::ControllerSettings<T, 4, 1, 3>;

/// The program of a sample and the solver, which the controllers of both planes may share.
pub type Workspace<T> = lpvmpc::Workspace<T, 4, 1>;

/// The guarded controller of one plane.
pub type GuardedController<T> = lpvmpc::GuardedController<Ballbot<T>, T, 4, 1, 3>;

/// Its settings.
pub type GuardedSettings<T> = lpvmpc::GuardedSettings<T, 4, 1>;

/// Its program and solver: the set point is a fifth state there.
pub type GuardedWorkspace<T> = lpvmpc::GuardedWorkspace<T, 1, 5>;

/// The estimator of one plane on readings of (phi, theta, theta_dot), with `ND` disturbances and a memory
/// of `K` instants.
pub type Estimator<T, const ND: usize, const K: usize> =
    lpvmpc::Estimator<Ballbot<T>, T, 4, 1, 3, 3, ND, K>;
