//! Sequences of quadratic programs: the samples of a receding-horizon loop on a made-up linear
//! time-varying plant, of any size, with a wanted share of active bounds. Solvers are timed on them.
//! There are two plants: oscillators that follow waves, and points that go far away.
//!
//! The plant comes from a seed, by arithmetic that rounds in the same way on every machine. The loop is
//! closed by the solver of `lpvmpc`, and its states are rounded, so that a solver that adds in another
//! order meets the same problems.

mod chains;
mod closed_loop;
mod error;
mod limits;
mod oscillators;
mod plant;
mod share;

pub use closed_loop::{Sequence, working_memory};
pub use error::SequenceError;
pub use limits::Kind;

use chains::Chains;
use oscillators::Oscillators;
use plant::Plant;

/// What a sequence is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// What is bounded.
    pub kind: Kind,
    /// Stages of the horizon, N; 1 to 65 535.
    pub horizon: usize,
    /// Problems, at least 1.
    pub samples: usize,
    /// Active bounds divided by the inputs of a horizon, N `NU`, on average over the sequence; from 0 to 1.
    /// At 0 no bound is active in any problem.
    pub share: f64,
    /// Seed of the plant.
    pub seed: u64,
}

impl Recipe {
    /// The sequence for `NX` states and `NU` inputs: the same numbers for the same recipe. What is bounded
    /// is as tight as it must be for the share; it is found by bisection, which closes the loop a dozen
    /// times.
    ///
    /// # Errors
    /// [`SequenceError`]: a recipe that makes no sense, a share that no bounds lead to (within 0.05), or a
    /// problem that the solver leaves unsolved.
    pub fn make<const NX: usize, const NU: usize>(
        &self,
    ) -> Result<Sequence<NX, NU>, SequenceError> {
        self.check::<NX, NU>()?;
        match self.kind {
            Kind::Motion => share::with_share(self, &Chains::new(self.seed)),
            _ => share::with_share(self, &Oscillators::new(self.seed)),
        }
    }

    fn check<const NX: usize, const NU: usize>(&self) -> Result<(), SequenceError> {
        let refuse = |what, value: String, right| Err(SequenceError::Recipe { what, value, right });
        if NU == 0 || NX < NU {
            return refuse(
                "size",
                format!("{NX}x{NU}"),
                "an input or more, and as many states",
            );
        }
        if !(1..=usize::from(u16::MAX)).contains(&self.horizon) {
            return refuse("horizon", self.horizon.to_string(), "1 to 65 535 stages");
        }
        if self.samples == 0 {
            return refuse("samples", self.samples.to_string(), "1 or more");
        }
        if !(0.0..=1.0).contains(&self.share) {
            return refuse("share", self.share.to_string(), "a number from 0 to 1");
        }
        Ok(())
    }
}
