//! Which friction does this robot have? Model structures compared on held-back data.

use crate::estimate::{Estimate, Progress, Task};
use crate::parameter::{Choice, Parameter, Values};
use crate::segments::spread;
use crate::validation::{Validation, validate};
use nalgebra::Vector3;
use std::ops::Range;

/// Where friction acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Structure {
    /// On phi_dot, as in the paper.
    Rolling,
    /// On phi_dot - theta_dot.
    Drive,
    /// Both, viscous.
    RollingAndDrive,
    /// Both, and Coulomb friction in the drive.
    WithCoulomb,
}

impl Structure {
    /// From the smallest to the largest.
    pub const ALL: [Self; 4] = [
        Self::Rolling,
        Self::Drive,
        Self::RollingAndDrive,
        Self::WithCoulomb,
    ];

    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Rolling => "viscous, rolling (the paper's)",
            Self::Drive => "viscous, in the drive",
            Self::RollingAndDrive => "viscous, both",
            Self::WithCoulomb => "viscous, both, and Coulomb in the drive",
        }
    }

    /// The friction parameters that it has.
    pub fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Rolling => &[Parameter::RollingFriction],
            Self::Drive => &[Parameter::DriveFriction],
            Self::RollingAndDrive => &[Parameter::RollingFriction, Parameter::DriveFriction],
            Self::WithCoulomb => &[
                Parameter::RollingFriction,
                Parameter::DriveFriction,
                Parameter::DriveCoulomb,
            ],
        }
    }

    fn choices(self, choices: Values<Choice>) -> Values<Choice> {
        let mut choices = choices;
        for friction in [
            Parameter::RollingFriction,
            Parameter::DriveFriction,
            Parameter::DriveCoulomb,
        ] {
            choices[friction] = match (self.parameters().contains(&friction), choices[friction]) {
                (false, _) => Choice::Fixed(0.0),
                (true, Choice::Fixed(_)) => Choice::FREE,
                (true, free) => free,
            };
        }
        choices
    }
}

/// One structure, fitted and judged.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The structure.
    pub structure: Structure,
    /// The fit.
    pub estimate: Estimate,
    /// chi^2 of the fit per degree of freedom, with the noise of the sensors.
    pub fitted_chi_square: f64,
    /// On held-back data, with the same noise for all structures.
    pub validation: Validation,
}

/// Segments of each fit; enough to tell structures apart.
const SEGMENTS: usize = 60;

/// Fits every structure, from the estimate on, and judges it on the stretches held back. One that
/// cannot be fitted or simulated there is left out: it is no rival.
pub fn compare(
    task: &Task<'_>,
    estimate: &Estimate,
    held_back: &[(usize, Range<usize>)],
    progress: Progress<'_>,
) -> Vec<Compared> {
    // One noise for all, so that their chi^2 can be compared.
    let noise: Vector3<f64> = estimate.noise;
    Structure::ALL
        .into_iter()
        .filter_map(|structure| {
            let task = Task {
                choices: structure.choices(task.choices),
                noise: [0, 1, 2].map(|output| Some(noise[output])),
                ..task.clone()
            };
            let segments = spread(&estimate.segments, SEGMENTS);
            let fitted = task.estimate_from(estimate.values, segments, noise, progress);
            let fitted = fitted.ok()?;
            Some(Compared {
                structure,
                fitted_chi_square: fitted.fit.chi_square / fitted.fit.degrees_of_freedom(),
                validation: validate(&task, &fitted.values, estimate.spread, held_back).ok()?,
                estimate: fitted,
            })
        })
        .collect()
}

/// The structure to take: the smallest whose held-back chi^2 is within what chance explains of the
/// best one's. The error of a prediction over one second alone does not decide: most of it is the
/// growth of a small error of the state, which is the same for a wrong structure.
pub fn best(compared: &[Compared]) -> Option<&Compared> {
    let least = compared
        .iter()
        .map(|one| one.validation.chi_square)
        .fold(f64::INFINITY, f64::min);
    compared.iter().find(|one| {
        // Standard deviation of chi^2 / n is sqrt(2 / n); differences between models on the same
        // data are smaller, so one of it is on the safe side.
        let chance = (2.0 / one.validation.values as f64).sqrt();
        one.validation.chi_square <= least + chance
    })
}
