//! Plants from files are the plants that they say, and nothing else is one.

mod reference;
mod refused;
mod round_trip;
mod sized;
