//! Plants as data: formulas in a file, evaluated on any kind of number.
//!
//! A plant is x_dot = f(x, u, p), or in discrete time x+ = F(x, u, p), with named states, inputs and parameters, and if it has them outputs
//! y = g(x, u, p), an embedding of its own, bounds and a steady state. All its formulas are one
//! straight-line program, as other tools have them, too (CasADi's instructions of an `SX` function).
//! A [`Plant`] is read from JSON or made in Rust; [`SizedPlant`] and [`SizedEmbedding`] are what the
//! controllers, estimators and proofs of `lpvmpc` take.
//!
//! A pendulum with a torque at its joint, x_dot = (rate, g sin(angle) + u):
//!
//! ```
//! use lpvmpc::{AlongMotion, Dynamics, LpvModel};
//! use lpvmpc_plant::{Plant, PlantError, SizedPlant};
//! use nalgebra::{Vector1, Vector2};
//!
//! # fn main() -> Result<(), PlantError> {
//! let plant = Plant::from_json(r#"{
//!     "schema": 1,
//!     "name": "pendulum",
//!     "states": [{"name": "angle", "unit": "rad"}, {"name": "rate", "unit": "rad/s"}],
//!     "inputs": [{"name": "torque", "unit": "N m", "lower": -8, "upper": 8}],
//!     "parameters": [{"name": "gravity", "unit": "m/s^2", "value": 9.81}],
//!     "operations": [
//!         ["state", 0], ["state", 1], ["input", 0], ["parameter", 0],
//!         ["sin", 0], ["mul", 3, 4], ["add", 5, 2]
//!     ],
//!     "derivative": [1, 6],
//!     "equilibrium": {"x": [0, 0], "u": [0]}
//! }"#)?;
//! let mut pendulum = SizedPlant::<2, 1>::new(plant)?;
//! let (x, u) = (Vector2::new(0.5, 0.1), Vector1::new(2.0));
//! assert_eq!(pendulum.f(&x, &u), Vector2::new(0.1, 9.81 * 0.5_f64.sin() + 2.0));
//! pendulum.set_parameter("gravity", 1.62)?;
//! let (_, a, _) = AlongMotion::<_, 3>(pendulum).tangent(&x, &u);
//! assert!((a[(1, 0)] - 1.62 * 0.5_f64.cos()).abs() < 1e-15);
//! # Ok(())
//! # }
//! ```
//!
//! | for | use |
//! |---|---|
//! | a plant from a file, its values at run-time sizes | [`Plant`] |
//! | a plant written in Rust as a file | [`PlantData::of_dynamics`], [`PlantData::of_embedding`] |
//! | a linear plant | [`PlantData::of_matrices`] |
//! | a plant made operation by operation | [`PlantData`], [`Plant::new`] |
//! | a controller, estimator or simulation | [`SizedPlant`] by f alone, [`SizedEmbedding`] by its own A(s), B(s) |
//! | the plant as Rust | [`Plant::to_rust`] |
//! | a program for a microcontroller | [`Plant::to_firmware`] |
//! | a proof about a steady state | [`AboutEquilibrium`]: f as A(s) x + B(s) u, exactly, of its formulas alone |
//! | is a proof to be had of it? | [`Plant::first_jump`] |
//!
//! # Derivatives, and time
//!
//! [`SizedPlant`] and [`SizedEmbedding`] have their derivatives as formulas, made of the plant's own when the first of
//! them is built: what is always zero, one or of parameters alone costs nothing at an evaluation. Wherever dual numbers
//! ([`Dual`](lpvmpc::Dual)) have a value it is the same, to rounding, at kinks and ends, too; where they have none, next to
//! an infinite derivative, one that is always zero stays zero. Where the formulas would be longer than
//! 2 + (states + inputs)/2 times those of f, or longer than 30 000 operations, dual numbers are used instead.
//!
//! An operation takes some 20 machine instructions, and in a group of four points, as a controller linearises its
//! stages, a third of that for each.
//!
//! # The format
//!
//! | key | holds |
//! |---|---|
//! | `schema` | 1, the version of the format |
//! | `name` | of the plant |
//! | `states`, `inputs`, `outputs` | `name`, `unit`, and where there are bounds `lower`, `upper` |
//! | `parameters` | `name`, `unit`, `value` |
//! | `operations` | the program: each operation refers to results of earlier ones, counted from 0 |
//! | `derivative` | the results that are x_dot, one for each state |
//! | `period`, `next` | in place of `derivative`, of a plant in discrete time: its period in s, and the results that are x+, the state one period later |
//! | `output` | the results that are y, one for each output |
//! | `embedding` | `scheduling`: the results that are s; `a`, `b`: the rows of A(s), B(s); `c`: c(s), where it is not zero |
//! | `equilibrium` | `x` and `u` of a steady state within the bounds, f(x, u) = 0 or F(x, u) = x |
//!
//! `states`, `operations`, `derivative` (or `period` and `next`) and the first two must be there. Names and units are free text.
//!
//! | operation | is |
//! |---|---|
//! | `["constant", 9.81]` | a number |
//! | `["state", i]`, `["input", i]`, `["parameter", i]` | one of x, u, p |
//! | `["scheduling", i]` | one of s; only formulas of A, B and c may depend on it, and they on nothing else but p |
//! | `["add", i, j]` and `sub`, `mul`, `div` | of the results i and j |
//! | `["pow", i, j]` | i to the power of j: by multiplication where j is a whole constant, for i > 0 else |
//! | `["atan2", i, j]` | the angle of the point (j, i) |
//! | `["neg", i]` and `sq`, `inv`, `sqrt`, `exp`, `log`, `expm1`, `log1p` | -x, x^2, 1/x, ... |
//! | `["sin", i]` and `cos`, `tan`, `asin`, `acos`, `atan`, `sinh`, `cosh`, `tanh`, `asinh`, `acosh`, `atanh`, `sinc`, `sinhc` | sinc is sin(x)/x, sinhc is sinh(x)/x |
//! | `["abs", i]`; `["min", i, j]` and `max` | have kinks |
//! | `["mean_sign", i, j]` | (\|i\| - \|j\|)/(i - j), 0 where both are |
//! | `["sign", i]` and `floor` | jump: no proof |
//! | `["lt", i, j]` and `le`, `eq` | 1 or 0; no proof |
//! | `["if_else_zero", i, j]` | j where i is not 0, else 0; no proof |
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod about;
mod check;
mod claims;
mod code;
mod data;
mod derive;
mod equilibrium;
mod error;
mod factorise;
mod file;
mod firmware;
mod lanes;
mod linear;
mod operation;
mod plant;
mod prepared;
mod program;
mod recording;
mod registers;
mod sized;
mod source;
mod tangent;

pub use about::AboutEquilibrium;
pub use data::{EmbeddingData, Equilibrium, Parameter, PlantData, Signal};
pub use error::PlantError;
pub use file::Schema;
pub use firmware::{Files, FirmwareSettings};
pub use linear::Matrices;
pub use operation::{Binary, Operation, Unary};
pub use plant::Plant;
pub use sized::{SizedEmbedding, SizedPlant};
