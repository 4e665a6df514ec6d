//! Enclosures contain what they enclose, certificates and claims hold, and forged ones do not.

mod enclosure;
mod forgeries;
mod pendulum;
mod rollout;
mod terminal;
