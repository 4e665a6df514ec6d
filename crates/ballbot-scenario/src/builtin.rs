//! The built-in scenarios: the paper's, to the letter, and what goes beyond it.

use crate::words;

/// A built-in scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Builtin {
    /// Its name on the command line.
    pub name: &'static str,
    /// The commented TOML file.
    pub text: &'static str,
}

macro_rules! builtin {
    ($name:literal) => {
        Builtin {
            name: $name,
            text: include_str!(concat!("builtin/", $name, ".toml")),
        }
    };
}

/// The certificate of a terminal set of the robot of the built-in scenarios, as JSON for
/// [`crate::TerminalCertificate`]: written by `ballbot certify --size 0.25`, checked by
/// `ballbot verify`.
pub const TERMINAL_CERTIFICATE: &str = include_str!("builtin/terminal-certificate.json");

/// All built-in scenarios.
pub const ALL: [Builtin; 8] = [
    builtin!("two-setpoints"),
    builtin!("two-setpoints-linear"),
    builtin!("lissajous"),
    builtin!("single-setpoint"),
    builtin!("single-setpoint-terminal"),
    builtin!("tight-bounds"),
    builtin!("far-setpoints"),
    builtin!("one-metre"),
];

/// The built-in scenario with this name.
pub fn find(name: &str) -> Option<Builtin> {
    ALL.into_iter().find(|builtin| builtin.name == name)
}

/// The built-in scenario whose name is most like `name`, if any is alike at all.
pub fn nearest(name: &str) -> Option<&'static str> {
    words::nearest(name, ALL.iter().map(|builtin| builtin.name))
}
