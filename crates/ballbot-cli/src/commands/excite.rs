//! `ballbot excite`.

use super::CommandError;
use super::identify::configuration;
use crate::arguments::{finite_list, positive};
use crate::input::{self, InputError};
use crate::json;
use crate::output;
use crate::table::{Table, number};
use ballbot_identification::{Config, Excitation, ExcitationTask, identified_parameters};
use clap::Args;
use nalgebra::Vector4;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Arguments of `ballbot excite`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot excite --config my-robot.toml                     from masses, priors or starts
  ballbot excite --parameters out/identification/parameters.toml
  ballbot excite --amplitude 2 --tilt-limit 8 --gain=-1.4,-48,-1.8,-11

Add the torque to that of the loop that holds the robot, log, and identify. Without --gain the loop
is an LQR of the expected robot. Gains are for u = -K x, x = (phi, theta, phi_dot, theta_dot).")]
pub struct ExciteArguments {
    /// The expected robot, lengths, noise [default: the paper's lengths]
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// A robot from `ballbot identify`, with its lengths, in place of what the configuration expects
    #[arg(long, value_name = "parameters.toml")]
    pub parameters: Option<PathBuf>,
    /// Lowest and highest frequency, Hz [default: 0.2,6]
    #[arg(long, value_name = "LOW,HIGH", value_parser = finite_list::<2>)]
    pub band: Option<[f64; 2]>,
    /// Number of harmonics
    #[arg(long, default_value_t = ExcitationTask::HARMONICS, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(2..=10_000))]
    pub harmonics: usize,
    /// Largest torque of the excitation, N m
    #[arg(long, value_parser = positive, default_value_t = ExcitationTask::AMPLITUDE)]
    pub amplitude: f64,
    /// Duration, s
    #[arg(long, value_name = "SECONDS", value_parser = positive, default_value_t = ExcitationTask::DURATION)]
    pub length: f64,
    /// Largest tilt, degrees; the torque is reduced until it is kept
    #[arg(long, value_name = "DEGREES", value_parser = positive, default_value_t = ExcitationTask::TILT_LIMIT_DEG)]
    pub tilt_limit: f64,
    /// Rows per second of loop and log
    #[arg(long, value_name = "HZ", value_parser = positive, default_value_t = ExcitationTask::RATE)]
    pub rate: f64,
    /// Gains of your loop, N m per rad and per rad/s
    #[arg(long, value_parser = finite_list::<4>, allow_hyphen_values = true, value_name = "K1,K2,K3,K4")]
    pub gain: Option<[f64; 4]>,
    /// Where to write the torque
    #[arg(
        short,
        long,
        value_name = "FILE.csv",
        default_value = "out/excitation.csv"
    )]
    pub out: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Designs, predicts and writes.
///
/// # Errors
/// A file cannot be used or written, or there is no such excitation.
pub fn run(arguments: &ExciteArguments) -> Result<String, CommandError> {
    let config = configuration(arguments.config.as_deref())?;
    let task = task(arguments, &config)?;
    let given = [&arguments.config, &arguments.parameters];
    output::check_separate(
        &arguments.out,
        given.into_iter().flatten().map(|one| one.as_path()),
    )?;
    let excitation = task.design()?;
    let csv = excitation.csv();
    output::write_files(&[(&arguments.out, csv.as_bytes())])?;
    Ok(if arguments.json {
        json::text(&document(&task, &excitation, &arguments.out))
    } else {
        report(&task, &excitation, &arguments.out)
    })
}

fn task(arguments: &ExciteArguments, config: &Config) -> Result<ExcitationTask, CommandError> {
    let identified = arguments.parameters.as_ref();
    let identified = identified.map(|path| input::parse(path, identified_parameters));
    let usual = ExcitationTask::of(config, identified.transpose()?.as_ref());
    let usual = usual.map_err(|source| InputError::Identification {
        path: arguments.config.clone().unwrap_or_default(),
        source,
    })?;
    Ok(ExcitationTask {
        band: arguments.band.map_or(usual.band, Into::into),
        harmonics: arguments.harmonics,
        amplitude: arguments.amplitude,
        duration: arguments.length,
        tilt_limit: arguments.tilt_limit.to_radians(),
        rate: arguments.rate,
        gain: arguments.gain.map(Vector4::from),
        ..usual
    })
}

fn report(task: &ExcitationTask, excitation: &Excitation, out: &Path) -> String {
    let mut text = String::new();
    let frequencies = &excitation.frequencies;
    let ends = [frequencies.first(), frequencies.last()].map(|end| end.copied().unwrap_or(0.0));
    let gain: Vec<String> = excitation.gain.iter().map(|k| number(*k)).collect();
    let _ = writeln!(
        text,
        "{} harmonics from {:.2} Hz to {:.2} Hz, {} s, at most {:.3} N m{}\n\
         expected in the loop u = -K x, K = ({}): tilt at most {:.2} deg, torque at most {:.2} N m, \
         travel at most {:.2} m\n",
        frequencies.len(),
        ends[0],
        ends[1],
        task.duration,
        excitation.amplitude,
        if excitation.amplitude < task.amplitude {
            " (less than asked for: the tilt limits it)"
        } else {
            ""
        },
        gain.join(", "),
        excitation.tilt.to_degrees(),
        excitation.total_torque,
        excitation.travel,
    );
    let mut table = Table::new([
        "parameter",
        "expected value",
        "expected std. dev.",
        "relative",
        "unit",
    ]);
    for parameter in task.told() {
        let (value, deviation) = (
            task.robot[parameter],
            excitation.standard_deviations[parameter],
        );
        let relative = 100.0 * (deviation / value).abs();
        table.row([
            parameter.key().to_owned(),
            format!("{value:.5}"),
            format!("{deviation:.2e}"),
            if relative.is_finite() {
                format!("{relative:.1} %")
            } else {
                String::new()
            },
            parameter.unit().to_owned(),
        ]);
    }
    let _ = writeln!(
        text,
        "What the log will tell (Cramer-Rao bound for noise of {:e} rad, {:e} rad, {:e} rad/s; a model \
         that is right)\n{table}\nwritten to {}",
        task.noise[0],
        task.noise[1],
        task.noise[2],
        out.display()
    );
    text
}

fn document(task: &ExcitationTask, excitation: &Excitation, out: &Path) -> Value {
    let parameters = task.told().map(|parameter| {
        let told = json!({
            "expected_value": task.robot[parameter],
            "expected_standard_deviation": excitation.standard_deviations[parameter],
        });
        (parameter.key().to_owned(), told)
    });
    json!({
        "frequencies_hz": excitation.frequencies,
        "length_s": task.duration,
        "amplitude_asked_nm": task.amplitude,
        "amplitude_nm": excitation.amplitude,
        "gain": excitation.gain.as_slice(),
        "largest_tilt_rad": excitation.tilt,
        "largest_torque_nm": excitation.total_torque,
        "largest_travel_m": excitation.travel,
        "noise": task.noise.as_slice(),
        "parameters": parameters.collect::<Map<_, _>>(),
        "file": json::path(out),
    })
}
