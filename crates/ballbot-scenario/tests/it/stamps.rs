//! The regulator keeps time by the stamps of its measurements, whatever they count from.

use ballbot::PlaneRegulator;
use ballbot_scenario::{EstimatorTable, Prepared, Scenario, TerminalTable, WorldTable};
use lpvmpc::{BoundId, Command, Measurement, Observation, Reading, Regulator, Restart, Verdict};
use lpvmpc_sim::{ClosedLoop, Recording, RunConfig, World, record};
use nalgebra::{Vector1, Vector4};
use std::path::Path;
use std::time::Duration;

/// A regulator whose sensors' clock shows another time, and whose readings are spoilt.
struct Elsewhere {
    regulator: PlaneRegulator,
    /// What its clock shows, of the time of the run (s).
    clock: Shift,
    /// The time of the run, of what its clock shows.
    back: Shift,
    spoil: fn(&mut Measurement<f64, 4>),
}

impl Regulator<f64, 4, 1, 4> for Elsewhere {
    fn t_s(&self) -> f64 {
        self.regulator.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<f64, 4>) -> Observation<4> {
        let mut seen = *measurement;
        (self.spoil)(&mut seen);
        seen.t = (self.clock)(measurement.t);
        self.regulator.observe(&seen)
    }

    fn decide(&mut self, reference: &dyn Fn(f64) -> Vector4<f64>) -> Command<f64, 4, 1> {
        self.regulator.decide(&|t| reference((self.back)(t)))
    }

    fn between(&mut self) -> Option<Vector1<f64>> {
        self.regulator.between()
    }

    fn take_over(&mut self, previous: &Self) {
        self.regulator.take_over(&previous.regulator);
    }

    fn cost(&self) -> f64 {
        self.regulator.cost()
    }

    fn predicted(&self, i: usize) -> Option<Vector4<f64>> {
        self.regulator.predicted(i)
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        self.regulator.active_bound(i)
    }
}

fn scenario() -> Scenario {
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    scenario.controller.terminal = TerminalTable::DiscreteRiccati;
    scenario.reference = Scenario::load("two-setpoints").unwrap().reference;
    scenario
}

/// On the readings with a delay, and with the estimator.
fn variants() -> [Prepared; 3] {
    let prepared = |change: &dyn Fn(&mut Scenario)| {
        let mut scenario = scenario();
        let world =
            "sensor_period_s = 0.01\n[delay]\ntransport_s = 0.016\n[sensors.theta]\ndelay_s = 0.02";
        scenario.world = Some(toml::from_str::<WorldTable>(world).unwrap());
        scenario.controller.delay_s = 0.016;
        change(&mut scenario);
        scenario.prepare(Path::new(".")).unwrap()
    };
    [
        prepared(&|scenario| {
            scenario.world = None;
            scenario.controller.delay_s = 0.0;
        }),
        prepared(&|scenario| scenario.world.as_mut().unwrap().sensors.theta.delay_s = 0.0),
        prepared(&|scenario| scenario.controller.estimator = Some(EstimatorTable::default())),
    ]
}

fn run(
    prepared: &Prepared,
    clock: Shift,
    back: Shift,
    spoil: fn(&mut Measurement<f64, 4>),
) -> Recording<4, 1, 4> {
    let plane = &prepared.planes[0];
    let regulator = prepared.closed_loop(plane).unwrap().regulator;
    let regulator = regulator.regulator().clone();
    let world = plane.world.clone();
    let ball = World::new(world.robot, plane.initial_state, world.settings).unwrap();
    let elsewhere = Elsewhere {
        regulator,
        clock,
        back,
        spoil,
    };
    let mut closed_loop = ClosedLoop::new(elsewhere, ball).unwrap();
    closed_loop.without_plan = world.without_plan;
    let course = RunConfig {
        samples: (5.0 / prepared.settings.t_s) as usize,
        reference: &|t| plane.state_reference(t),
        clock: &|| Duration::ZERO,
        progress: &|_| (),
    };
    record(&mut closed_loop, &course)
}

/// One clock's time as the other's.
type Shift = fn(f64) -> f64;

fn as_it_is(_: &mut Measurement<f64, 4>) {}

/// A first stamp of 10 to 40 s made the estimate NaN, one of 100 s or a Unix time left it at zero,
/// without torque and "solved", for ever.
#[test]
fn the_first_stamp_is_the_beginning() {
    for (variant, prepared) in variants().iter().enumerate() {
        let from_zero = run(prepared, |t| t, |t| t, as_it_is).trajectory;
        let clocks: [[Shift; 2]; 5] = [
            [|t| t + 10.0, |t| t - 10.0],
            [|t| t + 40.0, |t| t - 40.0],
            [|t| t + 100.0, |t| t - 100.0],
            [|t| t - 1000.0, |t| t + 1000.0],
            [|t| t + 1.8e9, |t| t - 1.8e9],
        ];
        for [clock, back] in clocks {
            // A set point takes effect at the sample of its time, which a Unix time tells to 0.24 us.
            let run = run(prepared, clock, back, as_it_is).trajectory;
            assert_eq!(run.samples.len(), from_zero.samples.len());
            let pairs = run.states().zip(from_zero.states());
            let far = pairs.map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
            assert!(far < 2e-3, "variant {variant}, {}: {far}", clock(0.0));
            assert!(run.samples.iter().any(|sample| sample.u[0].abs() > 0.05));
        }
    }
}

/// The robot stood still meanwhile. The estimate was NaN after it.
#[test]
fn after_a_gap_the_loop_goes_on_and_says_so() {
    let [.., with_estimator] = variants();
    let recording = run(
        &with_estimator,
        |t| if t > 2.0001 { t + 30.0 } else { t },
        |t| if t > 20.0 { t - 30.0 } else { t },
        as_it_is,
    );
    let restarts = recording
        .log
        .iter()
        .filter_map(|row| row.observation.restart);
    assert_eq!(restarts.collect::<Vec<_>>(), [Restart::Start, Restart::Gap]);
    let trajectory = &recording.trajectory;
    assert_eq!(trajectory.samples.len(), 100);
    let last = trajectory.final_state;
    assert!(last[0].abs() < 0.1 && last[1].abs() < 0.05, "{last}");
}

#[test]
fn what_becomes_of_the_readings_reaches_the_log() {
    let [.., with_estimator] = variants();
    let recording = run(
        &with_estimator,
        |t| t,
        |t| t,
        |seen| match (seen.t * 100.0).round() as u64 {
            150 => seen.readings[1] = Some(Reading::fresh(f64::NAN)),
            160 => seen.readings[0] = seen.readings[0].map(|phi| Reading::fresh(phi.value + 1.0)),
            170 => {
                seen.readings[3] = seen.readings[3].map(|rate| Reading {
                    age: f64::INFINITY,
                    ..rate
                });
            }
            180 => seen.readings[0] = None,
            _ => {}
        },
    );
    let verdicts = |row: usize| recording.log[row].observation.verdicts;
    assert_eq!(verdicts(150)[1], Verdict::NotFinite);
    assert_eq!(verdicts(160)[0], Verdict::Outlier);
    assert_eq!(verdicts(170)[3], Verdict::Stale);
    assert_eq!(verdicts(180)[0], Verdict::Missing);
    assert_eq!(
        verdicts(190),
        [
            Verdict::Used,
            Verdict::Used,
            Verdict::NotNeeded,
            Verdict::Used
        ]
    );
    let last = recording.trajectory.final_state;
    assert!(last[0].abs() < 0.1 && last[1].abs() < 0.05, "{last}");
}
