//! What a scenario asks for after its end.

use crate::file::schema::{ReferenceTable, Scenario};
use crate::prepare::prepared::Prepared;

impl Scenario {
    /// Pushes from the end of the run on, and set points that not even its last plan looks at: their keys with their
    /// times in s.
    pub fn too_late(&self, run: &Prepared) -> Vec<(String, f64)> {
        let end = run.end();
        let seen = end + run.settings.horizon as f64 * run.settings.t_s + run.feedback.delay;
        let pushes = self.world.iter().flat_map(|world| world.pushes.iter());
        let pushes = pushes.enumerate().map(|(i, push)| {
            let (key, time) = push.beginning();
            (format!("world.pushes[{i}].{key}"), time)
        });
        let mut late: Vec<(String, f64)> = pushes.filter(|(_, time)| *time >= end).collect();
        late.extend(self.reference.set_points_after(seen, "reference"));
        late
    }
}

impl ReferenceTable {
    /// Only set points: a point of lines or of least jerk decides about the way to it.
    fn set_points_after(&self, time: f64, key: &str) -> Vec<(String, f64)> {
        match self {
            Self::SetPoints { points } => {
                let points = points.iter().enumerate();
                let late = points.filter(|(_, point)| point.time_s > time);
                let key = |i| format!("{key}.set_points.points[{i}].time_s");
                late.map(|(i, point)| (key(i), point.time_s)).collect()
            }
            Self::Planes { x, y } => {
                let mut late = x.set_points_after(time, &format!("{key}.planes.x"));
                late.extend(y.set_points_after(time, &format!("{key}.planes.y")));
                late
            }
            _ => Vec::new(),
        }
    }
}
