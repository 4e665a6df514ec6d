//! How the points of the inputs are laid out.

use crate::with;
use ballbot_campaign::Campaign;
use std::path::Path;

/// Two inputs on the unit interval, 64 runs.
fn campaign_of(design: &str) -> String {
    format!(
        "title = \"Layout\"\nscenario = \"single-setpoint\"\nruns = 64\ndesign = \"{design}\"\n\
         [[vary]]\nkey = \"initial_state.theta_rad\"\nuniform = [0.0, 1.0]\n\
         [[vary]]\nkey = \"initial_state.phi_rad\"\nuniform = [0.0, 1.0]\n"
    )
}

fn points(campaign: &Campaign<'_, &Path>) -> Vec<[f64; 2]> {
    let point = |run| {
        let values = campaign.draw(run).values;
        [0, 1].map(|i: usize| values[i].as_float().unwrap())
    };
    (0..campaign.runs()).map(point).collect()
}

/// How many points are in each of so many columns and rows.
fn counts(points: &[[f64; 2]], columns: usize, rows: usize) -> Vec<usize> {
    let mut counts = vec![0; columns * rows];
    for [x, y] in points {
        counts[(x * columns as f64) as usize * rows + (y * rows as f64) as usize] += 1;
    }
    counts
}

/// Each interval of a 2^m-th has one of 2^m points, and so has each box of the first two dimensions
/// whose volume is that: (0, m, 2)-nets (Sobol 1967).
#[test]
fn a_sobol_sequence_fills_all_boxes_evenly() {
    with(&campaign_of("sobol"), |campaign| {
        let points = points(campaign);
        for (columns, rows) in [(64, 1), (32, 2), (16, 4), (8, 8), (4, 16), (2, 32), (1, 64)] {
            assert_eq!(
                counts(&points, columns, rows),
                vec![1; 64],
                "{columns} x {rows}"
            );
        }
    });
}

#[test]
fn a_latin_hypercube_has_one_point_in_each_row_and_column() {
    with(&campaign_of("latin_hypercube"), |campaign| {
        let points = points(campaign);
        assert_eq!(counts(&points, 64, 1), [1; 64]);
        assert_eq!(counts(&points, 1, 64), [1; 64]);
        // The two are not in the same order.
        let alike = points
            .iter()
            .filter(|[x, y]| (x - y).abs() < 1.0 / 64.0)
            .count();
        assert!(alike < 10, "{alike}");
    });
}

#[test]
fn random_points_are_not_even() {
    with(&campaign_of("random"), |campaign| {
        assert_ne!(counts(&points(campaign), 64, 1), [1; 64]);
    });
}

/// All combinations, each as often; what is drawn beside them is laid out anew at each.
#[test]
fn grids_are_combined() {
    let text = "title = \"Grid\"\nscenario = \"single-setpoint\"\nruns = 48\ndesign = \"sobol\"\n\
                [[vary]]\nkey = \"controller.horizon\"\ngrid = [10, 20, 30]\n\
                [[vary]]\nkey = \"initial_state.theta_rad\"\nuniform = [0.0, 1.0]\n\
                [[vary]]\nkey = \"controller.r\"\nrange = { from = 0.1, to = 0.4, points = 2 }\n";
    with(text, |campaign| {
        let rows: Vec<_> = (0..48).map(|run| campaign.draw(run)).collect();
        let cells: Vec<_> = rows
            .iter()
            .map(|drawn| campaign.drawn_cells(drawn))
            .collect();
        let at = |run: usize, input: usize| cells[run][input + 1].number().unwrap();
        let mut combinations: Vec<[u64; 2]> = (0..48)
            .map(|run| [at(run, 0), at(run, 2)].map(f64::to_bits))
            .collect();
        combinations.sort_unstable();
        combinations.dedup();
        assert_eq!(combinations.len(), 6);
        for point in 0..6 {
            let eighths = (0..8).map(|repeat| (8.0 * at(6 * repeat + point, 1)) as usize);
            let mut eighths: Vec<usize> = eighths.collect();
            eighths.sort_unstable();
            assert_eq!(eighths, [0, 1, 2, 3, 4, 5, 6, 7]);
        }
    });
    let uneven = text.replace("runs = 48", "runs = 50");
    let (_folder, path) = crate::written(&uneven);
    let source = ballbot_campaign::Source::load(&path).unwrap();
    let refused = Campaign::new(&source, source.folder(), "test").unwrap_err();
    assert!(refused.to_string().contains("multiple"), "{refused}");
    let alone = text.replace("runs = 48\n", "");
    assert_eq!(with(&alone, |campaign| campaign.runs()), 6);
}

/// Robots from the covariance of an identification, by a seed for each run.
#[test]
fn robots_are_drawn_from_a_covariance() {
    let robot = "[parameters]\nb1_m2 = 0.0294\nb2_m2 = 0.01\nb3_m2 = 0.1487\nb4_m2_s = 0.01\n\
        centre_of_mass_m = 0.2978\nball_radius_m = 0.12\nwheel_radius_m = 0.05\ngravity_m_s2 = 9.81\n\
        [identification.torque_gain_1_kg]\nvalue = 1.0\n\
        [identification.covariance]\nparameters = [\"b1_m2\", \"b2_m2\"]\n\
        matrix = [[1e-7, 0.0], [0.0, 1e-8]]\n";
    let (folder, path) = crate::written(
        "title = \"Robots\"\nscenario = \"loop.toml\"\nruns = 20\n\
         [[vary]]\nkey = \"world.draw\"\nseeds = true\n",
    );
    let scenario = ballbot_scenario::builtin::find("single-setpoint")
        .unwrap()
        .text;
    let (start, rest) = scenario.split_once("[parameters]").unwrap();
    let after = rest.find("\n[").unwrap();
    // The first line of a file that is in no table.
    let scenario = format!("parameters = \"robot.toml\"\n{start}{}", &rest[after..]);
    std::fs::write(folder.path().join("loop.toml"), scenario).unwrap();
    std::fs::write(folder.path().join("robot.toml"), robot).unwrap();
    let source = ballbot_campaign::Source::load(&path).unwrap();
    let campaign = Campaign::new(&source, source.folder(), "test").unwrap();
    let b1 = (0..20).map(|run| {
        let prepared = campaign.scenario(&campaign.draw(run)).unwrap();
        prepared.planes[0].world.robot.mechanics.ballbot.b1
    });
    let b1: Vec<f64> = b1.collect();
    let mean = b1.iter().sum::<f64>() / 20.0;
    let deviation = (b1.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / 19.0).sqrt();
    // 3.16e-4, four standard deviations of it wide.
    assert!(
        (deviation / 1e-7_f64.sqrt() - 1.0).abs() < 0.65,
        "{deviation}"
    );
    // The file is part of what the results are of.
    let before = campaign.fingerprint().to_owned();
    std::fs::write(
        folder.path().join("robot.toml"),
        robot.replace("0.0294", "0.0295"),
    )
    .unwrap();
    let campaign = Campaign::new(&source, source.folder(), "test").unwrap();
    assert_ne!(campaign.fingerprint(), before);
}
