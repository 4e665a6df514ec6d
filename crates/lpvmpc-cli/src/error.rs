//! Why a command has no result.

use lpvmpc_any::MpcError;
use lpvmpc_certify::CertifyError;
use lpvmpc_design::MatrixError;
use lpvmpc_figures::FigureError;
use lpvmpc_plant::PlantError;
use lpvmpc_terminal::output::FileError;
use std::io;
use std::path::PathBuf;

/// Why a command has no result: what is wrong, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: io::Error,
    },
    /// A plant's file is none.
    #[error("{}: {source}", path.display())]
    Plant {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        source: PlantError,
    },
    /// What stands in an experiment makes no sense.
    #[error("{}: {fault}", path.display())]
    Experiment {
        /// The file.
        path: PathBuf,
        /// Place and fault.
        fault: String,
    },
    /// Matrices of a plant.
    #[error("the linearisation: {0}")]
    Matrix(#[from] MatrixError),
    /// Derivatives of a plant.
    #[error("the linearisation: {0}")]
    Linearisation(#[from] PlantError),
    /// A closed loop that did not come to its end, or a regulator that there is not.
    #[error("{0}")]
    NoResult(String),
    /// A step of the controller, or a command to the world.
    #[error(transparent)]
    Step(#[from] MpcError),
    /// A file that was to be written.
    #[error(transparent)]
    Output(#[from] FileError),
    /// A figure that cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A certificate's file that is none, or whose claims were not proved.
    #[error("{}: {source}", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        source: CertifyError,
    },
    /// A certificate that there is not.
    #[error(transparent)]
    Certify(#[from] CertifyError),
}
