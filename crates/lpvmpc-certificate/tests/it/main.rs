//! Enclosures contain what they enclose, certificates hold, and forged ones do not.

mod enclosure;
mod forgeries;
mod pendulum;
mod terminal;
