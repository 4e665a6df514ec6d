//! The input file of `ballbot refine`: schema, checks, example.

use crate::input::{self, InputError};
use ballbot::Geometry;
use ballbot_scenario::{LinearModelTable, ScenarioError, number};
use ballbot_studies::{RefinementProblem, start_from};
use lpvmpc_design::LeastSquaresSettings;
use nalgebra::DVector;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RefinementFile {
    linear_model: LinearModelTable,
    geometry: GeometryTable,
    start: Option<StartTable>,
    weights: Option<WeightTable>,
    #[serde(default)]
    settings: SettingsTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeometryTable {
    centre_of_mass_m: f64,
    ball_radius_m: f64,
    wheel_radius_m: f64,
    gravity_m_s2: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StartTable {
    b1_m2: f64,
    b2_m2: f64,
    b3_m2: f64,
    b4_m2_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WeightTable {
    p1: Option<f64>,
    p2: Option<f64>,
    p3: Option<f64>,
    p4: Option<f64>,
    p5: Option<f64>,
    p6: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct SettingsTable {
    step_tolerance: Option<f64>,
    reduction_tolerance: Option<f64>,
    orthogonality_tolerance: Option<f64>,
    max_iterations: Option<usize>,
    stagnation_steps: Option<usize>,
    tilt_deg: Option<f64>,
}

/// The problem in a file.
///
/// # Errors
/// The file cannot be read, is not TOML of this schema, or a value makes no sense.
pub fn read(path: &Path) -> Result<RefinementProblem, InputError> {
    let file: RefinementFile = input::read_toml(path)?;
    let check = Check { path };
    let linear = check.linear(file.linear_model)?.into();
    let geometry = check.geometry(&file.geometry)?;
    let start = match &file.start {
        Some(table) => check.start(table)?,
        None => start_from(&linear, &geometry),
    };
    let paper = RefinementProblem::paper();
    Ok(RefinementProblem {
        linear,
        geometry,
        start,
        settings: check.settings(&file.settings, file.weights.as_ref())?,
        tilt: check
            .tilt(file.settings.tilt_deg)?
            .map_or(paper.tilt, f64::to_radians),
    })
}

/// Checks of the values of one file.
struct Check<'a> {
    path: &'a Path,
}

impl Check<'_> {
    fn named<T>(&self, checked: Result<T, ScenarioError>) -> Result<T, InputError> {
        checked.map_err(|source| InputError::Value {
            path: self.path.to_owned(),
            source,
        })
    }

    fn value(
        &self,
        table: &str,
        key: &str,
        value: f64,
        right: bool,
        expected: &str,
    ) -> Result<f64, InputError> {
        self.named(number::check(
            &format!("{table}.{key}"),
            value,
            right,
            expected,
        ))
    }

    fn finite(&self, table: &str, key: &str, value: f64) -> Result<f64, InputError> {
        self.named(number::finite(&format!("{table}.{key}"), value))
    }

    fn positive(&self, table: &str, key: &str, value: f64) -> Result<f64, InputError> {
        self.named(number::positive(&format!("{table}.{key}"), value))
    }

    fn linear(&self, table: LinearModelTable) -> Result<LinearModelTable, InputError> {
        let LinearModelTable {
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
        } = table;
        for (key, value) in EQUATIONS.into_iter().zip([p1, p2, p3, p4, p5, p6]) {
            self.finite("linear_model", key, value)?;
        }
        Ok(table)
    }

    fn geometry(&self, table: &GeometryTable) -> Result<Geometry<f64>, InputError> {
        let positive = |key, value| self.positive("geometry", key, value);
        Ok(Geometry {
            centre_of_mass: positive("centre_of_mass_m", table.centre_of_mass_m)?,
            ball_radius: positive("ball_radius_m", table.ball_radius_m)?,
            wheel_radius: positive("wheel_radius_m", table.wheel_radius_m)?,
            gravity: positive("gravity_m_s2", table.gravity_m_s2)?,
        })
    }

    fn start(&self, table: &StartTable) -> Result<[f64; 4], InputError> {
        let finite = |key, value| self.finite("start", key, value);
        Ok([
            finite("b1_m2", table.b1_m2)?,
            finite("b2_m2", table.b2_m2)?,
            finite("b3_m2", table.b3_m2)?,
            finite("b4_m2_s", table.b4_m2_s)?,
        ])
    }

    fn weights(&self, table: &WeightTable) -> Result<DVector<f64>, InputError> {
        let WeightTable {
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
        } = table;
        let mut weights = DVector::from_element(EQUATIONS.len(), 1.0);
        for (i, weight) in [p1, p2, p3, p4, p5, p6].into_iter().enumerate() {
            if let Some(weight) = weight {
                weights[i] = self.positive("weights", EQUATIONS[i], *weight)?;
            }
        }
        Ok(weights)
    }

    fn settings(
        &self,
        table: &SettingsTable,
        weights: Option<&WeightTable>,
    ) -> Result<LeastSquaresSettings, InputError> {
        let default = LeastSquaresSettings::default();
        let tolerance = |key, value: Option<f64>, default| {
            let value = value.unwrap_or(default);
            let right = value.is_finite() && value >= 0.0;
            self.value("settings", key, value, right, "it must be zero or positive")
        };
        let count = |key, value: Option<usize>, default| {
            let value = value.unwrap_or(default);
            let right = (1..=MOST_ITERATIONS).contains(&value);
            let expected = "it must be from 1 to 1000000";
            self.value("settings", key, value as f64, right, expected)
                .map(|_| value)
        };
        Ok(LeastSquaresSettings {
            step_tolerance: tolerance(
                "step_tolerance",
                table.step_tolerance,
                default.step_tolerance,
            )?,
            reduction_tolerance: tolerance(
                "reduction_tolerance",
                table.reduction_tolerance,
                default.reduction_tolerance,
            )?,
            orthogonality_tolerance: tolerance(
                "orthogonality_tolerance",
                table.orthogonality_tolerance,
                default.orthogonality_tolerance,
            )?,
            max_iterations: count(
                "max_iterations",
                table.max_iterations,
                default.max_iterations,
            )?,
            stagnation_steps: count(
                "stagnation_steps",
                table.stagnation_steps,
                default.stagnation_steps,
            )?,
            weights: weights.map(|table| self.weights(table)).transpose()?,
        })
    }

    fn tilt(&self, tilt: Option<f64>) -> Result<Option<f64>, InputError> {
        let Some(tilt) = tilt else {
            return Ok(None);
        };
        let right = (0.0..=180.0).contains(&tilt);
        self.value(
            "settings",
            "tilt_deg",
            tilt,
            right,
            "it must be from 0 to 180 degrees",
        )
        .map(Some)
    }
}

/// Names of the equations.
pub const EQUATIONS: [&str; 6] = ["p1", "p2", "p3", "p4", "p5", "p6"];

/// More would not end within a person's patience.
const MOST_ITERATIONS: usize = 1_000_000;

/// A commented file with the paper's values.
pub fn example() -> String {
    let RefinementProblem {
        linear: p,
        geometry,
        start: [b1, b2, b3, b4],
        settings,
        tilt,
    } = RefinementProblem::paper();
    format!(
        include_str!("refinement_file.example"),
        p1 = p.p1,
        p2 = p.p2,
        p3 = p.p3,
        p4 = p.p4,
        p5 = p.p5,
        p6 = p.p6,
        centre_of_mass = geometry.centre_of_mass,
        ball_radius = geometry.ball_radius,
        wheel_radius = geometry.wheel_radius,
        gravity = geometry.gravity,
        b1 = b1,
        b2 = b2,
        b3 = b3,
        b4 = b4,
        step = settings.step_tolerance,
        reduction = settings.reduction_tolerance,
        orthogonality = settings.orthogonality_tolerance,
        iterations = settings.max_iterations,
        stagnation = settings.stagnation_steps,
        // Rounded, so that pi/3 is 60 degrees.
        tilt = (tilt.to_degrees() * 1e9).round() / 1e9,
    )
}
