//! A controller of any size.

use crate::check::Names;
use crate::error::MpcError;
use crate::estimator::{Estimate, EstimatorSettings};
use crate::filter::{AnyFilter, filter};
use crate::guaranteed::{Guarantee, check_estimator};
use crate::plan::Plan;
use crate::preview::Preview;
use crate::sampling::check_count;
use crate::settings::MpcSettings;
use crate::size::{smallest, too_many};
use crate::sized::{Acting, AnySize, controller_of_size};
use lpvmpc::Verdict;
use lpvmpc_plant::Plant;

/// The LPV MPC controller of a plant that is data.
pub struct Mpc {
    sized: Box<dyn AnySize>,
    states: usize,
    /// With a certified terminal set.
    guarantee: Option<Guarantee>,
    filter: Option<Box<dyn AnyFilter>>,
}

/// The states, with the last inputs where they are among them, and the inputs.
fn places(plant: &Plant, settings: &MpcSettings) -> (usize, usize) {
    let data = plant.data();
    let (n, m) = (data.states.len(), data.inputs.len());
    (if settings.with_last_input() { n + m } else { n }, m)
}

/// A controller in the smallest size.
fn sized(plant: &Plant, settings: &MpcSettings) -> Result<Box<dyn AnySize>, MpcError> {
    let places = places(plant, settings);
    let last_inputs = places.0 - plant.data().states.len();
    smallest!(places, controller_of_size(plant, settings))
        .unwrap_or_else(|| Err(too_many(places, last_inputs)))
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
        check_count(settings.substeps)?;
        let guarantee = Guarantee::new(plant, settings)?;
        Ok(Self {
            sized: sized(plant, settings)?,
            states: plant.data().states.len(),
            guarantee,
            filter: None,
        })
    }

    /// One sample: from the measured state `x` and what is known ahead to the plan, whose first
    /// input is to be applied until the next sample.
    ///
    /// A state that is not finite is answered by a plan whose status says so.
    ///
    /// # Errors
    /// A list of the preview that has not the plant's sizes, or has a number that makes no sense; with its parameters the
    /// prediction's steps are too long.
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
    /// cease to count, and with another certified terminal set, the next step is made without the last plan.
    ///
    /// # Errors
    /// As [`new`](Self::new); the controller is as it was then.
    pub fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError> {
        let estimator = self.estimator().cloned();
        self.set(settings, estimator.as_ref())
    }

    /// Other settings, and of the estimator: as [`set_settings`](Self::set_settings) and
    /// [`set_estimator`](Self::set_estimator), both or none.
    ///
    /// # Errors
    /// As these; all is as it was then.
    pub fn set(
        &mut self,
        settings: &MpcSettings,
        estimator: Option<&EstimatorSettings>,
    ) -> Result<(), MpcError> {
        check_count(settings.substeps)?;
        let plant = self.sized.plant();
        let mut guarantee = Guarantee::new(plant, settings)?;
        if let (Some(guarantee), Some(previous)) = (&mut guarantee, &self.guarantee) {
            guarantee.take_over(previous);
        }
        let filter = self.filter(plant, (settings, guarantee.is_some()), estimator)?;
        if places(plant, settings).0 <= self.sized.places() {
            self.sized.set_settings(settings)?;
        } else {
            let before = self.sized.settings();
            if (settings.horizon, settings.t_s) != (before.horizon, before.t_s) {
                let error = lpvmpc::ControllerError::Another;
                return Err(MpcError::new("settings", error.to_string()));
            }
            // The last inputs need more places.
            let mut larger = sized(plant, settings)?;
            if let Some(last) = self.sized.last_input() {
                larger.set_last_input(&last)?;
            }
            self.sized = larger;
        }
        (self.guarantee, self.filter) = (guarantee, filter);
        Ok(())
    }

    /// Another value of a parameter of the plant from the next step on. The terminal cost stays what it was.
    ///
    /// # Errors
    /// As [`set_parameters`](Self::set_parameters).
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), MpcError> {
        self.set_parameters([(name, value)])
    }

    /// Other values of parameters of the plant from the next step on, all or none. Its steady state goes along with them
    /// ([`Plant::equilibrium`]); where it has none any more, what is about the last one stays there. The terminal cost stays
    /// what it was.
    ///
    /// # Errors
    /// There is no such parameter, or the value is not finite; with these values the prediction's steps are too
    /// long, or the readings do not tell the disturbances; there is a certified terminal set, which is for the parameters
    /// as they are. All is as it was then.
    pub fn set_parameters<'a>(
        &mut self,
        values: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<(), MpcError> {
        let mut plant = self.sized.plant().clone();
        for (name, value) in values {
            if self.guarantee.is_some() {
                let fault = "the certificate of the terminal set is for the parameters as they are";
                return Err(MpcError::new(name, fault));
            }
            plant.set_parameter(name, value)?;
        }
        // The filter predicts with the same plant.
        let of_controller = (self.sized.settings(), self.guarantee.is_some());
        let filter = self.filter(&plant, of_controller, self.estimator())?;
        self.sized.set_plant(&plant)?;
        self.filter = filter;
        Ok(())
    }

    /// The input that was really applied last, where that is another than the last plan's first one; before the first
    /// step it is that of the plant's steady state. Changes of the input count from it, and an estimator predicts
    /// with it; before the first step an estimator without it takes the input for zero.
    ///
    /// # Errors
    /// It has not the plant's sizes, or is not finite.
    pub fn set_last_input(&mut self, u: &[f64]) -> Result<(), MpcError> {
        self.sized.set_last_input(u)?;
        if let Some(filter) = &mut self.filter {
            filter.correct(u);
        }
        Ok(())
    }

    /// From now on the state is estimated from readings, and inputs act after a delay: see [`Self::observe`] and
    /// [`Self::decide`]. One that is there already is taken over with its state; `None` ends it.
    ///
    /// # Errors
    /// The setting that makes no sense; a disturbance that the readings cannot tell; with a certified terminal set one on
    /// a state, which moves the equilibrium that the certificate is about. All is as it was then.
    pub fn set_estimator(&mut self, settings: Option<&EstimatorSettings>) -> Result<(), MpcError> {
        let of_controller = (self.sized.settings(), self.guarantee.is_some());
        self.filter = self.filter(self.sized.plant(), of_controller, settings)?;
        Ok(())
    }

    /// A filter for the `plant` and the controller, which may have a certified terminal set, that goes on from where the one
    /// before stands; none without settings.
    fn filter(
        &self,
        plant: &Plant,
        (settings, is_guaranteed): (&MpcSettings, bool),
        estimator: Option<&EstimatorSettings>,
    ) -> Result<Option<Box<dyn AnyFilter>>, MpcError> {
        let Some(estimator) = estimator else {
            return Ok(None);
        };
        if is_guaranteed {
            check_estimator(&Names::new(plant), estimator)?;
        }
        let mut filter = filter(plant, settings, estimator)?;
        if let Some(previous) = &self.filter {
            filter.take_over(previous.as_ref());
        }
        Ok(Some(filter))
    }

    fn estimator(&self) -> Option<&EstimatorSettings> {
        Some(self.filter.as_ref()?.settings())
    }

    /// Takes in the readings of the time `t` (s, on any clock), in the order of
    /// [`EstimatorSettings::measured`], `None` where one is missing; and says what became of each. May be called more often
    /// than once a sample; in discrete time they are then of the plant's nearest period, counted from the first readings.
    ///
    /// # Errors
    /// There is no estimator, or not as many readings.
    pub fn observe(&mut self, t: f64, readings: &[Option<f64>]) -> Result<Vec<Verdict>, MpcError> {
        let filter = self.filter.as_mut().ok_or_else(no_estimator)?;
        let (verdicts, begins_anew) = filter.observe(t, readings)?;
        if begins_anew {
            // The plan belongs to the state before.
            self.sized.forget_plan();
        }
        Ok(verdicts)
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
        let filter = self.filter.as_mut().ok_or_else(no_estimator)?;
        let (x, (on_inputs, on_states)) = (filter.ahead(), filter.disturbance());
        let plan = match &mut self.guarantee {
            Some(guarantee) => {
                let looked_for = !filter.settings().disturbances.is_empty();
                let beside = looked_for.then_some(&on_inputs[..]);
                let plan = guarantee.step(self.sized.as_mut(), &x, beside, preview)?;
                self.sized.apply(&plan.first_input());
                plan
            }
            None => {
                let acting = Acting {
                    on_inputs: &on_inputs,
                    on_states: &on_states,
                };
                self.sized.step(&x, Some(acting), preview)?
            }
        };
        let known = preview.disturbance.first();
        filter.send(&plan.first_input(), known.map_or(&[], |d| d.as_slice()));
        Ok(plan)
    }

    /// The estimate at the last readings; `None` without an estimator.
    pub fn estimate(&self) -> Option<Estimate> {
        Some(self.filter.as_ref()?.estimate())
    }

    /// Forgets the last plan, the last input and what was estimated: the next step is as the first.
    pub fn reset(&mut self) {
        self.sized.reset();
        if let Some(filter) = &mut self.filter {
            filter.reset();
        }
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

fn no_estimator() -> MpcError {
    MpcError::new("estimator", "there is none: see `set_estimator`")
}
