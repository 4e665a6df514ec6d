//! The command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Predictive control of a plant from a file.
#[derive(Debug, Parser)]
#[command(
    name = "lpvmpc",
    version,
    after_help = "\
Examples:
  lpvmpc example plant > cart-pole.json
  lpvmpc example > cart-pole.toml
  lpvmpc plant cart-pole.json          what the plant is
  lpvmpc simulate cart-pole.toml       its closed loop, into out/cart-pole
  lpvmpc lqr cart-pole.toml            the regulator of its sampled plant

Exit codes: 0 done, 1 no result (the message says why), 2 the command line is not understood, 130
interrupted (what was written by then is listed; no file is half-written)."
)]
pub struct Arguments {
    /// No progress bar, and no report where the results are in files; errors are still printed
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check a plant file and say what the plant is
    Plant(PlantArguments),
    /// Print an experiment to begin with, or its plant
    Example(ExampleArguments),
    /// Run the closed loop of an experiment and record it
    Simulate(SimulateArguments),
    /// Time the controller along its closed loop
    Bench(ExperimentArguments),
    /// Design the linear-quadratic regulator of the sampled plant
    Lqr(ExperimentArguments),
    /// Find a terminal set and prove it
    Certify(CertifyArguments),
    /// Prove the claims of a certificate again
    Verify(VerifyArguments),
    /// Print the controller as a program for a microcontroller
    Firmware(FirmwareArguments),
}

impl Command {
    /// Whether the results are in files, and what is printed tells of them.
    pub fn reports_files(&self) -> bool {
        match self {
            Self::Simulate(given) => !given.json,
            Self::Certify(given) => given.out.is_some(),
            Self::Firmware(_) => true,
            _ => false,
        }
    }
}

/// A plant.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lpvmpc plant cart-pole.json --json")]
pub struct PlantArguments {
    /// The plant's file, JSON
    pub file: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// What is to be printed.
#[derive(Debug, Args)]
pub struct ExampleArguments {
    /// Which of the two files
    #[arg(value_enum, default_value_t = Example::Experiment)]
    pub what: Example,
}

/// A file of the example.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Example {
    /// The experiment, TOML
    Experiment,
    /// Its plant, JSON
    Plant,
}

/// An experiment.
#[derive(Debug, Args)]
pub struct ExperimentArguments {
    /// The experiment, TOML
    pub experiment: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// An experiment, and where its results go.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes trajectory.csv, summary.json, figure.svg and figure.png. The cost of states (state_cost in summary.json) is the\n\
sum over the samples of (x - x_ref)'Q (x - x_ref), without the inputs; without a reference x_ref is the plant's equilibrium.\n\
Jumps and loads that the run ends before are told on standard error.\n\n\
Example:\n  lpvmpc simulate cart-pole.toml --out results"
)]
pub struct SimulateArguments {
    /// The experiment, TOML
    pub experiment: PathBuf,
    /// Folder of the results [default: out/ and the name of the experiment]
    #[arg(short, long)]
    pub out: Option<PathBuf>,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
}

/// An experiment, and where its certificate goes.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lpvmpc certify cart-pole.toml --out certificate.json")]
pub struct CertifyArguments {
    /// The experiment, TOML
    pub experiment: PathBuf,
    /// File of the certificate [default: standard output]
    #[arg(short, long)]
    pub out: Option<PathBuf>,
}

/// An experiment, and where its controller's program goes.
#[derive(Debug, Args)]
#[command(
    after_help = "The program is a whole crate of Rust in f32, without heap: `cargo build` makes it for a Cortex-M4F, \
`cargo run`\non an emulated board brings the plant itself from x0 to the last reference.\n\n\
Example:\n  lpvmpc firmware cart-pole.toml --lpvmpc crates/lpvmpc --out robot"
)]
pub struct FirmwareArguments {
    /// The experiment, TOML
    pub experiment: PathBuf,
    /// The folder of the crate lpvmpc, which the program uses: crates/lpvmpc of a checkout
    #[arg(long)]
    pub lpvmpc: PathBuf,
    /// A new folder for the program
    #[arg(short, long)]
    pub out: PathBuf,
}

/// A certificate, and what it is of.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lpvmpc verify certificate.json cart-pole.json")]
pub struct VerifyArguments {
    /// The certificate, JSON
    pub certificate: PathBuf,
    /// Its plant, JSON
    pub plant: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
