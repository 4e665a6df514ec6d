//! The scenario file: what a user writes, key by key. Meaning and checks are in the modules
//! named after the tables.

use crate::file::feedback_table::{EstimatorTable, MotorsTable, ShapingTable, TorqueRateTable};
use crate::file::heading_table::HeadingTable;
use crate::file::parameters::Parameters;
use crate::file::world_table::WorldTable;
use lpvmpc::Iterations;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A closed-loop experiment, as written in a TOML file. Units are part of the key names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// One line for figures and lists.
    pub title: String,
    /// Length of the run, s.
    pub duration_s: f64,
    /// Values that no ballbot has, such as a tilt of 60 rad, are meant as they are; without it they
    /// are asked about.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub accept_unusual_values: bool,
    /// The robot: the controller's model and, unless `[world]` says otherwise, the plant. A table, or
    /// the path of a file with such a table.
    pub parameters: Parameters,
    /// The controller.
    pub controller: ControllerTable,
    /// Bounds of the controller's problem.
    pub bounds: BoundsTable,
    /// State at time zero (of both planes, unless `initial_state_y` is given).
    #[serde(default)]
    pub initial_state: StateTable,
    /// State of the y plane at time zero, for scenarios with two planes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_state_y: Option<StateTable>,
    /// What phi has to follow.
    pub reference: ReferenceTable,
    /// How the robot turns, and where it has to look.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading: Option<HeadingTable>,
    /// Tolerances of the simulated plant.
    #[serde(default)]
    pub integration: IntegrationTable,
    /// What is not ideal about the simulated world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world: Option<WorldTable>,
}

impl Scenario {
    /// The same without the certified terminal set that it relies on, for whoever is about to certify
    /// another one.
    pub fn uncertified(mut self) -> Self {
        if let TerminalTable::Certified(_) = self.controller.terminal {
            self.controller.terminal = TerminalTable::default();
        }
        self
    }

    /// The files that it names, as they stand in it: relative to the scenario's file.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let world = self.world.as_ref();
        let robots = [
            Some(&self.parameters),
            world.and_then(|world| world.parameters.as_ref()),
        ];
        let robots = robots.into_iter().flatten().filter_map(|of| match of {
            Parameters::File(file) => Some(file.as_path()),
            Parameters::Table(_) => None,
        });
        let certificate = match &self.controller.terminal {
            TerminalTable::Certified(table) => table.certificate.as_deref().map(Path::new),
            _ => None,
        };
        let excitation = world.and_then(|world| world.excitation.as_deref());
        let references = self.reference.files().into_iter().map(Path::new);
        robots
            .chain(certificate)
            .chain(excitation)
            .chain(references)
    }
}

/// Linear model p of the robot; see [`ballbot::LinearParameters`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearModelTable {
    /// p1, 1/s^2.
    pub p1: f64,
    /// p2, 1/s.
    pub p2: f64,
    /// p3, rad/(s^2 N m).
    pub p3: f64,
    /// p4, 1/s^2.
    pub p4: f64,
    /// p5, 1/s.
    pub p5: f64,
    /// p6, rad/(s^2 N m).
    pub p6: f64,
}

/// The controller's settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerTable {
    /// Which model predicts.
    pub model: ModelKind,
    /// Sampling time, s.
    pub t_s: f64,
    /// Prediction horizon N, samples.
    pub horizon: usize,
    /// Diagonal of Q, for (phi, theta, phi_dot, theta_dot). When Q and R are absent: Bryson's rule
    /// on this robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub q: Option<[f64; 4]>,
    /// R, 1/(N m)^2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r: Option<f64>,
    /// The end of the horizon.
    #[serde(default)]
    pub terminal: TerminalTable,
    /// The discrete-time predictor; stage-consistent when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predictor: Option<PredictorTable>,
    /// Whether the controller sees the reference before its time, over the whole horizon.
    #[serde(default = "yes")]
    pub preview: bool,
    /// The state estimator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimator: Option<EstimatorTable>,
    /// Time from a measurement to the torque that answers it, as the controller knows it, s: it
    /// decides for the state at which its torque will act.
    #[serde(default)]
    pub delay_s: f64,
    /// Bound and cost of the torque's rate; the torque then moves in ramps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_rate: Option<TorqueRateTable>,
    /// How set points become moves; steps without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shaping: Option<ShapingTable>,
    /// The limits of the motors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motors: Option<MotorsTable>,
    /// What the bounds of the state are worth. When absent: soft in a descent, hard otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_bounds: Option<StateBounds>,
    /// Quadratic programs per sample. When absent: a descent; one program with the paper's
    /// predictor `rk4`, with the linear model, and with a certified terminal set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iterations: Option<IterationsTable>,
}

/// Quadratic programs per sample, each along the rollout of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IterationsTable {
    /// So many.
    Fixed(usize),
    /// Each one an improvement: a descent on the cost of the nonlinear rollout. With the linear
    /// model, whose programs are all the same, it is one program.
    Descent {
        /// No more programs once one is expected to save less than this part of the cost.
        #[serde(default = "descent_tolerance")]
        tolerance: f64,
        /// At most so many.
        #[serde(default = "descent_programs")]
        most: usize,
        /// At most so many in a sample without a plan from the one before. As `most` when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        first: Option<usize>,
    },
}

impl Default for IterationsTable {
    /// The descent.
    fn default() -> Self {
        Self::Descent {
            tolerance: descent_tolerance(),
            most: descent_programs(),
            first: None,
        }
    }
}

fn descent_tolerance() -> f64 {
    Iterations::<f64>::TOLERANCE
}

fn descent_programs() -> usize {
    Iterations::<f64>::MOST
}

/// What the bounds of the state are worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StateBounds {
    /// They may be exceeded, at a price so high that it is paid only where they cannot be met.
    Soft,
    /// A plan that exceeds one is none.
    Hard,
}

fn yes() -> bool {
    true
}

/// Which model predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelKind {
    /// The LPV model with the scheduling of the previous plan.
    Lpv,
    /// The LPV model with the scheduling held at the upright equilibrium.
    Linear,
}

/// The end of the horizon.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TerminalTable {
    /// Nothing.
    None,
    /// x_N = x_ref.
    Equality,
    /// ||x_N - x_ref||_P^2 with P from the discrete Riccati equation of the predictor at the
    /// upright equilibrium: the cost of the LQR from there on.
    #[default]
    DiscreteRiccati,
    /// P from the continuous Riccati equation, as the paper does. It is about t_s times the
    /// discrete one, so it counts about 1/t_s times too little.
    ContinuousRiccati {
        /// The linear model it is computed for; the linearised plant when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        linear_model: Option<LinearModelTable>,
    },
    /// A given P.
    Cost {
        /// Symmetric positive semidefinite, 4 x 4.
        p: [[f64; 4]; 4],
    },
    /// A terminal set that `ballbot certify` has proved, with its cost, its law and an artificial
    /// set point: the loop that is guaranteed (`docs/guarantees.md`).
    Certified(CertifiedTable),
}

/// A certified terminal set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CertifiedTable {
    /// File written by `ballbot certify`, relative to the scenario file; the certificate of the
    /// built-in scenarios' robot when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<String>,
    /// Cost of (artificial set point - reference)^2, 1/rad^2; the terminal cost of 1 rad beside
    /// the set point when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_weight: Option<f64>,
    /// Runge-Kutta steps per sample of the rollout by which plans are judged; as few as the guarantee
    /// needs when absent. Fewer are refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub substeps: Option<usize>,
}

/// The predictor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PredictorTable {
    /// The paper's: Runge-Kutta of order four with the scheduling frozen over the sample.
    Rk4 {
        /// Steps per sample.
        substeps: usize,
    },
    /// The matrix exponential, with the scheduling frozen over the sample.
    Exact {
        /// Runge-Kutta steps per sample of the nonlinear rollout; chosen from the fastest pole
        /// when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        substeps: Option<usize>,
    },
    /// Runge-Kutta of order four with the scheduling of every stage of every step.
    StageConsistent {
        /// Steps per sample; chosen from the fastest pole when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        substeps: Option<usize>,
    },
}

/// Bounds [lower, upper]; `-inf` and `inf` where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundsTable {
    /// Ball angle, rad.
    #[serde(default = "unbounded")]
    pub phi_rad: [f64; 2],
    /// Tilt, rad.
    #[serde(default = "unbounded")]
    pub theta_rad: [f64; 2],
    /// Ball speed, rad/s.
    #[serde(default = "unbounded")]
    pub phi_dot_rad_s: [f64; 2],
    /// Tilt rate, rad/s.
    #[serde(default = "unbounded")]
    pub theta_dot_rad_s: [f64; 2],
    /// Torque of the virtual wheel, N m.
    pub torque_nm: [f64; 2],
}

fn unbounded() -> [f64; 2] {
    [f64::NEG_INFINITY, f64::INFINITY]
}

/// A state of one plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateTable {
    /// Ball angle, rad.
    #[serde(default)]
    pub phi_rad: f64,
    /// Tilt, rad.
    #[serde(default)]
    pub theta_rad: f64,
    /// Ball speed, rad/s.
    #[serde(default)]
    pub phi_dot_rad_s: f64,
    /// Tilt rate, rad/s.
    #[serde(default)]
    pub theta_dot_rad_s: f64,
}

/// What phi has to follow, in one plane or in two.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ReferenceTable {
    /// Steps between set points.
    SetPoints {
        /// In order of time; the first one holds from the beginning.
        points: Vec<PointTable>,
    },
    /// A sine wave.
    Sine(SineTable),
    /// Minimum-jerk moves from point to point.
    MinimumJerk {
        /// In order of time; at rest at each of them.
        points: Vec<PointTable>,
    },
    /// Straight lines from point to point; the ends hold.
    Lines {
        /// In order of time.
        points: Vec<PointTable>,
    },
    /// A file.
    Csv(CsvTable),
    /// Two planes: X = amplitude sin(omega t) in each.
    Lissajous(LissajousTable),
    /// Two planes, each with a reference of its own.
    Planes {
        /// The x plane.
        x: Box<ReferenceTable>,
        /// The y plane.
        y: Box<ReferenceTable>,
    },
}

/// Where phi is to be at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointTable {
    /// Time, s.
    pub time_s: f64,
    /// Ball angle, rad.
    pub phi_rad: f64,
}

/// phi = offset + amplitude sin(omega t + phase).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SineTable {
    /// Amplitude, rad.
    pub amplitude_rad: f64,
    /// Angular frequency omega, rad/s.
    pub angular_frequency_rad_s: f64,
    /// Phase at time zero, rad.
    #[serde(default)]
    pub phase_rad: f64,
    /// Mean value, rad.
    #[serde(default)]
    pub offset_rad: f64,
}

impl ReferenceTable {
    /// The files of its planes.
    fn files(&self) -> Vec<&str> {
        match self {
            Self::Csv(table) => vec![&table.path],
            Self::Planes { x, y } => [x.files(), y.files()].concat(),
            _ => Vec::new(),
        }
    }
}

/// A reference file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CsvTable {
    /// CSV file with a header, relative to the scenario file.
    pub path: String,
    /// Column of the time, s.
    #[serde(default = "default_time_column")]
    pub time_column: String,
    /// Column of phi, rad.
    #[serde(default = "default_phi_column")]
    pub phi_column: String,
}

fn default_time_column() -> String {
    "t_s".to_owned()
}

fn default_phi_column() -> String {
    "phi_ref_rad".to_owned()
}

/// A Lissajous curve in the plane of the floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LissajousTable {
    /// Amplitude along x, m.
    pub amplitude_x_m: f64,
    /// Amplitude along y, m.
    pub amplitude_y_m: f64,
    /// Angular frequency along x, rad/s.
    pub angular_frequency_x_rad_s: f64,
    /// Angular frequency along y, rad/s.
    pub angular_frequency_y_rad_s: f64,
    /// Phase of x at time zero, rad.
    #[serde(default)]
    pub phase_x_rad: f64,
    /// Phase of y at time zero, rad.
    #[serde(default)]
    pub phase_y_rad: f64,
}

/// Tolerances of the simulated plant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntegrationTable {
    /// Relative tolerance.
    #[serde(default = "default_tolerance")]
    pub relative_tolerance: f64,
    /// Absolute tolerance, in rad and rad/s.
    #[serde(default = "default_tolerance")]
    pub absolute_tolerance: f64,
}

fn default_tolerance() -> f64 {
    1e-9
}

impl Default for IntegrationTable {
    fn default() -> Self {
        Self {
            relative_tolerance: default_tolerance(),
            absolute_tolerance: default_tolerance(),
        }
    }
}
