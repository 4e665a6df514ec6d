//! `ballbot scenario`.

use super::CommandError;
use crate::json;
use crate::table::Table;
use ballbot_scenario::{Scenario, ScenarioError, builtin};
use clap::{Args, Subcommand};
use serde_json::{Value, json};

/// Arguments of `ballbot scenario`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot scenario list
  ballbot scenario show two-setpoints > my.toml   a file to edit
  ballbot simulate my.toml                        and to run")]
pub struct ScenarioArguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the built-in scenarios
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Print a built-in scenario as commented TOML
    Show {
        /// Its name
        name: String,
    },
}

/// Lists or shows.
///
/// # Errors
/// An unknown name.
pub fn run(arguments: &ScenarioArguments) -> Result<String, CommandError> {
    match &arguments.action {
        Action::List { json } => {
            let mut table = Table::new(["name", "title"]);
            let mut documents = Vec::new();
            for builtin in builtin::ALL {
                let title = Scenario::parse(builtin.text, builtin.name)?.title;
                documents.push(json!({ "name": builtin.name, "title": title }));
                table.row([builtin.name.to_owned(), title]);
            }
            Ok(match json {
                true => json::text(&Value::Array(documents)),
                false => table.to_string(),
            })
        }
        Action::Show { name } => match builtin::find(name) {
            Some(builtin) => Ok(builtin.text.to_owned()),
            None => Err(ScenarioError::unknown(name).into()),
        },
    }
}
