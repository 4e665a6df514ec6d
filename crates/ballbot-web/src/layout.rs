//! What stands where in the rows of numbers that the page reads.
//!
//! The page's side of it is `web/src/layout.ts`: a test makes its text from here and compares.

use lpvmpc_sim::Sample;

/// One number of a row that is made of an `S`.
pub struct Column<S> {
    #[cfg(test)]
    name: &'static str,
    #[cfg(test)]
    unit: &'static str,
    value: fn(&S) -> f64,
}

impl<S> Column<S> {
    #[cfg_attr(not(test), allow(unused_variables, reason = "the page has the names"))]
    const fn new(name: &'static str, unit: &'static str, value: fn(&S) -> f64) -> Self {
        Self {
            #[cfg(test)]
            name,
            #[cfg(test)]
            unit,
            value,
        }
    }
}

/// The row of `source`.
pub fn row<S>(columns: &[Column<S>], source: &S) -> impl Iterator<Item = f64> {
    columns.iter().map(|column| (column.value)(source))
}

/// A plane now.
pub struct Now {
    pub time: f64,
    pub state: [f64; 4],
    pub phi_reference: f64,
}

/// One sample in one plane.
pub const ROW: [Column<Sample<4, 1>>; 14] = [
    Column::new("time", "s", |sample| sample.t),
    Column::new("phi", "rad", |sample| sample.x[0]),
    Column::new("theta", "rad", |sample| sample.x[1]),
    Column::new("phiDot", "rad/s", |sample| sample.x[2]),
    Column::new("thetaDot", "rad/s", |sample| sample.x[3]),
    Column::new("torque", "N m", |sample| sample.u[0]),
    Column::new("phiReference", "rad", |sample| sample.x_ref[0]),
    Column::new("cost", "1", |sample| sample.cost),
    Column::new("activeBounds", "count", |sample| {
        sample.active_bounds as f64
    }),
    Column::new("stepMicroseconds", "us", |sample| {
        sample.step_time.as_secs_f64() * 1e6
    }),
    Column::new("estimatePhi", "rad", |sample| sample.estimate[0]),
    Column::new("estimateTheta", "rad", |sample| sample.estimate[1]),
    Column::new("estimatePhiDot", "rad/s", |sample| sample.estimate[2]),
    Column::new("estimateThetaDot", "rad/s", |sample| sample.estimate[3]),
];

/// The state now, in one plane.
pub const NOW: [Column<Now>; 6] = [
    Column::new("time", "s", |now| now.time),
    Column::new("phi", "rad", |now| now.state[0]),
    Column::new("theta", "rad", |now| now.state[1]),
    Column::new("phiDot", "rad/s", |now| now.state[2]),
    Column::new("thetaDot", "rad/s", |now| now.state[3]),
    Column::new("phiReference", "rad", |now| now.phi_reference),
];

#[cfg(test)]
mod tests {
    use super::{Column, NOW, ROW};
    use crate::Simulation;
    use ballbot_scenario::{Scenario, Session};
    use std::path::Path;
    use std::time::Duration;

    fn constants<S>(name: &str, meaning: &str, columns: &[Column<S>]) -> String {
        let entries: String = columns
            .iter()
            .enumerate()
            .map(|(place, Column { name, unit, .. })| {
                format!("  /** Unit: {unit}. */\n  {name}: {place},\n")
            })
            .collect();
        format!(
            "\n/** {meaning} */\nexport const {name} = {{\n{entries}}} as const;\n\
             export const {name}_WIDTH = {};\n",
            columns.len()
        )
    }

    /// The page's side: what `web/src/layout.ts` must be.
    fn typescript() -> String {
        let head = "// What stands where in the rows of numbers that the WebAssembly module hands out. The text of this\n\
                    // file comes from crates/ballbot-web/src/layout.rs; `cargo test -p ballbot-web` compares them, and\n\
                    // prints the file as it must be.\n";
        let row = constants("ROW", "Columns of a row: one sample in one plane.", &ROW);
        let now = constants("NOW", "Columns of the state now, in one plane.", &NOW);
        format!("{head}{row}{now}")
    }

    #[test]
    fn the_page_reads_what_is_written() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/src/layout.ts");
        let found = std::fs::read_to_string(path).unwrap();
        let expected = typescript();
        assert!(
            found == expected,
            "web/src/layout.ts is not what this crate writes. It must be:\n\n{expected}"
        );
    }

    /// Every number stands in the column that bears its name, in both planes.
    #[test]
    fn columns_hold_what_they_are_called() {
        let scenario = Scenario::load("lissajous").unwrap();
        let session = Session::new(scenario.prepare(Path::new(".")).unwrap()).unwrap();
        let mut simulation = Simulation { session };
        for tick in 0..5 {
            let clock = || Duration::from_millis(tick);
            assert!(simulation.session.step(&clock));
        }
        let (rows, now) = (simulation.row(), simulation.now());
        let session = &simulation.session;
        assert_eq!(rows.len(), 2 * ROW.len());
        assert_eq!(now.len(), 2 * NOW.len());
        let place = |name: &str| ROW.iter().position(|column| column.name == name).unwrap();
        let of_now = |name: &str| NOW.iter().position(|column| column.name == name).unwrap();
        let states: Vec<_> = session.states().collect();
        let targets: Vec<_> = session.targets().collect();
        for (plane, sample) in session.samples().iter().enumerate() {
            let row = &rows[plane * ROW.len()..][..ROW.len()];
            for (name, value) in [
                ("time", sample.t),
                ("phi", sample.x[0]),
                ("theta", sample.x[1]),
                ("phiDot", sample.x[2]),
                ("thetaDot", sample.x[3]),
                ("torque", sample.u[0]),
                ("phiReference", sample.x_ref[0]),
                ("cost", sample.cost),
                ("activeBounds", sample.active_bounds as f64),
                ("stepMicroseconds", sample.step_time.as_secs_f64() * 1e6),
                ("estimatePhi", sample.estimate[0]),
                ("estimateTheta", sample.estimate[1]),
                ("estimatePhiDot", sample.estimate[2]),
                ("estimateThetaDot", sample.estimate[3]),
            ] {
                assert_eq!(row[place(name)], value, "{name}");
            }
            let now = &now[plane * NOW.len()..][..NOW.len()];
            for (name, value) in [
                ("time", session.time()),
                ("phi", states[plane][0]),
                ("theta", states[plane][1]),
                ("phiDot", states[plane][2]),
                ("thetaDot", states[plane][3]),
                ("phiReference", targets[plane]),
            ] {
                assert_eq!(now[of_now(name)], value, "{name}");
            }
        }
    }
}
