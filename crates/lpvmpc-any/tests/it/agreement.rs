//! The same closed loops as with a controller of the plant's own size.

use crate::plants::{CartPole, Chain, cart_pole, chain};
use ballbot::Ballbot;
use lpvmpc::{
    AlongMotion, Bounds, Controller, ControllerSettings, InputReference, Iterations, LpvModel,
    Reference, Rk4, TerminalIngredient, Weights, Workspace,
};
use lpvmpc_any::{Limits, LinearModels, Mpc, MpcSettings, Preview, StateBounds, Terminal};
use lpvmpc_plant::{Plant, PlantData};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Both controllers in one loop, driven by the one of fixed size.
struct Pair<P, const NX: usize, const NU: usize, const NS: usize> {
    fixed: Controller<P, f64, NX, NU, NS>,
    any: Mpc,
}

fn limits<const K: usize>(bounds: &Bounds<f64, K>) -> Option<Limits> {
    Some(Limits {
        lower: bounds.lower.as_slice().to_vec(),
        upper: bounds.upper.as_slice().to_vec(),
    })
}

impl<P, const NX: usize, const NU: usize, const NS: usize> Pair<P, NX, NU, NS>
where
    P: LpvModel<f64, NX, NU, NS>,
{
    fn new(model: P, plant: &Plant, settings: ControllerSettings<f64, NX, NU, NS>) -> Self {
        let dynamic =
            |rows: usize, entries: &[f64]| DMatrix::from_column_slice(rows, rows, entries);
        let any = MpcSettings {
            q: dynamic(NX, settings.weights.q.as_slice()),
            r: dynamic(NU, settings.weights.r.as_slice()),
            terminal: match &settings.terminal {
                TerminalIngredient::Cost(p) => Terminal::Cost(dynamic(NX, p.as_slice())),
                TerminalIngredient::Equality => Terminal::Equality,
            },
            x_bounds: limits(&settings.x),
            state_bounds: StateBounds::Priced(settings.soft_x.to_vec()),
            u_bounds: limits(&settings.u),
            u_ref: match settings.input_reference {
                InputReference::Given(u) => Some(DVector::from_row_slice(u.as_slice())),
                InputReference::SteadyState => None,
            },
            substeps: settings.predictor.rk4().substeps,
            linear_models: match plant.data().embedding {
                Some(_) => LinearModels::Own,
                None => LinearModels::AlongMotion,
            },
            iterations: settings.iterations,
            ..MpcSettings::new(settings.t_s, settings.horizon, &[], &[])
        };
        Self {
            fixed: Controller::allocate(model, settings).unwrap(),
            any: Mpc::new(plant, &any).unwrap(),
        }
    }

    /// The largest difference of the inputs in so many samples, each towards one of the references for half
    /// of them.
    fn largest_difference(
        &mut self,
        start: [f64; NX],
        references: [[f64; NX]; 2],
        samples: usize,
    ) -> f64 {
        // A controller of any size looks for other plans, too.
        let room = self.fixed.settings().capacity().with_second_plan();
        let mut workspace = Workspace::allocate(room);
        let mut x = SVector::<f64, NX>::from(start);
        let mut largest = 0.0_f64;
        let t_s = self.fixed.settings().t_s;
        for k in 0..samples {
            let x_ref = references[2 * k / samples];
            let reference = Reference::constant(SVector::from(x_ref));
            let fixed = self.fixed.step(&x, &reference, &mut workspace);
            assert!(fixed.status.is_solved(), "{:?}", fixed.status);
            let plan = self.any.step(x.as_slice(), &Preview::to(&x_ref)).unwrap();
            assert!(plan.is_solved(), "{}", plan.status);
            assert_eq!(plan.x.nrows(), fixed.u.len() + 1);
            for (i, u) in fixed.u.iter().enumerate() {
                for j in 0..NU {
                    largest = largest.max((plan.u[(i, j)] - u[j]).abs());
                }
            }
            let u = fixed.first_input();
            x = Rk4 { substeps: 4 }.advance(self.fixed.model(), &x, &u, t_s);
        }
        largest
    }
}

fn weights<const NX: usize, const NU: usize>(q: [f64; NX], r: [f64; NU]) -> Weights<f64, NX, NU> {
    Weights {
        q: SMatrix::from_diagonal(&q.into()),
        r: SMatrix::from_diagonal(&r.into()),
    }
}

fn bounds<const K: usize>(half: [f64; K]) -> Bounds<f64, K> {
    let upper = SVector::from(half);
    Bounds {
        lower: -upper,
        upper,
    }
}

#[test]
fn a_ballbot_from_data_is_driven_as_the_one_in_rust() {
    let robot = Ballbot::<f64>::paper();
    let plant = Plant::new(PlantData::of_embedding("ballbot", &robot)).unwrap();
    // The robot's own f is in closed form, its file's is A(s) x + B(s) u: they differ by rounding. A
    // descent compares costs, which then may decide by their last bits, to its tolerance.
    let descent = Iterations::default();
    for (iterations, bound) in [(Iterations::Fixed(1), 1e-10), (descent, 1e-7)] {
        for terminal in [
            TerminalIngredient::Cost(SMatrix::<f64, 4, 4>::identity() * 50.0),
            TerminalIngredient::Equality,
        ] {
            let weights = weights([20.0, 0.1, 1.0, 1.0], [10.0]);
            let settings = ControllerSettings {
                iterations,
                ..ControllerSettings::new(0.05, 20, weights, terminal, bounds([0.6]))
            };
            let settings = settings.soft_bounds(bounds([20.0, 0.4, 10.0, 4.0]));
            let mut pair = Pair::new(robot, &plant, settings);
            let references = [[1.0, 0.0, 0.0, 0.0], [0.0; 4]];
            let difference = pair.largest_difference([0.0; 4], references, 120);
            assert!(
                difference < bound,
                "{iterations:?}, {terminal:?}: {difference:e} N m"
            );
        }
    }
}

#[test]
fn a_plant_in_as_many_places_as_it_has_states_is_the_same() {
    let weights = weights([10.0, 10.0, 1.0, 1.0], [0.1]);
    let terminal = TerminalIngredient::Cost(SMatrix::identity() * 100.0);
    let settings = ControllerSettings::new(0.04, 30, weights, terminal, bounds([8.0]));
    let settings = settings.soft_bounds(bounds([1.0, 0.6, 3.0, 6.0]));
    let mut pair = Pair::new(AlongMotion::<_, 5>(CartPole), &cart_pole(), settings);
    let there = [0.9, 0.0, 0.0, 0.0];
    let difference = pair.largest_difference([0.0, 0.4, 0.0, 0.0], [there, [0.0; 4]], 200);
    assert!(difference < 1e-10, "{difference:e} N");
}

/// The difference of a plant that leaves places over; terminal cost and equality.
fn chain_difference<const NX: usize, const NU: usize, const NS: usize>() -> f64 {
    let mut largest = 0.0_f64;
    for terminal in [
        TerminalIngredient::Cost(SMatrix::<f64, NX, NX>::identity() * 20.0),
        TerminalIngredient::Equality,
    ] {
        let horizon = if terminal == TerminalIngredient::Equality {
            40
        } else {
            15
        };
        let weights = weights([1.0; NX], [0.1; NU]);
        let settings = ControllerSettings::new(0.1, horizon, weights, terminal, bounds([2.5; NU]));
        let settings = settings.soft_bounds(bounds([1.2; NX]));
        let model = AlongMotion::<_, NS>(Chain);
        let mut pair = Pair::new(model, &chain::<NX, NU>(), settings);
        let start = std::array::from_fn(|i| 0.4 * (1.0 + i as f64).sin());
        let there = std::array::from_fn(|i| 0.2 * (2.0 + i as f64).cos());
        let difference = pair.largest_difference(start, [there, [0.0; NX]], 40);
        largest = largest.max(difference);
    }
    largest
}

#[test]
fn places_that_are_left_over_change_nothing() {
    for (size, difference) in [
        ("1 x 1", chain_difference::<1, 1, 2>()),
        ("3 x 1", chain_difference::<3, 1, 4>()),
        ("3 x 2", chain_difference::<3, 2, 5>()),
        ("5 x 2", chain_difference::<5, 2, 7>()),
    ] {
        assert!(difference < 1e-9, "{size}: {difference:e} m/s");
    }
}
