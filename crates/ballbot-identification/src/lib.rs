//! A ballbot's parameters from its logs.
//!
//! A log (time, ball angle, tilt, tilt rate, torque) is read and looked at ([`log::read`]); the
//! robot that explains it is found by simulating it, never by differentiating noise, and judged
//! ([`identify`]). Everything is in SI units from the moment a column has been read.
//!
//! State x = (phi, theta, phi_dot, theta_dot), both angles against the vertical; signs and
//! parameters are those of [`ballbot::Ballbot`].
//!
//! What to log, and what it will tell, is worked out first:
//!
//! ```
//! use ballbot_identification::{Config, ExcitationTask, Parameter, Values};
//! use nalgebra::Vector3;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = Config::parse(Config::EXAMPLE)?;
//! let (geometry, choices) = (config.geometry(), config.choices()?);
//! let task = ExcitationTask {
//!     robot: Values::expected(&choices, &geometry),
//!     geometry,
//!     choices,
//!     band: (0.2, 5.0),
//!     harmonics: 10,
//!     amplitude: 1.0,
//!     duration: 20.0,
//!     tilt_limit: 0.2,
//!     rate: 200.0,
//!     noise: Vector3::new(1e-3, 1e-3, 5e-3),
//!     gain: None,
//!     segment: config.fit.segment_s,
//!     gyroscope: true,
//! };
//! let excitation = task.design()?;
//! let b1 = excitation.standard_deviations[Parameter::B1];
//! println!("{} s of up to {:.2} N m tell b1 to {b1:.1e} m^2", 20.0, excitation.amplitude);
//! assert!(excitation.amplitude <= 1.0 && excitation.tilt <= 0.2 * 1.01);
//! # Ok(())
//! # }
//! ```

pub mod log;
pub mod noise;

mod ball_angle;
mod config;
mod coordinates;
mod covariance;
mod estimate;
mod excitation;
mod identification;
mod joint;
mod line;
mod miswiring;
mod model;
mod parameter;
mod parameter_file;
mod poles;
mod published;
mod residuals;
mod robot;
mod segments;
mod start;
mod structures;
mod summary;
mod suspects;
mod validation;
mod variables;
mod varied;
mod verdict;
mod wheel_check;
mod words;

pub use ball_angle::OtherReading;
pub use config::{Config, ConfigError, GeometryTable};
pub use coordinates::{Coordinates, LONGEST_DELAY};
pub use estimate::{Coarse, Effort, Estimate, EstimateError, Progress, Status, Task};
pub use excitation::{Excitation, ExcitationError, ExcitationTask};
pub use identification::{Identification, ballbot};
pub use joint::{Joint, JointEstimate, PLANES};
pub use miswiring::{Miswiring, WheelColumns};
pub use model::{LONGEST_STEP, Robot, Segment, SegmentedRuns};
pub use parameter::{Choice, Parameter, Values};
pub use parameter_file::{Identified, identified_parameters};
pub use poles::{Pole, linear_model, uncertain_poles};
pub use published::{LinearRegression, regression};
pub use residuals::{
    Difference, OUTPUTS, OutputResidual, ScoreTest, Scores, SegmentResidual, score_tests,
};
pub use robot::{IdentifiedRobot, OfPlane, USUAL_STEPS, identify};
pub use segments::{Split, Stretch, segments};
pub use structures::{Compared, Structure, best, compare};
pub use summary::{
    LogSummary, ParameterSummary, PlaneSummary, PoleSummary, ResidualSummary, Summary, Uncertainty,
    VerdictSummary,
};
pub use suspects::{Suspect, Suspects, Tables};
pub use validation::{HORIZONS, Validation, validate};
pub use variables::Variables;
pub use verdict::{Verdict, Weight};
pub use wheel_check::{Arrangement, Push, WheelCheck, azimuths_seen};
