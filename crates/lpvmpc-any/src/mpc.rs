//! A controller of any size.

use crate::check::Names;
use crate::error::MpcError;
use crate::estimator::{Estimate, EstimatorSettings};
use crate::guaranteed::{Guarantee, check_estimator};
use crate::plan::Plan;
use crate::preview::Preview;
use crate::settings::MpcSettings;
use crate::sized::{AnySize, Sized};
use lpvmpc::Verdict;
use lpvmpc_plant::Plant;

/// The most states that a plant may have.
pub const MOST_STATES: usize = 16;
/// The most inputs.
pub const MOST_INPUTS: usize = 6;

/// The LPV MPC controller of a plant that is data.
pub struct Mpc {
    sized: Box<dyn AnySize>,
    states: usize,
    /// With a certified terminal set.
    guarantee: Option<Guarantee>,
}

/// The first of these sizes, smallest first, in which a plant has room.
macro_rules! smallest {
    ($plant:expr, $settings:expr, $($nx:literal $nu:literal $ns:literal),+) => {{
        let (n, m) = places($plant, $settings);
        $(if n <= $nx && m <= $nu {
            return Ok(Box::new(Sized::<$nx, $nu, $ns>::new($plant, $settings)?));
        })+
        let states = $plant.data().states.len();
        let fault = match n == states {
            true => format!(
                "there are {n} states and {m} inputs; a controller has at most {MOST_STATES} and \
                 {MOST_INPUTS}"
            ),
            false => format!(
                "there are {states} states and {m} inputs; where changes of the inputs cost \
                 something or are bounded, the last inputs count as states, of which a controller \
                 has at most {MOST_STATES}, beside at most {MOST_INPUTS} inputs"
            ),
        };
        Err(MpcError::new("plant", fault))
    }};
}

/// The states, with the last inputs where they are among them, and the inputs.
fn places(plant: &Plant, settings: &MpcSettings) -> (usize, usize) {
    let data = plant.data();
    let (n, m) = (data.states.len(), data.inputs.len());
    (if settings.with_last_input() { n + m } else { n }, m)
}

/// A controller in the smallest size.
fn sized(plant: &Plant, settings: &MpcSettings) -> Result<Box<dyn AnySize>, MpcError> {
    smallest!(plant, settings, 2 1 3, 4 1 5, 4 2 6, 6 2 8, 8 4 12, 12 4 16, 16 6 22)
}

impl Mpc {
    /// A controller for `plant`.
    ///
    /// # Errors
    /// The setting that makes no sense, by its name, and what would be right.
    pub fn new(plant: &Plant, settings: &MpcSettings) -> Result<Self, MpcError> {
        if plant.data().inputs.is_empty() {
            return Err(MpcError::new("plant", "it has no input to control it with"));
        }
        let guarantee = Guarantee::new(plant, settings)?;
        Ok(Self {
            sized: sized(plant, settings)?,
            states: plant.data().states.len(),
            guarantee,
        })
    }

    /// One sample: from the measured state `x` and what is known ahead to the plan, whose first
    /// input is to be applied until the next sample.
    ///
    /// A state that is not finite is answered by a plan whose status says so.
    ///
    /// # Errors
    /// A list of the preview that has not the plant's sizes, or has a number that makes no sense.
    pub fn step(&mut self, x: &[f64], preview: &Preview) -> Result<Plan, MpcError> {
        match &mut self.guarantee {
            Some(guarantee) => {
                let plan = guarantee.step(self.sized.as_mut(), x, None, preview)?;
                self.sized.apply(&plan.first_input());
                Ok(plan)
            }
            None => self.sized.step(x, None, preview),
        }
    }

    /// Other settings from the next step on. Horizon and sampling time stay. Where changes of the input begin or
    /// cease to count, the next step is made without the last plan.
    ///
    /// # Errors
    /// As [`new`](Self::new); the controller is as it was then.
    pub fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError> {
        let guarantee = Guarantee::new(self.sized.plant(), settings)?;
        if let (Some(_), Some(estimator)) = (&guarantee, self.sized.estimator()) {
            check_estimator(&Names::new(self.sized.plant()), estimator)?;
        }
        if places(self.sized.plant(), settings).0 <= self.sized.places() {
            self.sized.set_settings(settings)?;
            self.guarantee = guarantee;
            return Ok(());
        }
        let before = self.sized.settings();
        if (settings.horizon, settings.t_s) != (before.horizon, before.t_s) {
            let error = lpvmpc::ControllerError::Another;
            return Err(MpcError::new("settings", error.to_string()));
        }
        // The last inputs need more places: the next step is as the first.
        let mut larger = sized(self.sized.plant(), settings)?;
        larger.set_last_input(&self.sized.last_input())?;
        larger.set_estimator(self.sized.estimator())?;
        self.sized = larger;
        self.guarantee = guarantee;
        Ok(())
    }

    /// Another value of a parameter of the plant from the next step on.
    ///
    /// # Errors
    /// There is no such parameter, or the value is not finite.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), MpcError> {
        if self.guarantee.is_some() {
            let fault = "the certificate of the terminal set is for the parameters as they are";
            return Err(MpcError::new(name, fault));
        }
        self.sized.set_parameter(name, value)
    }

    /// The input that was really applied last, where that is another than the last plan's first one; before the first
    /// step it is that of the plant's steady state. Changes of the input count from it, and an estimator predicts
    /// with it; before the first step an estimator without it takes the input for zero.
    ///
    /// # Errors
    /// It has not the plant's sizes, or is not finite.
    pub fn set_last_input(&mut self, u: &[f64]) -> Result<(), MpcError> {
        self.sized.set_last_input(u)
    }

    /// From now on the state is estimated from readings, and inputs act after a delay: see [`Self::observe`] and
    /// [`Self::decide`]. One that is there already is taken over with its state; `None` ends it.
    ///
    /// # Errors
    /// The setting that makes no sense; a disturbance that the readings cannot tell; with a certified terminal set one on
    /// a state, which moves the equilibrium that the certificate is about. All is as it was then.
    pub fn set_estimator(&mut self, settings: Option<&EstimatorSettings>) -> Result<(), MpcError> {
        if let (Some(_), Some(settings)) = (&self.guarantee, settings) {
            check_estimator(&Names::new(self.sized.plant()), settings)?;
        }
        self.sized.set_estimator(settings)
    }

    /// Takes in the readings of the time `t` (s, on any clock), in the order of
    /// [`EstimatorSettings::measured`], `None` where one is missing; and says what became of each. May be called more often
    /// than once a sample.
    ///
    /// # Errors
    /// There is no estimator, or not as many readings.
    pub fn observe(&mut self, t: f64, readings: &[Option<f64>]) -> Result<Vec<Verdict>, MpcError> {
        self.sized.observe(t, readings)
    }

    /// One sample from the last readings: as [`Self::step`], from the estimated state when the input will act, under
    /// the estimated disturbances. Its first input must be sent: the estimator counts on it. Stage 0 of the preview is when it
    /// acts, the delay after the last readings.
    ///
    /// While there is no estimate, the plan's status says so, and its inputs are those nearest to zero.
    ///
    /// With a certified terminal set the loop is that of [`Self::step`] from the estimate carried through the delay. What
    /// [`Plan::decision`] says is then of the model from there, with the disturbances beside the inputs as they are
    /// estimated; of the plant nothing is guaranteed.
    ///
    /// # Errors
    /// There is no estimator; or as [`Self::step`].
    pub fn decide(&mut self, preview: &Preview) -> Result<Plan, MpcError> {
        let Some(guarantee) = &mut self.guarantee else {
            return self.sized.decide(preview);
        };
        let ahead = self.sized.ahead()?;
        let beside = ahead.beside.as_deref();
        let plan = guarantee.step(self.sized.as_mut(), &ahead.x, beside, preview)?;
        self.sized.apply(&plan.first_input());
        self.sized.send();
        Ok(plan)
    }

    /// The estimate at the last readings; `None` without an estimator.
    pub fn estimate(&self) -> Option<Estimate> {
        self.sized.estimate()
    }

    /// Forgets the last plan, the last input and what was estimated: the next step is as the first.
    pub fn reset(&mut self) {
        self.sized.reset();
        if let Some(guarantee) = &mut self.guarantee {
            guarantee.reset();
        }
    }

    /// The plant, with its parameters as they are now.
    pub fn plant(&self) -> &Plant {
        self.sized.plant()
    }

    /// How many states the plant has.
    pub fn states(&self) -> usize {
        self.states
    }
}
