//! Writes the sequences on which solvers are compared into a folder:
//!
//! ```text
//! write-problems FOLDER [size=4x1,8x2] [horizon=20,50] [kind=inputs,soft] [share=0,0.4] [seed=1,2]
//! ```
//!
//! A file that is there already is kept.

use lpvmpc::Ocp;
use lpvmpc_problems::file;
use lpvmpc_problems::header::Header;
use lpvmpc_problems::layout::Sizes;
use lpvmpc_sequences::{Kind, Recipe};
use std::error::Error;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Problems of a sequence.
const SAMPLES: usize = 12;

const KEYS: [&str; 5] = ["size", "horizon", "kind", "share", "seed"];
const SIZES: [&str; 4] = ["4x1", "8x2", "12x4", "16x6"];
const HORIZONS: [&str; 4] = ["20", "50", "100", "200"];
const SHARES: [&str; 6] = ["0", "0.1", "0.2", "0.4", "0.6", "0.8"];
/// The one whose files have no seed in their names.
const SEED: &str = "1";

/// What to write of everything.
struct Selection {
    folder: PathBuf,
    chosen: Vec<String>,
}

impl Selection {
    fn from_arguments(mut arguments: impl Iterator<Item = String>) -> Result<Self, String> {
        let folder = arguments.next().filter(|word| !word.starts_with('-')).ok_or(
            "usage: write-problems FOLDER [size=4x1,...] [horizon=20,...] [kind=inputs,...] [share=0,...] [seed=1,...]",
        )?;
        let chosen: Vec<String> = arguments.collect();
        let known = |word: &String| {
            word.split_once('=')
                .is_some_and(|(key, _)| KEYS.contains(&key))
        };
        let key = |word: &str| word.split_once('=').map(|(key, _)| key.to_owned());
        let twice =
            |(i, word): (usize, &String)| chosen[..i].iter().any(|other| key(other) == key(word));
        if chosen.iter().enumerate().any(twice) {
            return Err("a key is there twice: separate its values by commas".to_owned());
        }
        match chosen.iter().find(|word| !known(word)) {
            Some(word) => Err(format!(
                "{word}: it must be KEY=VALUE,... with a key of {KEYS:?}"
            )),
            None => Ok(Self {
                folder: PathBuf::from(folder),
                chosen,
            }),
        }
    }

    /// The chosen values of a key, or all there are.
    fn of<'a>(&'a self, key: &str, all: &[&'a str]) -> Vec<&'a str> {
        let of_key = |word: &'a String| word.strip_prefix(key)?.strip_prefix('=');
        match self.chosen.iter().find_map(of_key) {
            Some(list) => list.split(',').collect(),
            None => all.to_vec(),
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let selection = Selection::from_arguments(std::env::args().skip(1))?;
    std::fs::create_dir_all(&selection.folder)?;
    let kinds = Kind::ALL.map(Kind::name);
    for size in selection.of("size", &SIZES) {
        for horizon in selection.of("horizon", &HORIZONS) {
            for name in selection.of("kind", &kinds) {
                let kind = Kind::ALL.into_iter().find(|kind| kind.name() == name);
                let kind =
                    kind.ok_or_else(|| format!("kind {name}: it must be one of {kinds:?}"))?;
                for share in selection.of("share", &SHARES) {
                    for seed in selection.of("seed", &[SEED]) {
                        let recipe = Recipe {
                            kind,
                            horizon: number("horizon", horizon)?,
                            samples: SAMPLES,
                            share: number("share", share)?,
                            seed: number("seed", seed)?,
                        };
                        let of_seed = match seed {
                            SEED => String::new(),
                            other => format!("-seed{other}"),
                        };
                        let path = format!("{size}-N{horizon}-{name}-{share}{of_seed}.qps");
                        write_one(size, &recipe, &selection.folder.join(path))?;
                    }
                }
            }
        }
    }
    Ok(())
}

fn number<T: FromStr<Err: Display>>(key: &str, text: &str) -> Result<T, String> {
    text.parse()
        .map_err(|reason| format!("{key}={text}: it must be a number ({reason})"))
}

/// Makes and writes a sequence. A recipe for which there is none is said and left out: not every share
/// can be reached with every kind.
fn write_one(size: &str, recipe: &Recipe, path: &Path) -> Result<(), Box<dyn Error>> {
    if path.exists() {
        return Ok(());
    }
    match size {
        "4x1" => make::<4, 1>(recipe, path),
        "8x2" => make::<8, 2>(recipe, path),
        "12x4" => make::<12, 4>(recipe, path),
        "16x6" => make::<16, 6>(recipe, path),
        _ => Err(format!("size {size}: it must be one of {SIZES:?}").into()),
    }
}

fn make<const NX: usize, const NU: usize>(
    recipe: &Recipe,
    path: &Path,
) -> Result<(), Box<dyn Error>> {
    let sequence = match recipe.make::<NX, NU>() {
        Ok(sequence) => sequence,
        Err(reason) => {
            println!("no {}: {reason}", path.display());
            return Ok(());
        }
    };
    let problems = &sequence.problems;
    let first: &Ocp<f64, NX, NU> = problems.first().ok_or("a sequence without problems")?;
    let header = Header {
        sizes: Sizes::of(first),
        common: problems.iter().all(|ocp| ocp.own.is_empty()),
        problems: problems.len(),
        kind: recipe.kind.name().to_owned(),
        wanted: recipe.share,
        share: sequence.share,
    };
    // Under another name first, so that a file is whole or not there.
    let unfinished = path.with_extension("part");
    file::write(&unfinished, &header, problems)?;
    std::fs::rename(&unfinished, path)?;
    println!("{}: {header}", path.display());
    Ok(())
}
