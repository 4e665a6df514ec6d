//! A run is a function of the campaign and its number.

use crate::{NO_CLOCK, NOISY, PROGRAM, column, numbers, read, rows, with, write_whole, written};
use ballbot_campaign::{Campaign, Cell, Source, Summary};
use ballbot_scenario::{RunHooks, Scenario};
use std::path::Path;

/// Whatever the threads and the order, and of every run alone.
#[test]
fn rows_depend_on_seed_and_number_alone() {
    with(NOISY, |campaign| {
        let one_by_one = rows(campaign);
        let backwards = (0..campaign.runs())
            .rev()
            .map(|run| campaign.run(run, NO_CLOCK).unwrap());
        let mut backwards: Vec<_> = backwards.collect();
        backwards.reverse();
        assert_eq!(backwards, one_by_one);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut together = Vec::new();
            let each = |row| -> Result<(), ballbot_campaign::CampaignError> {
                together.push(row);
                Ok(())
            };
            pool.install(|| campaign.run_all(NO_CLOCK, &|| (), each))
                .unwrap();
            assert_eq!(together, one_by_one, "{threads} threads");
        }
        assert_eq!(campaign.replay(7, NO_CLOCK).unwrap().row, one_by_one[7]);
        let seeds = numbers(campaign, &one_by_one, "seed");
        assert!(seeds.windows(2).all(|pair| pair[0] != pair[1]), "{seeds:?}");
    });
    let first = with(NOISY, |campaign| campaign.run(0, NO_CLOCK).unwrap());
    let other = NOISY.replace("seed = 3", "seed = 4");
    assert_ne!(
        with(&other, |campaign| campaign.run(0, NO_CLOCK).unwrap()),
        first
    );
}

/// Another input, or more runs, leave the draws of the others as they are.
#[test]
fn what_is_added_changes_no_draws() {
    let more = NOISY.replace("runs = 24", "runs = 48")
        + "[[vary]]\nkey = \"world.floor.slope_x_deg\"\nuniform = [0.0, 1.0]\n";
    let [few, many] = [NOISY, more.as_str()].map(|text| with(text, |campaign| campaign.draw(5)));
    assert_eq!((few.seed, &few.values[..]), (many.seed, &many.values[..4]));
}

/// A nested table used to take the place of all that the scenario has there, and where it was the only
/// mention of a world, all runs had the same noise.
#[test]
fn tables_in_set_are_keys_with_dots() {
    let rows_of = |set: &str| {
        let text = format!(
            "title = \"Tables\"\nscenario = \"single-setpoint\"\nruns = 6\nseed = 3\n\
             [set]\nduration_s = 1.0\n{set}\n\
             [[vary]]\nkey = \"initial_state.theta_rad\"\nuniform = [-0.1, 0.1]\n"
        );
        with(&text, rows)
    };
    let dotted = "\"world.sensors.theta.noise_rad\" = 0.001\n\"world.delay.computation_s\" = 0.02";
    let wanted = rows_of(dotted);
    for nested in [
        "world.sensors.theta.noise_rad = 0.001\nworld.delay.computation_s = 0.02",
        "world = { sensors.theta.noise_rad = 0.001, delay = { computation_s = 0.02 } }",
        "[set.world.delay]\ncomputation_s = 0.02\n[set.world.sensors.theta]\nnoise_rad = 0.001",
    ] {
        assert_eq!(rows_of(nested), wanted, "{nested}");
    }
    // What the scenario has beside them stays.
    let (folder, path) = written(
        "title = \"Beside\"\nscenario = \"loop.toml\"\nruns = 1\n\
         [set]\nworld.delay.computation_s = 0.02\n\
         [[vary]]\nkey = \"initial_state.theta_rad\"\nuniform = [-0.1, 0.1]\n",
    );
    let scenario = ballbot_scenario::builtin::find("single-setpoint").unwrap();
    let noisy = format!(
        "{}\n[world.sensors.theta]\nnoise_rad = 0.003\n",
        scenario.text
    );
    std::fs::write(folder.path().join("loop.toml"), noisy).unwrap();
    let source = Source::load(&path).unwrap();
    let campaign = Campaign::new(&source, source.folder(), PROGRAM).unwrap();
    let prepared = campaign.scenario(&campaign.draw(0)).unwrap();
    let settings = &prepared.planes[0].world.settings;
    assert_eq!((settings.sensors[1].noise, settings.delay), (0.003, 0.02));
    // Another kind of reference takes the place of the scenario's.
    let lines = "[set.reference.lines]\npoints = [{ time_s = 0.0, phi_rad = 0.5 }]\n[[vary]]";
    let text = NOISY.replacen("[[vary]]", lines, 1);
    let phi = with(&text, |campaign| {
        let prepared = campaign.scenario(&campaign.draw(0)).unwrap();
        prepared.planes[0].state_reference(0.0)[0]
    });
    assert_eq!(phi, 0.5);
}

/// It was an empty cell.
#[test]
fn an_infinite_value_that_is_drawn_is_in_the_results() {
    let text = "title = \"Values\"\nscenario = \"single-setpoint\"\n[set]\nduration_s = 0.1\n\
         [[vary]]\nkey = \"bounds.theta_dot_rad_s.1\"\ngrid = [5.0, inf]\n";
    with(text, |campaign| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.parquet");
        write_whole(campaign, &path);
        let found = numbers(campaign, &read(&path), "bounds.theta_dot_rad_s.1");
        assert_eq!(found, [5.0, f64::INFINITY]);
    });
}

/// They were looked for in the current folder.
#[test]
fn files_for_a_built_in_scenario_are_beside_the_campaign() {
    let text = NOISY.replacen(
        "[[vary]]",
        "\"world.excitation\" = \"torque.csv\"\n[[vary]]",
        1,
    );
    let (folder, path) = written(&text);
    let torque = "t_s,torque_excitation_nm\n0,0.25\n1,0.25\n";
    std::fs::write(folder.path().join("torque.csv"), torque).unwrap();
    let source = Source::load(&path).unwrap();
    assert_eq!(source.folder(), folder.path());
    let campaign = Campaign::new(&source, source.folder(), PROGRAM).unwrap();
    let prepared = campaign.scenario(&campaign.draw(0)).unwrap();
    let excitation = prepared.planes[0].world.excitation.as_ref().unwrap();
    assert_eq!(excitation.at(0.5), 0.25);
}

/// Beside a scenario that was written and run by hand.
#[test]
fn a_row_is_what_its_scenario_gives() {
    with(NOISY, |campaign| {
        let drawn = campaign.draw(2);
        let row = [campaign.run(2, NO_CLOCK).unwrap()];
        let mut changes: Vec<(String, String)> = [
            ("duration_s", "1.0".to_owned()),
            ("world.sensors.theta.noise_rad", "0.001".to_owned()),
            ("world.seed", drawn.seed.unwrap().to_string()),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into();
        for (column, value) in campaign.input_columns().iter().zip(&drawn.values) {
            changes.push((column.name.clone(), value.to_string()));
        }
        let scenario = Scenario::load_with("single-setpoint", &changes).unwrap();
        let prepared = scenario.prepare(Path::new(".")).unwrap();
        let run = &prepared.run(&RunHooks::NONE).unwrap()[0];
        let tilt = run.states().map(|x| x[1].abs()).fold(0.0, f64::max);
        assert_eq!(numbers(campaign, &row, "largest_tilt_rad"), [tilt]);
        let effort: f64 = run.samples.iter().map(|s| s.u[0] * s.u[0]).sum::<f64>() * 0.05;
        assert_eq!(numbers(campaign, &row, "effort_n2m2_s"), [effort]);
        assert_eq!(numbers(campaign, &row, "end_s"), [run.final_time]);
        let rms = numbers(campaign, &row, "rms_torque_nm")[0];
        assert!((rms * rms * run.final_time / effort - 1.0).abs() < 1e-12);
        let success = Cell::Flag(tilt <= 0.5);
        assert_eq!(column(campaign, &row, "success"), [success]);
    });
}

/// By its definition: outside of the band just before, and inside from then on.
#[test]
fn a_run_is_settled_when_it_stays_within_2_percent() {
    let text = "title = \"x\"\nscenario = \"two-setpoints\"\nruns = 1\n";
    with(text, |campaign| {
        let replay = campaign.replay(0, NO_CLOCK).unwrap();
        let settling = numbers(campaign, &[replay.row], "settling_s")[0];
        let trajectory = &replay.record.planes[0].trajectory;
        let times = trajectory.samples.iter().map(|sample| sample.t);
        let times = times.chain([trajectory.final_time]);
        // Back at 0 from the jump at 3 s on, where the reference is 0, too.
        let errors = trajectory.states().map(|x| x[0].abs());
        let after: Vec<(f64, f64)> = times.zip(errors).filter(|(t, _)| *t > 2.999).collect();
        let largest = after
            .iter()
            .fold((0.0, 0.0), |most, at| match at.1 > most.1 {
                true => *at,
                false => most,
            });
        assert!(settling > 0.3 && settling < 1.0, "{settling}");
        let (settled, outside): (Vec<_>, Vec<_>) =
            after.iter().partition(|(t, _)| *t >= largest.0 + settling);
        assert!(settled.iter().all(|(_, error)| *error <= 0.02 * largest.1));
        assert!(outside.last().unwrap().1 > 0.02 * largest.1);
    });
    // Nobody settles on a curve.
    let text = "title = \"x\"\nscenario = \"lissajous\"\nruns = 1\n[set]\nduration_s = 1.0\n";
    with(text, |campaign| {
        let row = rows(campaign);
        assert_eq!(column(campaign, &row, "settling_s"), [Cell::Missing]);
    });
}

/// They used to be left out, so that the worst runs made the quantiles better.
#[test]
fn a_run_that_never_settles_takes_longer_than_all_others() {
    // Of three runs two end before they have settled.
    let text = "title = \"x\"\nscenario = \"single-setpoint\"\n\
        [[vary]]\nkey = \"duration_s\"\ngrid = [4.0, 0.2, 0.1]\n";
    with(text, |campaign| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.parquet");
        write_whole(campaign, &path);
        let cells = column(campaign, &rows(campaign), "settling_s");
        assert_eq!(&cells[1..], [Cell::Missing, Cell::Missing]);
        let file = ballbot_campaign::RowFile::open(&path).unwrap();
        let summary = Summary::of(campaign, &file).unwrap();
        assert_eq!(summary.complete, 3);
        let mut measures = summary.measures.iter();
        let settling = measures.find(|one| one.measure == "settling_s").unwrap();
        assert_eq!(Some(settling.quantile_5), cells[0].number());
        let never = [
            settling.median.value,
            settling.quantile_95,
            settling.largest,
        ];
        assert_eq!(never, [f64::INFINITY; 3]);
    });
}

/// What cannot be is counted apart, where that is asked for.
#[test]
fn draws_that_make_no_scenario_are_counted_apart() {
    // A horizon of 0 samples is none.
    let text = NOISY
        .replace("integers = [10, 30]", "list = [0, 20]")
        .replace("seed = 3", "seed = 3\nrefused = \"count\"");
    with(&text, |campaign| {
        let rows = rows(campaign);
        let horizons = numbers(campaign, &rows, "controller.horizon");
        let outcomes = column(campaign, &rows, "outcome");
        let refused = |cell: &Cell| *cell == Cell::Text("refused".to_owned());
        let both = horizons.iter().zip(&outcomes);
        assert!(
            both.clone()
                .all(|(horizon, outcome)| (*horizon == 0.0) == refused(outcome))
        );
        let count = outcomes.iter().filter(|cell| refused(cell)).count();
        assert!((1..24).contains(&count), "{count}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.parquet");
        write_whole(campaign, &path);
        assert_eq!(read(&path), rows);
        let file = ballbot_campaign::RowFile::open(&path).unwrap();
        let summary = Summary::of(campaign, &file).unwrap();
        assert_eq!((summary.runs, summary.refused), (24, count as u64));
        let ran = 24.0 - count as f64;
        assert_eq!(summary.failure_share.value, summary.failures as f64 / ran);
    });
}
