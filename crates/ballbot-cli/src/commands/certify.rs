//! `ballbot certify`.

use super::CommandError;
use super::robot::ScenarioOptions;
use crate::arguments::positive;
use crate::certificate_page;
use crate::json;
use crate::progress::Progress;
use crate::results::ResultFolder;
use crate::table::{Table, number};
use ballbot_scenario::{TerminalCertificate, number as numbers, proofs};
use ballbot_studies::{CertificateSearch, ProvedSet, Searching};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use lpvmpc_certificate::{MOST_BOXES, Proof};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Arguments of `ballbot certify`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot certify                          the largest set of the scenario two-setpoints
  ballbot certify my.toml --size 0.1       a tenth of the tilt's and the tilt rate's bounds
  ballbot verify out/certificate/certificate.json

Finds K, P and the set x'Px <= level, and proves for the sampled nonlinear robot that the law
u = -K x, held over each sample, keeps the state in the set, within all bounds, and decreases the
cost. The level is raised as far as limits and proof allow. Writes certificate.json and a page with
the set (certificate.html).")]
pub struct CertifyArguments {
    /// A built-in scenario or a TOML file: robot, sampling time, weights and bounds
    #[arg(default_value = "two-setpoints")]
    pub scenario: String,
    /// What it is changed by.
    #[command(flatten)]
    pub options: ScenarioOptions,
    /// Share of the bounds of tilt and tilt rate that the set may use [default: searched for]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub size: Option<f64>,
    /// Level of the designed set x'Px <= LEVEL, in units of the cost
    #[arg(long, default_value_t = CertificateSearch::LEVEL, value_parser = positive)]
    pub level: f64,
    /// Share of the cost by which the design decreases it beyond the stage cost; more makes the
    /// proof shorter and P larger
    #[arg(long, default_value_t = CertificateSearch::CONTRACTION, value_parser = share)]
    pub contraction: f64,
    /// Most boxes of states in one proof
    #[arg(long, default_value_t = CertificateSearch::BOXES, value_parser = RangedU64ValueParser::<usize>::new().range(1..=MOST_BOXES as u64))]
    pub boxes: usize,
    /// Higher levels that are tried for the same K and P after the design, each a proof; 0 keeps
    /// the level
    #[arg(long, value_name = "TRIALS", default_value_t = CertificateSearch::TRIALS, value_parser = RangedU64ValueParser::<usize>::new().range(0..=CertificateSearch::MOST_TRIALS as u64))]
    pub raise: usize,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "out/certificate")]
    pub out: PathBuf,
}

fn share(text: &str) -> Result<f64, String> {
    let value = positive(text)?;
    if value <= 1.0 {
        Ok(value)
    } else {
        Err(format!(
            "{} is not a share, from 0 to 1",
            numbers::text(value)
        ))
    }
}

/// Designs, proves and writes.
///
/// # Errors
/// The scenario is not valid, no set could be proved, or a file cannot be written.
pub fn run(arguments: &CertifyArguments) -> Result<String, CommandError> {
    let (scenario, folder) = arguments.options.load(&arguments.scenario)?;
    // Its certificate, where it has one, is about to be replaced.
    let scenario = scenario.uncertified();
    let prepared = scenario.prepare(folder.as_path())?;
    let names = ["certificate.json", "certificate.html"];
    let results = ResultFolder::open(crate::PROGRAM, &arguments.out, &names)?;
    let search = CertificateSearch {
        prepared: &prepared,
        size: arguments.size,
        contraction: arguments.contraction,
        level: arguments.level,
        boxes: arguments.boxes,
        trials: arguments.raise,
        written_by: format!("ballbot {}", env!("CARGO_PKG_VERSION")),
    };
    let bars = Bars(Mutex::default());
    let (certificate, proof) = search.run(&|searching| bars.show(searching))?;
    drop(bars);
    proofs::remember(&certificate);
    let json = certificate.to_json()?;
    let page = certificate_page::html(&prepared.title, &certificate, &proof)?;
    let contents = [json.into_bytes(), page.into_bytes()];
    let files: Vec<_> = names.map(str::to_owned).into_iter().zip(contents).collect();
    results.write(&files, &[])?;
    let paths = names.map(|name| arguments.out.join(name));
    if arguments.json {
        let mut document = document(&certificate, &proof);
        document["files"] = paths.iter().map(|path| json::path(path)).collect();
        return Ok(json::text(&document));
    }
    Ok(format!(
        "{}\nwrote {} and {}\n",
        summary(&certificate, &proof),
        paths[0].display(),
        paths[1].display()
    ))
}

/// Bars for what the search is at, one after the other.
struct Bars(Mutex<(String, Option<Progress>)>);

impl Bars {
    fn show(&self, searching: Searching) {
        let (what, done) = match searching {
            Searching::Designing(done) => ("designing sets".to_owned(), done),
            Searching::Proving { size, done } => {
                (format!("proving a set of {size:.3} of the bounds"), done)
            }
            Searching::Raising(done) => ("raising the level".to_owned(), done),
        };
        let mut bar = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if bar.0 != what || bar.1.is_none() {
            // The old one ends before the new one begins.
            bar.1 = None;
            *bar = (what.clone(), Some(Progress::of_parts(what)));
        }
        if let Some(progress) = &bar.1 {
            progress.set_part(done);
        }
    }
}

/// What is proved, in words and numbers.
pub(super) fn summary(certificate: &TerminalCertificate, proof: &Proof<4>) -> String {
    let TerminalCertificate {
        t_s,
        scheduling_limits,
        terminal,
        continuous,
        ..
    } = certificate;
    let names = [
        "phi [rad]",
        "theta [rad]",
        "phi_dot [rad/s]",
        "theta_dot [rad/s]",
    ];
    let largest = terminal.largest_states();
    let k = nalgebra::DMatrix::from_row_slice(1, 4, terminal.k.as_slice());
    let reach = nalgebra::DMatrix::from_fn(
        2,
        4,
        |i, j| {
            if i == 0 { largest[j] } else { proof.reach[j] }
        },
    );
    format!(
        "Proved for the model with exactly the parameters in the file, the exact state and no delay,\n\
         under u = -K x, held over {t_s} s, for every x with x'Px <= {}:\n  \
         x'Px decreases per sample by the stage cost and {} of itself, at least\n  \
         all limits in the file hold, those of the states also between samples\n\
         Proved for the same model in continuous time, without sampling, for |theta| <= {} deg and\n\
         |theta_dot| <= {} rad/s, however they move:\n  \
         A - BK is quadratically stable with the rate {} 1/s\n\n\
         Gain for u = -K x\n{}\n{}\n\
         {} boxes of states, {} of schedulings\n",
        number(terminal.level),
        number(terminal.contraction),
        number(scheduling_limits[0].to_degrees()),
        number(scheduling_limits[1]),
        number(continuous.rate_1_s),
        Table::of_matrix(names, &["K"], &k),
        Table::of_matrix(
            names,
            &["at samples, at most", "between samples, below"],
            &reach
        ),
        proof.boxes,
        proof.scheduling_boxes,
    )
}

/// The same for other programs.
pub(super) fn document(certificate: &TerminalCertificate, proof: &Proof<4>) -> Value {
    let mut document = json!({ "holds": true });
    json::extend(&mut document, &ProvedSet::new(certificate, proof));
    document
}
