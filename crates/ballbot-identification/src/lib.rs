//! A ballbot's parameters from its logs.

pub mod log;

mod coordinates;
mod estimate;
mod model;
pub mod noise;
mod parameter;
mod segments;
mod start;

pub use coordinates::{Coordinates, LONGEST_DELAY};
pub use estimate::{Estimate, EstimateError, Progress, Status, Task};
pub use model::{Robot, Segment, SegmentedRuns};
pub use parameter::{Choice, Parameter, Values};
pub use segments::{Split, segments};
