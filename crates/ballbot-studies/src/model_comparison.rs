//! Four models under one multi-harmonic torque on the stabilised plant: linearised, nonlinear,
//! LPV, and Runge-Kutta with one step per sample.

use crate::linear_model::LinearModel;
use crate::regulator::{RegulatorError, RegulatorProblem, Time};
use ballbot::Ballbot;
use lpvmpc::{LpvModel, Rk4};
use lpvmpc_sim::{PlantError, Tolerances, advance};
use nalgebra::{Matrix4, RowVector4, Vector1, Vector3, Vector4};

/// The sampling time of the experiment, s; the torque is held for as long.
const T_S: f64 = 0.05;
/// Length of the experiment, s.
const DURATION: f64 = 12.0;
/// Points drawn per sample.
const POINTS: usize = 5;
/// A predictor that is accurate at this sampling time.
const FINE: Rk4 = Rk4 { substeps: 4 };
/// (amplitude in N m, frequency in Hz) of the harmonics.
const HARMONICS: [(f64, f64); 4] = [(0.9, 0.15), (0.7, 0.4), (0.55, 0.9), (0.4, 1.7)];
/// Tolerances of the continuous models.
const TOLERANCES: Tolerances = Tolerances {
    relative: 1e-12,
    absolute: 1e-12,
};

/// The experiment's results.
#[derive(Clone, Debug)]
pub struct ModelComparison {
    /// Times of the continuous models, s.
    pub time: Vec<f64>,
    /// The linearised model.
    pub linearised: Vec<[f64; 4]>,
    /// The nonlinear model.
    pub nonlinear: Vec<[f64; 4]>,
    /// The LPV model.
    pub lpv: Vec<[f64; 4]>,
    /// Times of the discrete model, s.
    pub sampled_time: Vec<f64>,
    /// One Runge-Kutta step per sample.
    pub runge_kutta: Vec<[f64; 4]>,
    /// Torque of the nonlinear model's loop, N m.
    pub torque: Vec<f64>,
    /// Largest |LPV - nonlinear| over time and states, rad and rad/s.
    pub lpv_difference: f64,
    /// Largest |Runge-Kutta - nonlinear| per state with one step per sample.
    pub one_step_difference: [f64; 4],
    /// The same with four steps per sample.
    pub four_step_difference: [f64; 4],
}

/// Why the models cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The regulator.
    #[error(transparent)]
    Regulator(#[from] RegulatorError),
    /// The plant cannot be integrated.
    #[error(transparent)]
    Plant(#[from] PlantError),
}

/// The plant through A(sigma(x)) x + B(sigma(x)) u, without the direct form of f.
struct Embedded(Ballbot<f64>);

impl LpvModel<f64, 4, 1, 3> for Embedded {
    fn scheduling(&self, x: &Vector4<f64>, u: &Vector1<f64>) -> Vector3<f64> {
        self.0.scheduling(x, u)
    }

    fn matrices(&self, scheduling: &Vector3<f64>) -> (Matrix4<f64>, Vector4<f64>) {
        self.0.matrices(scheduling)
    }
}

/// The plant linearised at the upright equilibrium: scheduling held at zero.
struct Linearised(Ballbot<f64>);

impl LpvModel<f64, 4, 1, 3> for Linearised {
    fn scheduling(&self, _x: &Vector4<f64>, _: &Vector1<f64>) -> Vector3<f64> {
        Vector3::zeros()
    }

    fn matrices(&self, scheduling: &Vector3<f64>) -> (Matrix4<f64>, Vector4<f64>) {
        self.0.matrices(scheduling)
    }
}

impl ModelComparison {
    /// Runs the experiment.
    ///
    /// # Errors
    /// The regulator or the integration fails.
    pub fn compute() -> Result<Self, ModelError> {
        let plant = Ballbot::paper();
        let gain = stabilising_gain(&plant)?;
        let (time, nonlinear, torque) = continuous(&plant, &gain)?;
        let (_, lpv, _) = continuous(&Embedded(plant), &gain)?;
        let (_, linearised, _) = continuous(&Linearised(plant), &gain)?;
        let sampled: Vec<[f64; 4]> = nonlinear.iter().step_by(POINTS).copied().collect();
        let one_step = discrete(&plant, &gain, Rk4 { substeps: 1 });
        let four_steps = discrete(&plant, &gain, FINE);
        Ok(Self {
            lpv_difference: difference(&lpv, &nonlinear).into_iter().fold(0.0, f64::max),
            one_step_difference: difference(&one_step, &sampled),
            four_step_difference: difference(&four_steps, &sampled),
            sampled_time: time.iter().step_by(POINTS).copied().collect(),
            time,
            linearised,
            nonlinear,
            lpv,
            runge_kutta: one_step,
            torque,
        })
    }
}

fn samples() -> usize {
    (DURATION / T_S).round() as usize
}

fn excitation(t: f64) -> f64 {
    let wave = |(amplitude, frequency)| amplitude * f64::sin(std::f64::consts::TAU * frequency * t);
    HARMONICS.into_iter().map(wave).sum()
}

/// The sampled regulator that keeps all four models upright.
fn stabilising_gain(plant: &Ballbot<f64>) -> Result<RowVector4<f64>, ModelError> {
    let problem = RegulatorProblem {
        linear: LinearModel::from(plant.linear_parameters().matrices()),
        ballbot: *plant,
        q: [200.0, 1.0, 0.1, 0.1],
        r: 1000.0,
        time: Time::Sampled {
            t_s: T_S,
            predictor: FINE,
        },
    };
    Ok(RowVector4::from_column_slice(
        problem.solve()?.lqr.k.as_slice(),
    ))
}

fn torque_at(gain: &RowVector4<f64>, x: &Vector4<f64>, t: f64) -> f64 {
    excitation(t) - (gain * x)[0]
}

type SampledRun = (Vec<f64>, Vec<[f64; 4]>, Vec<f64>);

/// The loop around a continuous model: times, states, and the torque of each sample.
fn continuous<P: LpvModel<f64, 4, 1, 3>>(
    model: &P,
    gain: &RowVector4<f64>,
) -> Result<SampledRun, ModelError> {
    let mut x = Vector4::zeros();
    let (mut time, mut states, mut torques) = (vec![0.0], vec![x.into()], Vec::new());
    for k in 0..samples() {
        let start = k as f64 * T_S;
        let torque = torque_at(gain, &x, start);
        for point in 1..=POINTS {
            let step = T_S / POINTS as f64;
            x = advance(model, &x, &Vector1::new(torque), step, TOLERANCES)?;
            time.push(start + step * point as f64);
            states.push(x.into());
        }
        torques.push(torque);
    }
    Ok((time, states, torques))
}

/// The loop around the discrete model.
fn discrete(plant: &Ballbot<f64>, gain: &RowVector4<f64>, predictor: Rk4) -> Vec<[f64; 4]> {
    let mut x = Vector4::zeros();
    let mut states = vec![x.into()];
    for k in 0..samples() {
        let torque = torque_at(gain, &x, k as f64 * T_S);
        x = predictor.advance(plant, &x, &Vector1::new(torque), T_S);
        states.push(x.into());
    }
    states
}

/// The largest difference of each state.
fn difference(a: &[[f64; 4]], b: &[[f64; 4]]) -> [f64; 4] {
    std::array::from_fn(|i| {
        let differences = a.iter().zip(b).map(|(a, b)| (a[i] - b[i]).abs());
        differences.fold(0.0, f64::max)
    })
}
