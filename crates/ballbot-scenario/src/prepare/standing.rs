//! What is known of a certificate.

use std::fmt;

/// What is known of a certificate that a scenario relies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// The program's own ([`crate::builtin::TERMINAL_CERTIFICATE`]), which its tests prove.
    BuiltIn,
    /// Proved by this version of the program, now or before.
    Proved,
    /// Taken at its word.
    NotProved,
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BuiltIn => "built in; the tests of this version prove it",
            Self::Proved => "proved by this version of the program",
            Self::NotProved => "not proved here, taken at its word",
        })
    }
}
