//! The ballbot's closed loop for a browser: what JavaScript can call, and nothing that is not
//! in [`ballbot_scenario`]. Angles in rad, rates in rad/s, torque in N m, times in s. Errors
//! are messages for people.
//!
//! ```js
//! const robot = new Simulation(setup, certificate); // a scenario file as an object
//! for (let k = 0; k < 100; k += 1) robot.step();
//! const [time, phi] = robot.row();
//! console.log(`after ${time} s the ball has turned by ${phi} rad: ${robot.status()}`);
//! ```

mod from_js;
mod layout;
mod page_files;

use ballbot_scenario::plausible::{BALL_ANGLE, TILT_RATE};
use ballbot_scenario::{Phase, PhiReference, PointTable, Prepared, Scenario, Session};
use layout::{NOW, Now, ROW, row};
use page_files::PageFiles;
use std::time::Duration;
use wasm_bindgen::prelude::*;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = performance, js_name = now)]
    fn milliseconds() -> f64;
}

fn clock() -> Duration {
    Duration::from_secs_f64(milliseconds() / 1e3)
}

/// `certificate` is the built-in one as an object.
fn prepare(setup: JsValue, certificate: JsValue) -> Result<Prepared, String> {
    let scenario: Result<Scenario, _> = from_js::from_js(setup);
    let scenario = scenario.map_err(|error| format!("this is not a valid scenario:\n{error}"))?;
    let prepared = scenario.prepare(PageFiles { certificate });
    prepared.map_err(|error| error.to_string())
}

/// Whether an object with the keys of a scenario file is one that can be run; its weights, chosen for
/// the robot where it gives none: Q's diagonal, and R.
///
/// # Errors
/// What is wrong with a key or a value.
#[wasm_bindgen]
pub fn check(setup: JsValue, certificate: JsValue) -> Result<Vec<f64>, String> {
    let weights = prepare(setup, certificate)?.settings.weights;
    let (q, r) = (weights.q.diagonal(), weights.r.diagonal());
    Ok(q.iter().chain(r.iter()).copied().collect())
}

/// A robot in its world, stepped from outside.
#[wasm_bindgen]
pub struct Simulation {
    session: Session,
}

#[wasm_bindgen]
impl Simulation {
    /// A scenario, an object with the keys of its file, at time zero.
    ///
    /// # Errors
    /// What is wrong with a key or a value.
    #[wasm_bindgen(constructor)]
    pub fn new(setup: JsValue, certificate: JsValue) -> Result<Simulation, String> {
        let session =
            Session::new(prepare(setup, certificate)?).map_err(|error| error.to_string())?;
        Ok(Self { session })
    }

    /// The same at time zero, without preparing the scenario again, which may take seconds.
    ///
    /// # Errors
    /// As the constructor.
    pub fn afresh(&self) -> Result<Simulation, String> {
        let session = Session::new(self.session.prepared().clone());
        Ok(Self {
            session: session.map_err(|error| error.to_string())?,
        })
    }

    /// The same robot where it stands, under another scenario.
    ///
    /// # Errors
    /// As the constructor; this simulation stays as it is.
    pub fn reconfigured(&self, setup: JsValue, certificate: JsValue) -> Result<Simulation, String> {
        let prepared = prepare(setup, certificate)?;
        let session = self.session.reconfigured(prepared);
        Ok(Self {
            session: session.map_err(|error| error.to_string())?,
        })
    }

    /// Planes: 1 or 2.
    pub fn planes(&self) -> usize {
        self.session.planes().len()
    }

    /// Sampling time of the control, s.
    pub fn sampling_time(&self) -> f64 {
        self.session.prepared().settings.t_s
    }

    /// Horizon, samples.
    pub fn horizon(&self) -> usize {
        self.session.prepared().settings.horizon
    }

    /// Samples until the scenario's end.
    pub fn samples(&self) -> usize {
        self.session.prepared().samples
    }

    /// Time of the scenario's end, s.
    pub fn duration(&self) -> f64 {
        self.samples() as f64 * self.sampling_time()
    }

    /// Time, s.
    pub fn time(&self) -> f64 {
        self.session.time()
    }

    /// One sample; `false` if the robot lies on the floor and nothing moved.
    pub fn step(&mut self) -> bool {
        self.session.step(&clock)
    }

    /// The last sample: a row per plane, its columns as in `web/src/layout.ts`.
    pub fn row(&self) -> Vec<f64> {
        let samples = self.session.samples().iter();
        samples.flat_map(|sample| row(&ROW, sample)).collect()
    }

    /// The three motors' torques of the last sample.
    pub fn motors(&self) -> Vec<f64> {
        self.session.motor_torques().as_slice().to_vec()
    }

    /// The state now: a row per plane, its columns as in `web/src/layout.ts`.
    pub fn now(&self) -> Vec<f64> {
        let time = self.session.time();
        let planes = self.session.states().zip(self.session.targets());
        planes
            .flat_map(|(x, phi_reference)| {
                let state = (*x).into();
                let now = Now {
                    time,
                    state,
                    phi_reference,
                };
                row(&NOW, &now).collect::<Vec<_>>()
            })
            .collect()
    }

    /// The states that the last plan of a plane leads through, four per sample.
    pub fn prediction(&self, plane: usize) -> Vec<f64> {
        let states = self.session.prediction(plane);
        states.iter().flat_map(|x| x.iter().copied()).collect()
    }

    /// The times at which pieces of phi_ref of a plane begin and end, in order.
    pub fn knots(&self, plane: usize) -> Vec<f64> {
        let plane = self.session.planes().get(plane);
        plane.map_or_else(Vec::new, |plane| plane.reference.knots(self.duration()))
    }

    /// phi_ref of a plane at these times.
    pub fn reference(&self, plane: usize, times: &[f64]) -> Vec<f64> {
        let plane = self.session.planes().get(plane);
        plane.map_or_else(Vec::new, |plane| {
            times.iter().map(|&t| plane.reference.at(t)).collect()
        })
    }

    /// What the controllers said at the last sample.
    pub fn status(&self) -> String {
        self.session.status_in_words()
    }

    /// The bounds that are active in the last plan of a plane.
    pub fn active_bounds(&self, plane: usize) -> String {
        self.session.active_bounds_in_words(plane)
    }

    /// Angle of the wheels' contact points from the top of the ball, rad.
    pub fn zenith_angle(&self) -> f64 {
        self.session.prepared().wheels.zenith_angle()
    }

    /// Azimuths of the wheels' contact points from the robot's x axis, counter-clockwise seen from
    /// above, rad.
    pub fn azimuths(&self) -> Vec<f64> {
        let wheels = self.session.prepared().wheels.arrangement();
        wheels.map(|wheel| wheel.azimuth).to_vec()
    }

    /// Why the robot does not stand any more; absent while it stands.
    pub fn ending(&self) -> Option<String> {
        self.session.fall_in_words()
    }

    /// Whether it lies on the floor.
    pub fn is_down(&self) -> bool {
        matches!(self.session.phase(), Phase::Down(_))
    }

    /// From now on the ball has to go to these angles. Says of each plane how many smooth moves that had
    /// not begun are dropped for this one.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn set_target(&mut self, phi_x: f64, phi_y: f64) -> Result<Vec<u32>, String> {
        let dropped = self.session.set_targets(&[phi_x, phi_y]);
        let dropped = dropped.map_err(|error| error.to_string())?;
        Ok(dropped.into_iter().map(|moves| moves as u32).collect())
    }

    /// A target further away is no ballbot's, and a file with it is refused, rad.
    pub fn most_ball_angle(&self) -> f64 {
        BALL_ANGLE.most
    }

    /// The same of a push, rad/s.
    pub fn most_tilt_rate(&self) -> f64 {
        TILT_RATE.most
    }

    /// From now on the ball has to follow straight lines between these angles, at these times.
    pub fn set_path(&mut self, times: &[f64], phi_x: &[f64], phi_y: &[f64]) {
        let reference = |phi: &[f64]| {
            let points = times.iter().zip(phi);
            PhiReference::Interpolated(
                points
                    .map(|(&time_s, &phi_rad)| PointTable { time_s, phi_rad })
                    .collect(),
            )
        };
        self.session
            .set_references([reference(phi_x), reference(phi_y)]);
    }

    /// Changes the rates of the tilt at once.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn push(&mut self, theta_dot_x: f64, theta_dot_y: f64) -> Result<(), String> {
        for (plane, theta_dot) in [theta_dot_x, theta_dot_y].into_iter().enumerate() {
            let pushed = self.session.push(plane, 0.0, theta_dot);
            pushed.map_err(|error| error.to_string())?;
        }
        Ok(())
    }
}
