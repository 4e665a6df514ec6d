//! Controllers of any size.

mod agreement;
mod messages;
mod plants;
mod stages;
