//! Median times of a step of a controller of any size, beside the controller of the plant's own size for the plant in
//! Rust: both in the same closed loop, in turns.
//!
//! ```text
//! cargo bench -p lpvmpc-any --bench time_step [-- PLANT]
//! ```

use ballbot::Ballbot;
use lpvmpc::{
    AlongMotion, Bounds, Controller, ControllerSettings, Dynamics, Iterations, LpvModel, Number,
    Reference, Rk4, TerminalIngredient, Weights,
};
use lpvmpc_any::{Limits, LinearModels, Mpc, MpcSettings, Preview, StateBounds, Terminal};
use lpvmpc_plant::{Plant, PlantData};
use nalgebra::{DMatrix, SMatrix, SVector};
use std::error::Error;
use std::time::Instant;

const SAMPLES: usize = 200;
const ROUNDS: usize = 9;
const T_S: f64 = 0.05;
const HORIZON: usize = 20;

/// A cart with a pole on a track: position (m), angle from upright (rad) and their rates; the force
/// on the cart (N).
struct CartPole;

impl Dynamics<4, 1> for CartPole {
    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 4> {
        let number = N::constant;
        let (cart, pole, length, gravity) = (number(1.0), number(0.2), number(0.5), number(9.81));
        let (sin, cos) = x[1].sin_cos();
        let mass = cart + pole * sin * sin;
        let force = u[0] - pole * length * x[3] * x[3] * sin;
        let acceleration = (force + pole * gravity * sin * cos) / mass;
        let turning = (gravity * sin + cos * acceleration) / length;
        SVector::from([x[2], x[3], acceleration, turning])
    }
}

/// A chain of leaking tanks with curved pipes: each input fills one, each tank fills the next.
struct Chain;

impl<const NX: usize, const NU: usize> Dynamics<NX, NU> for Chain {
    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        let number = N::constant;
        SVector::from_fn(|i, _| {
            let next = x[(i + 1) % NX];
            let fed = if i % 2 == 0 {
                u[i / 2 % NU]
            } else {
                number(0.0)
            };
            number(0.3) * x[i].sin() + number(1.5) * next.tanh() + fed
        })
    }
}

/// A closed loop: weights, bound of the inputs, and where to go and back.
struct Task<const NX: usize, const NU: usize> {
    q: [f64; NX],
    r: f64,
    bound: f64,
    there: [f64; NX],
}

/// Medians of both, in us.
fn time<P, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    plant: &Plant,
    task: &Task<NX, NU>,
    iterations: Iterations<f64>,
) -> Result<[f64; 2], Box<dyn Error>>
where
    P: LpvModel<f64, NX, NU, NS> + Clone,
{
    let weights = Weights {
        q: SMatrix::from_diagonal(&SVector::from(task.q)),
        r: SMatrix::from_diagonal(&SVector::repeat(task.r)),
    };
    let terminal = TerminalIngredient::Cost(SMatrix::identity() * 50.0);
    let bound = SVector::repeat(task.bound);
    let bounds = Bounds {
        lower: -bound,
        upper: bound,
    };
    let settings = ControllerSettings {
        iterations,
        ..ControllerSettings::new(T_S, HORIZON, weights, terminal, bounds)
    };
    let any = MpcSettings {
        terminal: Terminal::Cost(DMatrix::identity(NX, NX) * 50.0),
        state_bounds: StateBounds::Hard,
        u_bounds: Some(Limits {
            lower: vec![-task.bound; NU],
            upper: vec![task.bound; NU],
        }),
        linear_models: match plant.data().embedding {
            Some(_) => LinearModels::Own,
            None => LinearModels::AlongMotion,
        },
        iterations,
        ..MpcSettings::new(T_S, HORIZON, &task.q, &[task.r; NU])
    };
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        let mut fixed = Controller::allocate(model.clone(), settings)?;
        let mut workspace = fixed.workspace();
        let mut any = Mpc::new(plant, &any)?;
        let mut x = SVector::<f64, NX>::zeros();
        for k in 0..SAMPLES {
            let there = if k / 100 % 2 == 0 {
                task.there
            } else {
                [0.0; NX]
            };
            let preview = Preview::to(&there);
            let begin = Instant::now();
            any.step(x.as_slice(), &preview)?;
            times[1].push(begin.elapsed());
            let x_ref = Reference::constant(SVector::from(there));
            let begin = Instant::now();
            let u = fixed.step(&x, &x_ref, &mut workspace).first_input();
            times[0].push(begin.elapsed());
            x = Rk4 { substeps: 1 }.advance(model, &x, &u, T_S);
        }
    }
    Ok(times.map(|mut times| {
        times.sort();
        1e6 * times[times.len() / 2].as_secs_f64()
    }))
}

/// A row for each kind of iterations.
fn row<P, const NX: usize, const NU: usize, const NS: usize>(
    name: &str,
    model: &P,
    plant: &Plant,
    task: &Task<NX, NU>,
) -> Result<(), Box<dyn Error>>
where
    P: LpvModel<f64, NX, NU, NS> + Clone,
{
    // `cargo bench` adds an option of its own.
    let mut wanted = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with("--"));
    if wanted.next().is_some_and(|wanted| wanted != name) {
        return Ok(());
    }
    for (kind, iterations) in [
        ("one program", Iterations::Fixed(1)),
        ("descent", Iterations::default()),
    ] {
        let [own, any] = time(model, plant, task, iterations)?;
        let size = format!("{NX} x {NU}");
        println!(
            "{name:10} {size:7} {kind:12} {own:10.1} {any:10.1} {:8.2}",
            any / own
        );
    }
    Ok(())
}

fn chain<const NX: usize, const NU: usize, const NS: usize>() -> Result<(), Box<dyn Error>> {
    let plant = Plant::new(PlantData::of_dynamics::<_, NX, NU>("chain", &Chain))?;
    let task = Task {
        q: [1.0; NX],
        r: 0.1,
        bound: 2.5,
        there: std::array::from_fn(|i| 0.2 * (2.0 + i as f64).cos()),
    };
    row::<_, NX, NU, NS>(
        &format!("chain{NX}x{NU}"),
        &AlongMotion::<&Chain, NS>(&Chain),
        &plant,
        &task,
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("us a step, medians                own size   any size    ratio");
    let robot = Ballbot::<f64>::paper();
    let plant = Plant::new(PlantData::of_embedding("ballbot", &robot))?;
    let task = Task {
        q: [20.0, 0.1, 1.0, 1.0],
        r: 10.0,
        bound: 0.6,
        there: [3.0, 0.0, 0.0, 0.0],
    };
    row::<_, 4, 1, 3>("ballbot", &robot, &plant, &task)?;
    let plant = Plant::new(PlantData::of_dynamics("cart-pole", &CartPole))?;
    let task = Task {
        q: [10.0, 10.0, 1.0, 1.0],
        r: 0.1,
        bound: 8.0,
        there: [0.9, 0.0, 0.0, 0.0],
    };
    row::<_, 4, 1, 5>(
        "cart-pole",
        &AlongMotion::<&CartPole, 5>(&CartPole),
        &plant,
        &task,
    )?;
    chain::<2, 1, 3>()?;
    chain::<3, 1, 4>()?;
    chain::<4, 1, 5>()?;
    chain::<4, 2, 6>()?;
    chain::<5, 2, 7>()?;
    chain::<6, 2, 8>()?;
    chain::<8, 4, 12>()?;
    chain::<12, 4, 16>()?;
    chain::<16, 6, 22>()
}
