//! Parallel coordinates: each case a line over its numbers.

use lpvmpc_figures::{Dash, Figure, Panel, Role, Series, Style};

/// A coordinate.
pub struct Coordinate {
    /// Its name, for the legend.
    pub name: String,
    /// Its value in each case.
    pub values: Vec<f64>,
    /// Whether equal distances are equal ratios.
    pub is_logarithmic: bool,
}

/// Cases that look alike.
pub struct Kind {
    /// Their name in the legend.
    pub label: String,
    /// Their colour.
    pub role: Role,
    /// Which cases they are.
    pub cases: Vec<usize>,
}

/// Each case a line over its coordinates, from the smallest value of each that is shown to the largest;
/// the last kind in front.
pub fn figure(title: &str, x_label: &str, coordinates: &[Coordinate], kinds: &[Kind]) -> Figure {
    let scaled = |coordinate: &Coordinate, value: f64| match coordinate.is_logarithmic {
        true => value.ln(),
        false => value,
    };
    let range = |coordinate: &Coordinate| {
        let shown = kinds.iter().flat_map(|kind| &kind.cases);
        let shown = shown.map(|case| coordinate.values[*case]);
        let shown = shown.filter(|value| value.is_finite());
        shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        })
    };
    let ranges: Vec<(f64, f64)> = coordinates.iter().map(range).collect();
    let style = Style::Line(Dash::Solid);
    let lines = |kind: &Kind| {
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for case in &kind.cases {
            for (place, (coordinate, (low, high))) in coordinates.iter().zip(&ranges).enumerate() {
                let [value, low, high] =
                    [coordinate.values[*case], *low, *high].map(|value| scaled(coordinate, value));
                x.push(place as f64 + 1.0);
                // One value in all cases is in the middle.
                y.push(if high > low {
                    (value - low) / (high - low)
                } else {
                    0.5
                });
            }
            x.push(coordinates.len() as f64);
            y.push(f64::NAN);
        }
        Series::new(&kind.label, &x, &y, style, kind.role)
    };
    let mut series: Vec<Series> = kinds.iter().map(lines).collect();
    for (place, (coordinate, (low, high))) in coordinates.iter().zip(&ranges).enumerate() {
        let place = place as f64 + 1.0;
        let scale = if coordinate.is_logarithmic {
            ", logarithmic"
        } else {
            ""
        };
        let [low, high] = [*low, *high].map(short);
        let label = format!("{place}: {} from {low} to {high}{scale}", coordinate.name);
        series.push(Series::new(
            &label,
            &[place, place],
            &[0.0, 1.0],
            style,
            Role::Reference,
        ));
    }
    let mut panel = Panel::new(x_label, "from its smallest value to its largest", series);
    panel.x_range = Some((0.8, coordinates.len() as f64 + 0.2));
    panel.y_range = Some((-0.03, 1.03));
    Figure {
        title: title.to_owned(),
        panels: vec![panel],
        columns: 1,
        width: 900.0,
        height: 560.0,
    }
}

/// A number in four digits, without zeros at its end.
fn short(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}
