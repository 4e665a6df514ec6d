//! Which friction does this robot have? Model structures compared on held-back data.

use crate::estimate::{Estimate, Progress, Task};
use crate::joint::Joint;
use crate::parameter::{Choice, Parameter, Values};
use crate::segments::{Stretch, spread};
use crate::validation::{Validation, validate};
use nalgebra::Vector3;

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

/// Fits every structure, from the estimates on, and judges it on the stretches of each plane that were
/// held back: plane by plane, those that can be fitted and simulated there. The others are no rivals.
pub fn compare(
    joint: &Joint<'_>,
    estimates: &[Estimate],
    held_back: &[&[Stretch]],
    progress: Progress<'_>,
) -> Vec<Vec<Compared>> {
    let mut planes = vec![Vec::new(); estimates.len()];
    for structure in Structure::ALL {
        let compared = structure.judged(joint, estimates, held_back, progress);
        for (plane, compared) in planes.iter_mut().zip(compared.into_iter().flatten()) {
            plane.push(compared);
        }
    }
    planes
}

impl Structure {
    /// The structure in each plane; `None` if it cannot be fitted or simulated in one of them.
    fn judged(
        self,
        joint: &Joint<'_>,
        estimates: &[Estimate],
        held_back: &[&[Stretch]],
        progress: Progress<'_>,
    ) -> Option<Vec<Compared>> {
        // One noise for all, so that their chi^2 can be compared.
        let noises: Vec<Vector3<f64>> = estimates.iter().map(|plane| plane.noise).collect();
        let tasks = joint.tasks.iter().zip(&noises).map(|(task, noise)| Task {
            choices: self.choices(task.choices),
            noise: [0, 1, 2].map(|output| Some(noise[output])),
            ..task.clone()
        });
        let joint = Joint {
            tasks: tasks.collect(),
            ..joint.clone()
        };
        let starts: Vec<Values> = estimates.iter().map(|plane| plane.values).collect();
        let segments = estimates.iter();
        let segments = segments
            .map(|plane| spread(&plane.segments, SEGMENTS))
            .collect();
        let fitted = joint.estimate_from(&starts, segments, &noises, progress);
        let planes = fitted.ok()?.planes.into_iter().enumerate();
        planes
            .map(|(plane, fitted)| {
                let (task, spread) = (&joint.tasks[plane], estimates[plane].spread);
                let validation = validate(task, &fitted.values, spread, held_back[plane]).ok()?;
                Some(Compared {
                    structure: self,
                    fitted_chi_square: fitted.fit.chi_square / fitted.fit.degrees_of_freedom(),
                    validation,
                    estimate: fitted,
                })
            })
            .collect()
    }
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
