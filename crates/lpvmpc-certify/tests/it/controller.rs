//! The loop with a certified terminal set.

use crate::plants::{CART_POLE, REACTOR, random};
use lpvmpc::AlongMotion;
use lpvmpc_any::{Decision, Iterations, Limits, Mpc, MpcSettings, Preview, Terminal};
use lpvmpc_plant::SizedPlant;
use lpvmpc_sim::{Tolerances, advance};
use nalgebra::{SVector, Vector4};

pub const EXACT: Tolerances = Tolerances {
    relative: 1e-12,
    absolute: 1e-12,
};

pub fn cart_pole_settings() -> MpcSettings {
    let (plant, certificate) = &*CART_POLE;
    let set = certificate.terminal_set(plant).unwrap();
    MpcSettings {
        terminal: Terminal::Certified(Box::new(set)),
        ..MpcSettings::new(0.05, 20, &[2.0, 5.0, 0.1, 0.1], &[0.01])
    }
}

/// From far outside of the set, the plant integrated to 1e-12: once there is a plan, there is one, bounds hold, the cost
/// falls by the stage cost, and the plant comes to rest.
#[test]
fn once_there_is_a_plan_there_is_one() {
    let (plant, certificate) = &*CART_POLE;
    let model = AlongMotion::<_, 5>(SizedPlant::<4, 1>::new(plant.clone()).unwrap());
    let mut random = random();
    let (mut planned, mut outside) = (0, 0);
    for _ in 0..8 {
        let mut mpc = Mpc::new(plant, &cart_pole_settings()).unwrap();
        let mut x = Vector4::new(
            0.9 * random(),
            0.35 * random(),
            1.5 * random(),
            2.0 * random(),
        );
        outside += usize::from(!certificate.contains(x.as_slice()));
        let mut before: Option<f64> = None;
        for sample in 0..70 {
            let plan = mpc.step(x.as_slice(), &Preview::default()).unwrap();
            let guaranteed = plan.decision.unwrap().is_guaranteed();
            if sample == 0 && !guaranteed {
                break;
            }
            planned += usize::from(sample == 0);
            assert!(
                guaranteed || before.is_none(),
                "sample {sample}: {}",
                plan.status
            );
            let u = SVector::<f64, 1>::new(plan.u[(0, 0)]);
            assert!(u[0].abs() <= 10.0);
            if guaranteed {
                assert!(plan.is_solved());
                if let Some(bound) = before {
                    assert!(
                        plan.cost <= bound + 1e-4 * (1.0 + bound),
                        "{} above {bound}",
                        plan.cost
                    );
                }
                let stage =
                    2.0 * x[0] * x[0] + 5.0 * x[1] * x[1] + 0.1 * (x[2] * x[2] + x[3] * x[3]);
                before = Some(plan.cost - stage - 0.01 * u[0] * u[0]);
            }
            x = advance(&model, &x, &u, 0.05, EXACT).unwrap();
            let inside = x[0].abs() <= 1.0 && x[1].abs() <= 0.4;
            assert!(!guaranteed || inside, "{x}");
        }
        assert!(before.is_none() || x.norm() < 0.2, "{x}");
    }
    // Most of them can be brought to the set within the horizon.
    assert!(
        planned >= 4 && outside >= 4,
        "{planned} of 8, {outside} from outside"
    );
}

/// Programs that minimise next to nothing of what plans are judged by: where their answers cost more, the rest of the
/// last plan or the terminal law is applied, and the loop converges all the same.
#[test]
fn the_rest_of_the_plan_is_taken_where_programs_are_no_better() {
    let (plant, _) = &*CART_POLE;
    let model = AlongMotion::<_, 5>(SizedPlant::<4, 1>::new(plant.clone()).unwrap());
    let mut settings = cart_pole_settings();
    settings.iterations = Iterations::Fixed(1);
    settings.q *= 1e-6;
    settings.r *= 1e-6;
    let mut mpc = Mpc::new(plant, &settings).unwrap();
    let mut x = Vector4::new(0.3, 0.15, 0.0, 0.0);
    let (mut known, mut last) = (0, f64::INFINITY);
    for sample in 0..80 {
        let plan = mpc.step(x.as_slice(), &Preview::default()).unwrap();
        let decision = plan.decision.unwrap();
        assert!(decision.is_guaranteed(), "sample {sample}: {}", plan.status);
        known += usize::from(decision != Decision::NewPlan);
        assert!(
            plan.cost <= last * (1.0 + 1e-6) + 1e-9,
            "{} above {last}",
            plan.cost
        );
        last = plan.cost;
        x = advance(
            &model,
            &x,
            &SVector::<f64, 1>::new(plan.u[(0, 0)]),
            0.05,
            EXACT,
        )
        .unwrap();
    }
    assert!(known >= 10, "{known} of 80 samples");
    assert!(x.norm() < 0.1, "{x}");
}

/// Other settings forgot the plan, whose rest is better than what poor programs find.
#[test]
fn the_plan_goes_on_with_other_settings() {
    let (plant, _) = &*CART_POLE;
    let model = AlongMotion::<_, 5>(SizedPlant::<4, 1>::new(plant.clone()).unwrap());
    let mut poor = cart_pole_settings();
    poor.iterations = Iterations::Fixed(1);
    poor.q *= 1e-6;
    poor.r *= 1e-6;
    let mut random = random();
    let mut kept = 0;
    for _ in 0..20 {
        let x = Vector4::new(
            0.9 * random(),
            0.35 * random(),
            1.5 * random(),
            2.0 * random(),
        );
        let mut mpc = Mpc::new(plant, &cart_pole_settings()).unwrap();
        let plan = mpc.step(x.as_slice(), &Preview::default()).unwrap();
        if !plan.decision.unwrap().is_guaranteed() {
            continue;
        }
        let u = SVector::<f64, 1>::new(plan.u[(0, 0)]);
        let x = advance(&model, &x, &u, 0.05, EXACT).unwrap();
        mpc.set_settings(&poor).unwrap();
        let plan = mpc.step(x.as_slice(), &Preview::default()).unwrap();
        assert!(plan.decision.unwrap().is_guaranteed(), "{}", plan.status);
        kept += usize::from(plan.decision == Some(Decision::Candidate));
    }
    assert!(kept >= 4, "{kept}");
}

#[test]
fn what_the_certificate_is_not_for_is_refused() {
    let (plant, certificate) = &*CART_POLE;
    let refused = |change: &dyn Fn(&mut MpcSettings)| {
        let mut settings = cart_pole_settings();
        change(&mut settings);
        Mpc::new(plant, &settings)
            .map(drop)
            .unwrap_err()
            .to_string()
    };
    type Change = fn(&mut MpcSettings);
    let narrow: Change = |s| {
        s.x_bounds = Some(Limits {
            lower: vec![-10.0, -0.05, -10.0, -10.0],
            upper: vec![10.0, 0.05, 10.0, 10.0],
        });
    };
    let short: Change = |s| {
        s.x_bounds = Some(Limits {
            lower: vec![-1.0; 3],
            upper: vec![1.0; 3],
        });
    };
    let cases: [(Change, &str); 10] = [
        // Little beside the largest weight, and of another unit.
        (
            |s| {
                if let Terminal::Certified(set) = &mut s.terminal {
                    set.q[(0, 0)] = 1e12;
                }
                s.q[(3, 3)] += 0.1;
            },
            "q: it is larger than the certificate's",
        ),
        (
            |s| s.t_s = 0.04,
            "t_s: it is 0.04 s, that of the certificate 0.05 s",
        ),
        (
            |s| s.q[(0, 0)] = 3.0,
            "q: it is larger than the certificate's",
        ),
        (
            |s| s.r[(0, 0)] = 3.0,
            "r: it is larger than the certificate's",
        ),
        (|s| s.q[(0, 0)] = f64::NAN, "q: "),
        // What does not fit was looked at as if it did.
        (short, "x_bounds, lower: it has 3 entries; there must be 4"),
        (
            |s| {
                s.u_bounds = Some(Limits {
                    lower: vec![],
                    upper: vec![],
                })
            },
            "u_bounds, lower: it has 0 entries; there must be 1",
        ),
        (narrow, "x_bounds: angle is bounded by -0.05 to 0.05"),
        (
            |s| s.u_ref = Some(nalgebra::DVector::zeros(1)),
            "u_ref: the certificate says nothing of it",
        ),
        (|s| s.horizon = 0, "horizon"),
    ];
    for (change, expected) in cases {
        let message = refused(&change);
        assert!(message.contains(expected), "{message}");
    }
    let mut mpc = Mpc::new(plant, &cart_pole_settings()).unwrap();
    let message = mpc
        .step(&[0.0; 4], &Preview::to(&[0.0, 0.1, 0.0, 0.0]))
        .unwrap_err()
        .to_string();
    let expected = "x_ref: angle is 0.1, and the certificate is about 0; elsewhere may be what no formula of the plant \
                    reads: position";
    assert!(message.contains(expected), "{message}");
    // Without a guarantee, inputs are still finite and within their bounds.
    for x in [
        [0.0, 3.0, 0.0, 0.0],
        [1e6, 0.0, 0.0, 0.0],
        [f64::NAN, 0.0, 0.0, 0.0],
        [0.0, 1e300, 0.0, 0.0],
    ] {
        let plan = mpc.step(&x, &Preview::default()).unwrap();
        assert!(!plan.decision.unwrap().is_guaranteed(), "{}", plan.status);
        assert!(plan.u.iter().all(|u| u.abs() <= 10.0), "{}", plan.u);
    }
    mpc.step(&[0.0; 3], &Preview::default()).unwrap_err();
    let error = REACTOR.1.terminal_set(plant).unwrap_err().to_string();
    assert!(error.contains("of another plant"), "{error}");
    assert!(certificate.value(&[0.0; 3]).is_nan());
}
