//! The sizes that are compiled.

use crate::error::MpcError;

/// The most states that a plant may have.
pub const MOST_STATES: usize = 16;
/// The most inputs.
pub const MOST_INPUTS: usize = 6;

/// What a function of the numbers of states, inputs and both makes in the smallest size that has so many places for states and
/// inputs; none where there are more.
macro_rules! smallest {
    ($places:expr, $make:ident $arguments:tt) => {
        smallest!($places, $make $arguments, 2 1 3, 4 1 5, 4 2 6, 6 2 8, 8 4 12, 12 4 16, 16 6 22)
    };
    ($places:expr, $make:ident $arguments:tt, $($nx:literal $nu:literal $ns:literal),+) => {
        match $places {
            $((n, m) if n <= $nx && m <= $nu => Some($make::<$nx, $nu, $ns> $arguments),)+
            _ => None,
        }
    };
}
pub(crate) use smallest;

/// There is no size with so many places for states and inputs, of which so many states are last inputs.
pub(crate) fn too_many((n, m): (usize, usize), last_inputs: usize) -> MpcError {
    let fault = match n - last_inputs {
        states if last_inputs > 0 => format!(
            "there are {states} states and {m} inputs; where changes of the inputs cost \
             something or are bounded, the last inputs count as states, of which a controller \
             has at most {MOST_STATES}, beside at most {MOST_INPUTS} inputs"
        ),
        _ => format!(
            "there are {n} states and {m} inputs; a controller has at most {MOST_STATES} and \
             {MOST_INPUTS}"
        ),
    };
    MpcError::new("plant", fault)
}
