//! What stands in a file: tables as they are written, with no more checks than their form.

pub(crate) mod certificate;
pub(crate) mod document;
pub(crate) mod feedback_table;
pub(crate) mod heading_table;
mod load;
pub(crate) mod parameters;
pub(crate) mod schema;
pub(crate) mod world_table;
