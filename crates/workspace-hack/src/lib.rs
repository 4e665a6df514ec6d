//! Nothing but dependencies, with the features that any program of the workspace asks of them. Every program and
//! the Python package depends on this crate, so that Cargo chooses the same features for each, and compiles a
//! crate once for all of them instead of once for each.
