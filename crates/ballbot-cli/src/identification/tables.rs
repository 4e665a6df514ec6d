//! The tables of an identification, for the screen and for the report.

use crate::table::Table;
use ballbot_identification::{HORIZONS, IdentifiedRobot, OUTPUTS, Parameter, Status};
use lpvmpc_design::NORMAL_95;

/// A table of texts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    /// Column headers, with units.
    pub headers: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

impl Sheet {
    pub(super) fn new(headers: &[&str]) -> Self {
        Self {
            headers: headers.iter().map(|header| (*header).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// For the screen.
    pub fn on_screen(&self) -> Table {
        let mut table = Table::new(self.headers.clone());
        for row in &self.rows {
            table.row(row.clone());
        }
        table
    }
}

/// A value with as many digits as its standard deviation leaves it.
fn rounded(value: f64, deviation: f64) -> String {
    if !(deviation > 0.0 && deviation.is_finite()) {
        return short(value);
    }
    let decimals = (1.0 - deviation.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.decimals$}")
}

/// A number for a cell; "-" where there is none.
fn short(value: f64) -> String {
    match value {
        _ if !value.is_finite() => "-".to_owned(),
        0.0 => "0".to_owned(),
        _ if (1e-4..1e6).contains(&value.abs()) => {
            let decimals = (4.0 - value.abs().log10().floor()).max(0.0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    }
}

/// A number of this many decimals, unless it is so large that they say nothing.
pub(super) fn decimal(value: f64, decimals: usize) -> String {
    if value.abs() < 1e4 {
        format!("{value:.decimals$}")
    } else {
        short(value)
    }
}

/// Text with the plane that it is about, where there are two.
fn in_plane(robot: &IdentifiedRobot, text: &str, plane: usize) -> String {
    match robot.plane_name(plane) {
        Some(name) => format!("{text}, plane {name}"),
        None => text.to_owned(),
    }
}

/// The parameters with standard deviations and 95 % intervals: what the planes share once.
pub fn parameters(robot: &IdentifiedRobot) -> Sheet {
    let mut sheet = Sheet::new(&[
        "parameter",
        "value",
        "std. dev.",
        "95 % interval",
        "unit",
        "",
    ]);
    for (plane, parameter) in robot.variables.all() {
        let identification = &robot.planes[plane];
        let value = identification.estimate.values[parameter];
        let deviation = identification.standard_deviation(parameter);
        let status = identification.estimate.status[parameter];
        let (least, most) = identification.interval(parameter);
        let (deviation_text, interval) = match status {
            Status::Found if !deviation.is_finite() => ("-".to_owned(), "not told".to_owned()),
            Status::Found => (
                rounded(deviation, deviation),
                format!(
                    "{} to {}",
                    rounded(least, deviation),
                    rounded(most, deviation)
                ),
            ),
            Status::Held | Status::AtBound => (String::new(), String::new()),
        };
        sheet.rows.push(vec![
            match robot.variables.is_own(parameter) {
                true => in_plane(robot, parameter.key(), plane),
                false => parameter.key().to_owned(),
            },
            rounded(value, deviation),
            deviation_text,
            interval,
            parameter.unit().to_owned(),
            match status {
                Status::Held => "held",
                Status::Found => "",
                Status::AtBound => "at its bound",
            }
            .to_owned(),
        ]);
    }
    sheet
}

/// The poles with the half-widths of their 95 % intervals: those of planes that move alike once.
pub fn poles(robot: &IdentifiedRobot) -> Sheet {
    let mut sheet = Sheet::new(&["real part [1/s]", "imaginary part [1/s]"]);
    let apart = robot.variables.is_own(Parameter::B3);
    let planes = if apart {
        &robot.planes[..]
    } else {
        &robot.planes[..1]
    };
    if apart {
        sheet.headers.push("plane".to_owned());
    }
    // The integrator of the ball's angle is at zero whatever the parameters are.
    let part = |value: f64, deviation: f64| match rounded(value, deviation) {
        text if deviation > 0.0 => {
            format!("{text} +- {}", rounded(NORMAL_95 * deviation, deviation))
        }
        text => text,
    };
    for (place, plane) in planes.iter().enumerate() {
        for pole in &plane.poles {
            let (re, im) = pole.standard_deviation;
            let mut row = vec![part(pole.value.re, re), part(pole.value.im, im)];
            if let (true, Some(name)) = (apart, robot.plane_name(place)) {
                row.push(name.to_owned());
            }
            sheet.rows.push(row);
        }
    }
    sheet
}

/// Correlations of the parameters that were found.
pub fn correlations(robot: &IdentifiedRobot) -> Sheet {
    let found: Vec<(usize, Parameter)> = robot
        .variables
        .all()
        .filter(|(plane, parameter)| {
            robot.planes[*plane].estimate.status[*parameter] == Status::Found
        })
        .collect();
    let keys: Vec<String> = found
        .iter()
        .map(|(plane, one)| robot.key(*plane, *one))
        .collect();
    let mut sheet = Sheet::new(&[""]);
    sheet.headers.extend(keys.iter().cloned());
    for (row, key) in found.iter().zip(&keys) {
        let entries = found
            .iter()
            .map(|column| decimal(robot.correlation(*row, *column), 2));
        let row = std::iter::once(key.clone()).chain(entries);
        sheet.rows.push(row.collect());
    }
    sheet
}

/// The residuals against the noise of the sensors.
pub fn residuals(robot: &IdentifiedRobot) -> Sheet {
    let mut sheet = Sheet::new(&[
        "output",
        "residual (rms)",
        "noise of the sensor",
        "ratio",
        "autocorrelation beyond its bound",
        "largest, at lag",
        "white",
    ]);
    let planes = robot.planes.iter().enumerate();
    let all = planes.flat_map(|(plane, identification)| {
        let outputs = OUTPUTS.iter().zip(&identification.residuals);
        outputs.map(move |(output, residual)| (in_plane(robot, output, plane), residual))
    });
    for (output, residual) in all {
        let (lag, largest) = residual.autocorrelation.largest();
        sheet.rows.push(vec![
            output,
            format!("{:.3e}", residual.spread),
            format!("{:.3e}", residual.floor),
            decimal(residual.normalised(), 2),
            format!("{:.0} %", 100.0 * residual.autocorrelation.exceeding()),
            format!("{largest:.3}, {lag}"),
            if residual.is_white() { "yes" } else { "no" }.to_owned(),
        ]);
    }
    sheet
}

/// Structures of friction on held-back data.
pub fn structures(robot: &IdentifiedRobot) -> Sheet {
    let mut headers = vec![
        "friction".to_owned(),
        "chi^2, fitted".to_owned(),
        "chi^2, held back".to_owned(),
    ];
    headers.extend(HORIZONS.map(|horizon| format!("tilt error over {horizon} s [mrad]")));
    let planes = robot.planes.iter().enumerate();
    let all = planes.flat_map(|(plane, one)| one.structures.iter().map(move |one| (plane, one)));
    let rows = all.map(|(plane, compared)| {
        let mut row = vec![
            in_plane(robot, compared.structure.words(), plane),
            decimal(compared.fitted_chi_square, 3),
            decimal(compared.validation.chi_square, 3),
        ];
        let errors = compared.validation.errors.iter();
        row.extend(errors.map(|error| decimal(1e3 * error[1], 2)));
        row
    });
    Sheet {
        headers,
        rows: rows.collect(),
    }
}
