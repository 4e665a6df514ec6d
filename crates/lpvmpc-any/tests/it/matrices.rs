//! Linear models by stage, and scheduling from outside.

use crate::plants::{cart_pole, limits};
use crate::quadratic::{Affine, Quadratic};
use ballbot::Ballbot;
use lpvmpc::{Dynamics, LpvModel, Number, Rk4};
use lpvmpc_any::{Mpc, MpcSettings, Preview, StageMatrices, Terminal};
use lpvmpc_plant::{Plant, PlantData};
use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector3, dmatrix, dvector};

const HORIZON: usize = 20;

fn settings(last_input: bool) -> MpcSettings {
    MpcSettings {
        u_bounds: limits(&[3.0]),
        u_ref: Some(dvector![0.0]),
        terminal: Terminal::Cost(DMatrix::identity(4, 4) * 3.0),
        r_du: last_input.then(|| dmatrix![0.4]),
        ..MpcSettings::new(0.05, HORIZON, &[4.0, 2.0, 0.3, 0.1], &[0.2])
    }
}

/// The cost and the inputs of the best plan with these models.
fn optimum(
    settings: &MpcSettings,
    models: &[(DMatrix<f64>, DMatrix<f64>, DVector<f64>)],
    x0: &[f64],
) -> (f64, Vec<f64>) {
    let mut program = Quadratic::new(HORIZON);
    let mut x: Affine = program.given(x0);
    let mut before = program.given(&[0.0]);
    for k in 0..HORIZON {
        let (a, b, c) = models.get(k).or(models.last()).unwrap();
        let u = program.unknown(k, 1);
        program.weigh(&x, &settings.q);
        program.weigh(&u, &settings.r);
        if let Some(r_du) = &settings.r_du {
            program.weigh(&u.minus(&before), r_du);
        }
        program.within(&u, -3.0, 3.0);
        x = x.times(a).plus(&u.times(b)).shifted(c);
        before = u;
    }
    program.weigh(&x, &(DMatrix::identity(4, 4) * 3.0));
    program.solve()
}

fn compare(mpc: &mut Mpc, preview: &Preview, (cost, u): (f64, Vec<f64>), x0: &[f64]) {
    let plan = mpc.step(x0, preview).unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    assert!(
        (plan.cost - cost).abs() < 1e-6 * cost,
        "{} {cost}",
        plan.cost
    );
    for (k, u) in u.iter().enumerate() {
        assert!(
            (plan.u[(k, 0)] - u).abs() < 1e-4,
            "{k}: {} {u}",
            plan.u[(k, 0)]
        );
    }
}

/// A plant that changes along the horizon, with and without cost of changes and a disturbance.
#[test]
fn plans_with_matrices_by_stage_are_those_of_clarabel() {
    let model = |k: usize| {
        let turn = 0.1 * k as f64;
        let mut a = DMatrix::identity(4, 4);
        (a[(0, 2)], a[(1, 3)], a[(2, 1)]) = (0.05, 0.05, 0.3 * turn.sin());
        a[(3, 1)] = 0.4 * turn.cos();
        let b = dmatrix![0.0; 0.0; 0.05; 0.05 + 0.02 * turn];
        (a, b, dvector![0.0, 0.0, 0.01, -0.01 * turn])
    };
    let models: Vec<_> = (0..12).map(model).collect();
    let push = dvector![0.0, 0.01, 0.0, 0.02];
    let x0 = [1.0, 0.1, 0.0, -0.3];
    for last_input in [false, true] {
        let settings = settings(last_input);
        let pushed: Vec<_> = models
            .iter()
            .cloned()
            .map(|(a, b, c)| {
                // A rate, over a sample, as the mean of what it adds at its end and from its beginning on.
                let added = (&push + &a * &push) * (settings.t_s / 2.0);
                (a, b, c + added)
            })
            .collect();
        let best = optimum(&settings, &pushed, &x0);
        let matrices = models.iter().cloned().map(|(a, b, c)| StageMatrices {
            a,
            b,
            affine: Some(c),
        });
        let preview = Preview {
            x_ref: vec![DVector::zeros(4)],
            matrices: matrices.collect(),
            disturbance: vec![push.clone()],
            ..Preview::default()
        };
        compare(
            &mut Mpc::new(&cart_pole(), &settings).unwrap(),
            &preview,
            best,
            &x0,
        );
    }
}

/// A mass that a force moves: position and speed.
struct Mass;

impl Dynamics<2, 1> for Mass {
    fn f<N: Number>(&self, x: &SVector<N, 2>, u: &SVector<N, 1>) -> SVector<N, 2> {
        SVector::from([x[1], u[0]])
    }
}

/// A disturbance is a rate of the plant, whether the plant or its matrices over the samples are told: with these it counted
/// 1 / t_s times as much.
#[test]
fn a_disturbance_is_the_same_with_the_matrices_of_the_plant_itself() {
    let plant = Plant::new(PlantData::of_dynamics("mass", &Mass)).unwrap();
    let t_s = 0.05;
    let itself = StageMatrices {
        a: dmatrix![1.0, t_s; 0.0, 1.0],
        b: dmatrix![0.5 * t_s * t_s; t_s],
        affine: None,
    };
    for (r_du, u_ref) in [(None, None), (None, Some(0.0)), (Some(0.4), None)] {
        let settings = MpcSettings {
            r_du: r_du.map(|r| dmatrix![r]),
            u_ref: u_ref.map(|u| dvector![u]),
            ..MpcSettings::new(t_s, HORIZON, &[4.0, 0.3], &[0.2])
        };
        let preview = Preview {
            disturbance: vec![dvector![0.0, 2.0], dvector![0.0, -1.0]],
            ..Preview::default()
        };
        let step = |preview: &Preview| {
            let mut mpc = Mpc::new(&plant, &settings).unwrap();
            mpc.step(&[0.3, -0.1], preview).unwrap()
        };
        let plan = step(&preview);
        let told = step(&Preview {
            matrices: vec![itself.clone()],
            ..preview
        });
        assert!(plan.is_solved() && told.is_solved(), "{}", told.status);
        assert!((plan.u - told.u).amax() < 1e-8);
        assert!((plan.x - told.x).amax() < 1e-8);
    }
}

/// A ballbot's embedding with a scheduling that is known ahead.
#[test]
fn plans_with_a_scheduling_from_outside_are_those_of_clarabel() {
    let robot = Ballbot::<f64>::paper();
    let plant = Plant::new(PlantData::of_embedding("ballbot", &robot)).unwrap();
    let scheduling: Vec<_> = (0..HORIZON)
        .map(|k| {
            Vector3::new(
                0.4 * (0.2 * k as f64).sin(),
                0.5 * (0.3 * k as f64).cos(),
                0.1,
            )
        })
        .collect();
    let models: Vec<_> = { scheduling.iter() }
        .map(|s| {
            let (a, b): (SMatrix<f64, 4, 4>, SMatrix<f64, 4, 1>) = LpvModel::matrices(&robot, s);
            let (a, b) = Rk4 { substeps: 1 }.discretize(&a, &b, 0.05);
            let a = DMatrix::from_column_slice(4, 4, a.as_slice());
            (
                a,
                DMatrix::from_column_slice(4, 1, b.as_slice()),
                DVector::zeros(4),
            )
        })
        .collect();
    let x0 = [0.3, 0.05, 0.0, 0.1];
    for last_input in [false, true] {
        let settings = settings(last_input);
        let best = optimum(&settings, &models, &x0);
        let preview = Preview {
            x_ref: vec![DVector::zeros(4)],
            scheduling: { scheduling.iter() }
                .map(|s| DVector::from_row_slice(s.as_slice()))
                .collect(),
            ..Preview::default()
        };
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        compare(&mut mpc, &preview, best, &x0);
        let short = Preview {
            scheduling: vec![dvector![0.0]],
            ..Preview::default()
        };
        let said = mpc.step(&x0, &short).unwrap_err().to_string();
        assert_eq!(
            said,
            "scheduling, stage 0: it has 1 entries; there must be 3"
        );
    }
    let preview = Preview {
        scheduling: vec![dvector![0.0]],
        ..Preview::default()
    };
    let mut without = Mpc::new(&cart_pole(), &settings(false)).unwrap();
    let said = without.step(&x0, &preview).unwrap_err().to_string();
    assert!(said.contains("no embedding of its own"), "{said}");
}
