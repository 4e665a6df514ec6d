//! What phi has to follow, ready to be asked at any time.

use crate::error::ScenarioError;
use crate::file::schema::{LissajousTable, PointTable, ReferenceTable, SineTable};
use crate::number::finite;
use crate::prepare::files::Files;
use crate::prepare::time_series::SAME_TIME;
use ballbot::Geometry;
use lpvmpc::{MoveLimits, SmoothMove};

/// phi_ref(t) of one plane, rad.
#[derive(Clone, Debug, PartialEq)]
pub enum PhiReference {
    /// Steps: each set point holds from its time on, the first one from the beginning.
    Steps(Vec<PointTable>),
    /// A sine wave.
    Sine(SineTable),
    /// Minimum-jerk moves between points; the ends hold.
    MinimumJerk(Vec<PointTable>),
    /// Straight lines between points; the ends hold.
    Interpolated(Vec<PointTable>),
    /// Set points as smooth moves one after the other, each with the time of its beginning, s.
    Moves(Vec<(f64, SmoothMove<f64>)>),
}

impl PhiReference {
    /// phi_ref at the time `t` (s), rad.
    pub fn at(&self, t: f64) -> f64 {
        match self {
            Self::Steps(points) => {
                let reached = points.iter().rev().find(|p| p.time_s <= t + SAME_TIME);
                reached.or(points.first()).map_or(0.0, |p| p.phi_rad)
            }
            Self::Sine(sine) => {
                let angle = sine.angular_frequency_rad_s * t + sine.phase_rad;
                sine.offset_rad + sine.amplitude_rad * angle.sin()
            }
            Self::MinimumJerk(points) => between(points, t, minimum_jerk),
            Self::Moves(moves) => {
                let begun = moves
                    .iter()
                    .rev()
                    .find(|(begin, _)| *begin <= t + SAME_TIME);
                match (begun, moves.first()) {
                    (Some((begin, planned)), _) => planned.at(t - begin).position,
                    (None, Some((_, first))) => first.from,
                    (None, None) => 0.0,
                }
            }
            Self::Interpolated(points) => between(points, t, |fraction| fraction),
        }
    }

    /// The times at which its pieces begin and end, s, in order. It rests before the first and after
    /// the last; what never rests is one piece, from zero to `end`.
    pub fn knots(&self, end: f64) -> Vec<f64> {
        match self {
            Self::Sine(_) => vec![0.0, end],
            Self::Steps(points) | Self::MinimumJerk(points) | Self::Interpolated(points) => {
                points.iter().map(|point| point.time_s).collect()
            }
            Self::Moves(moves) => moves
                .iter()
                .flat_map(|(begin, planned)| [*begin, begin + planned.duration])
                .collect(),
        }
    }

    /// The goal in rad of the shaped move that is under way at the time `t` (s), if one is.
    pub fn on_its_way_to(&self, t: f64) -> Option<f64> {
        let Self::Moves(moves) = self else {
            return None;
        };
        let is_under_way = |(begin, planned): &&(f64, SmoothMove<f64>)| {
            *begin < t - SAME_TIME && t < begin + planned.duration - SAME_TIME
        };
        let under_way = moves.iter().find(is_under_way);
        under_way.map(|(_, planned)| planned.to)
    }

    /// Steps become smooth moves within `limits`; other references stay what they are. A set
    /// point that comes while a move is under way waits for its end.
    pub(crate) fn shaped(self, limits: MoveLimits<f64>) -> Self {
        let Self::Steps(points) = self else {
            return self;
        };
        let Some(first) = points.first() else {
            return Self::Steps(points);
        };
        let (mut from, mut free) = (first.phi_rad, first.time_s);
        let moves = points.iter().map(|point| {
            let planned = SmoothMove::within(from, point.phi_rad, limits);
            let begin = point.time_s.max(free);
            (from, free) = (point.phi_rad, begin + planned.duration);
            (begin, planned)
        });
        Self::Moves(moves.collect())
    }

    /// Makes `point` the goal from its time on: at once, or within `limits` by a smooth move that
    /// begins when the one under way has ended. What was to come later is dropped; says how many
    /// moves.
    pub(crate) fn redirect(&mut self, point: PointTable, limits: Option<MoveLimits<f64>>) -> usize {
        let Some(limits) = limits else {
            *self = Self::Steps(vec![point]);
            return 0;
        };
        let now = point.time_s;
        let (mut from, mut free) = (self.at(now), now);
        let begun = |(begin, _): &(f64, _)| *begin < now - SAME_TIME;
        let (under_way, dropped) = match self {
            Self::Moves(moves) => {
                let under_way = moves.iter().copied().rfind(begun);
                (
                    under_way,
                    moves.iter().filter(|planned| !begun(planned)).count(),
                )
            }
            _ => (None, 0),
        };
        if let Some((begin, planned)) = under_way {
            (from, free) = (planned.to, now.max(begin + planned.duration));
        }
        let planned = SmoothMove::within(from, point.phi_rad, limits);
        *self = Self::Moves(under_way.into_iter().chain([(free, planned)]).collect());
        dropped
    }
}

/// The position of the move from 0 to 1 in 1 s.
fn minimum_jerk(fraction: f64) -> f64 {
    let unit = SmoothMove {
        from: 0.0,
        to: 1.0,
        duration: 1.0,
    };
    unit.at(fraction).position
}

fn between(points: &[PointTable], t: f64, shape: impl Fn(f64) -> f64) -> f64 {
    let after = points.partition_point(|p| p.time_s <= t);
    match (
        after.checked_sub(1).and_then(|i| points.get(i)),
        points.get(after),
    ) {
        (Some(from), Some(to)) => {
            let fraction = (t - from.time_s) / (to.time_s - from.time_s);
            from.phi_rad + (to.phi_rad - from.phi_rad) * shape(fraction)
        }
        (Some(end), None) | (None, Some(end)) => end.phi_rad,
        (None, None) => 0.0,
    }
}

/// The references of one plane or two.
pub(crate) fn resolve(
    table: &ReferenceTable,
    geometry: &Geometry<f64>,
    duration: f64,
    files: &dyn Files,
) -> Result<Vec<PhiReference>, ScenarioError> {
    match table {
        ReferenceTable::Lissajous(curve) => lissajous(curve, geometry),
        ReferenceTable::Planes { x, y } => Ok(vec![
            one_plane(x, "reference.planes.x", duration, files)?,
            one_plane(y, "reference.planes.y", duration, files)?,
        ]),
        single => Ok(vec![one_plane(single, "reference", duration, files)?]),
    }
}

fn one_plane(
    table: &ReferenceTable,
    key: &str,
    duration: f64,
    files: &dyn Files,
) -> Result<PhiReference, ScenarioError> {
    match table {
        ReferenceTable::SetPoints { points } => {
            check_points(points, &format!("{key}.set_points.points"))?;
            Ok(PhiReference::Steps(points.clone()))
        }
        ReferenceTable::MinimumJerk { points } => {
            check_points(points, &format!("{key}.minimum_jerk.points"))?;
            Ok(PhiReference::MinimumJerk(points.clone()))
        }
        ReferenceTable::Lines { points } => {
            check_points(points, &format!("{key}.lines.points"))?;
            Ok(PhiReference::Interpolated(points.clone()))
        }
        ReferenceTable::Sine(sine) => {
            for (name, value) in [
                ("amplitude_rad", sine.amplitude_rad),
                ("angular_frequency_rad_s", sine.angular_frequency_rad_s),
                ("phase_rad", sine.phase_rad),
                ("offset_rad", sine.offset_rad),
            ] {
                finite(&format!("{key}.sine.{name}"), value)?;
            }
            Ok(PhiReference::Sine(*sine))
        }
        ReferenceTable::Csv(file) => {
            Ok(PhiReference::Interpolated(files.reference(file, duration)?))
        }
        ReferenceTable::Lissajous(_) | ReferenceTable::Planes { .. } => Err(ScenarioError::value(
            key,
            "a reference of two planes",
            "one plane takes set_points, sine, minimum_jerk, lines or csv",
        )),
    }
}

fn lissajous(
    curve: &LissajousTable,
    geometry: &Geometry<f64>,
) -> Result<Vec<PhiReference>, ScenarioError> {
    let axes = [
        (
            "x",
            curve.amplitude_x_m,
            curve.angular_frequency_x_rad_s,
            curve.phase_x_rad,
        ),
        (
            "y",
            curve.amplitude_y_m,
            curve.angular_frequency_y_rad_s,
            curve.phase_y_rad,
        ),
    ];
    let mut planes = Vec::with_capacity(axes.len());
    for (axis, amplitude, frequency, phase) in axes {
        finite(
            &format!("reference.lissajous.amplitude_{axis}_m"),
            amplitude,
        )?;
        finite(
            &format!("reference.lissajous.angular_frequency_{axis}_rad_s"),
            frequency,
        )?;
        finite(&format!("reference.lissajous.phase_{axis}_rad"), phase)?;
        planes.push(PhiReference::Sine(SineTable {
            amplitude_rad: geometry.ball_angle(amplitude),
            angular_frequency_rad_s: frequency,
            phase_rad: phase,
            offset_rad: 0.0,
        }));
    }
    Ok(planes)
}

fn check_points(points: &[PointTable], key: &str) -> Result<(), ScenarioError> {
    if points.is_empty() {
        return Err(ScenarioError::value(
            key,
            "[]",
            "at least one point is needed",
        ));
    }
    for (i, point) in points.iter().enumerate() {
        finite(&format!("{key}[{i}].time_s"), point.time_s)?;
        finite(&format!("{key}[{i}].phi_rad"), point.phi_rad)?;
        if i > 0 && point.time_s <= points[i - 1].time_s {
            return Err(ScenarioError::value(
                format!("{key}[{i}].time_s"),
                point.time_s,
                format!(
                    "times must increase; the point before is at {} s",
                    points[i - 1].time_s
                ),
            ));
        }
    }
    Ok(())
}
