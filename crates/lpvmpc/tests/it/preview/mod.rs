//! What a controller may be told ahead: references, weights, bounds, rows, outputs, disturbances, scheduling and
//! models by stage, against problems that are written out anew here.

mod case;
mod changes;
mod closed_loop;
mod dense;
mod linear;
mod nonlinear;
mod outputs;
mod parts;
mod plants;
mod refused;
mod short_case;
