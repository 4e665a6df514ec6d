//! What the program has written, read again.

use std::path::Path;

/// The columns of every trajectory.
const COLUMNS: &str = "t_s,phi_rad,theta_rad,phi_dot_rad_s,theta_dot_rad_s,torque_nm,\
                       phi_ref_rad,cost,status,step_us,\
                       gap_phi_rad,gap_theta_rad,gap_phi_dot_rad_s,gap_theta_dot_rad_s,\
                       decision,artificial_set_point_rad";

/// One sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub t: f64,
    pub state: [f64; 4],
    pub torque: f64,
    pub reference: f64,
    pub cost: f64,
}

/// The last row.
#[derive(Clone, Debug, PartialEq)]
pub struct End {
    pub t: f64,
    pub state: [f64; 4],
    pub reference: f64,
    /// Why the run ended early; nothing otherwise.
    pub status: String,
}

fn cells(line: &str) -> [&str; 16] {
    let cells: Vec<&str> = line.split(',').collect();
    cells.try_into().unwrap()
}

fn number(cell: &str) -> f64 {
    let value: f64 = cell.parse().unwrap();
    assert!(value.is_finite(), "{cell}");
    value
}

/// A trajectory file: its samples, each solved, and its last row, which has no torque.
pub fn trajectory(path: &Path) -> (Vec<Row>, End) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.remove(0), COLUMNS);
    let [
        t,
        phi,
        theta,
        phi_dot,
        theta_dot,
        torque,
        reference,
        cost,
        status,
        step,
        gap @ ..,
        _decision,
        _set_point,
    ] = cells(lines.pop().unwrap());
    assert_eq!(
        ([torque, cost, step], gap),
        ([""; 3], [""; 4]),
        "the last row is a state alone"
    );
    let end = End {
        t: number(t),
        state: [phi, theta, phi_dot, theta_dot].map(number),
        reference: number(reference),
        status: status.to_owned(),
    };
    let rows = lines.into_iter().map(|line| {
        let [
            t,
            phi,
            theta,
            phi_dot,
            theta_dot,
            torque,
            reference,
            cost,
            status,
            step,
            gap @ ..,
            decision,
            set_point,
        ] = cells(line);
        let _: [f64; 4] = gap.map(number);
        assert_eq!(decision.is_empty(), set_point.is_empty());
        let plans = ["solved", "converged", "improved", "no improvement found"];
        assert!(plans.contains(&status), "{status}");
        assert!(number(step) >= 0.0);
        Row {
            t: number(t),
            state: [phi, theta, phi_dot, theta_dot].map(number),
            torque: number(torque),
            reference: number(reference),
            cost: number(cost),
        }
    });
    (rows.collect(), end)
}

/// A complete run of so many samples of `t_s`: its rows and its last state.
pub fn complete(path: &Path, samples: usize, t_s: f64) -> (Vec<Row>, [f64; 4]) {
    let (rows, end) = trajectory(path);
    assert_eq!(rows.len(), samples, "{}", path.display());
    for (k, row) in rows.iter().enumerate() {
        assert!((row.t - k as f64 * t_s).abs() < 1e-9);
    }
    assert!((end.t - samples as f64 * t_s).abs() < 1e-9);
    assert_eq!(end.status, "", "the run was complete");
    (rows, end.state)
}

/// The three motors' torques with their times.
pub fn motors(path: &Path) -> Vec<(f64, [f64; 3])> {
    let text = std::fs::read_to_string(path).unwrap();
    let (header, lines) = text.split_once('\n').unwrap();
    assert_eq!(
        header,
        "t_s,motor_1_nm,motor_2_nm,motor_3_nm,heading_rad,heading_ref_rad"
    );
    let rows = lines.lines().map(|line| {
        let cells: Vec<f64> = line.split(',').map(number).collect();
        let [t, first, second, third, _, _] = cells.try_into().unwrap();
        (t, [first, second, third])
    });
    rows.collect()
}

/// An SVG that can be parsed, and beside it a PNG of the same shape.
pub fn assert_figure(folder: &Path, name: &str) {
    let svg = std::fs::read_to_string(folder.join(format!("{name}.svg"))).unwrap();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let root = document.root_element();
    assert_eq!(root.tag_name().name(), "svg", "{name}");
    let view: Vec<f64> = root
        .attribute("viewBox")
        .unwrap()
        .split(' ')
        .map(number)
        .collect();
    let mut drawn = document.descendants().map(|node| node.tag_name().name());
    assert!(
        drawn.any(|name| name == "path" || name == "polyline"),
        "{name}"
    );

    let png = std::fs::read(folder.join(format!("{name}.png"))).unwrap();
    assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n", "{name}");
    assert_eq!(png[12..16], *b"IHDR", "{name}");
    let size = |from: usize| f64::from(u32::from_be_bytes(png[from..from + 4].try_into().unwrap()));
    let (width, height) = (size(16), size(20));
    assert!(width >= view[2], "{name}: {width} pixels for {}", view[2]);
    let (shape, drawn) = (view[2] / view[3], width / height);
    assert!(
        (shape / drawn - 1.0).abs() < 1e-2,
        "{name}: {drawn} for {shape}"
    );
}
