//! The delay line against the definition: the input at a time is the last that has arrived.

use lpvmpc::DelayLine;
use lpvmpc_testkit::rng::Rng;
use nalgebra::Vector1;

#[test]
fn stretches_are_those_of_the_definition() {
    let mut rng = Rng::new(3);
    for _ in 0..200 {
        let (delay, period) = (rng.uniform(0.0, 0.2), 0.05);
        let mut line = DelayLine::<f64, 1>::allocate(8);
        let mut commands: Vec<(f64, f64)> = Vec::new();
        for k in 0..30 {
            let now = f64::from(k) * period;
            let u = rng.normal();
            line.command(Vector1::new(u), delay);
            commands.push((now + delay, u));
            let ahead = rng.uniform(0.0, 0.3);
            let input_at = |time: f64| {
                let arrived = commands.iter().rev().find(|(arrival, _)| *arrival <= time);
                arrived.map_or(0.0, |(_, u)| *u)
            };
            let mut since = 0.0;
            line.for_each(ahead, |duration, u| {
                assert!(duration > 0.0);
                let middle = now + since + duration / 2.0;
                assert_eq!(u[0], input_at(middle), "at {middle} s");
                since += duration;
            });
            assert!((since - ahead).abs() < 1e-12, "{since} of {ahead} s");
            // In two parts, as by a sensor that is faster than the control.
            line.elapse(0.4 * period);
            line.elapse(0.6 * period);
        }
    }
}

#[test]
fn without_room_the_oldest_input_is_forgotten() {
    let mut line = DelayLine::<f64, 1>::allocate(2);
    for (u, delay) in [(1.0, 0.0), (2.0, 0.1), (3.0, 0.2)] {
        line.command(Vector1::new(u), delay);
    }
    let mut seen = Vec::new();
    line.for_each(0.3, |_, u| seen.push(u[0]));
    assert_eq!(seen, [0.0, 2.0, 3.0]);
    // A line without room holds nothing, and does not fail.
    let mut none = DelayLine::<f64, 1>::allocate(0);
    none.command(Vector1::new(1.0), 0.0);
    none.elapse(1.0);
    none.for_each(0.1, |_, u| assert_eq!(u[0], 0.0));
}

/// With 256 places the oldest of more inputs on their way was forgotten before it acted.
#[test]
fn no_input_is_forgotten_on_its_way() {
    for (delay, interval, late) in [(0.02, 2e-5, 1000), (0.3, 0.001, 300), (0.0, 0.05, 0)] {
        let places = DelayLine::<f64, 1>::places(delay, interval);
        assert!((late..=late + 4).contains(&places), "{places}");
        let mut line = DelayLine::<f64, 1>::allocate(places);
        for k in 0..3000 {
            line.command(Vector1::new(k as f64), delay);
            let mut next = None;
            line.for_each(interval, |duration, u| {
                if duration > 0.5 * interval {
                    next = Some(u[0]);
                }
            });
            let acts = k.max(late) - late;
            let next = next.expect("one acts");
            assert!(
                (next - acts as f64).abs() <= 1.0,
                "{next} in place of {acts}"
            );
            line.elapse(interval);
        }
    }
    for none in [f64::INFINITY, f64::NAN, -1.0] {
        assert_eq!(DelayLine::<f64, 1>::places(none, 0.01), 3);
    }
    assert_eq!(DelayLine::<f64, 1>::places(1e300, 0.01), 1_000_003);
}
