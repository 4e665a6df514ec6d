//! The figures of a tuning: its Pareto front, its candidates, how the search went, before and after.

use crate::html::CaptionedFigure;
use crate::parallel_figure::{self, Coordinate, Kind};
use ballbot_campaign::Axis;
use ballbot_tuning::{Comparison, Found, Judge, State};
use lpvmpc_figures::{Dash, Figure, Panel, Role, Series, Style};

/// What all figures are drawn from.
pub struct Drawn<'a> {
    /// Title of the tuning.
    pub title: &'a str,
    /// Goals and limits.
    pub judge: &'a Judge,
    /// What is searched over.
    pub axes: &'a [Axis],
    /// What was found.
    pub found: &'a Found,
    /// The values of the candidates as numbers, axis by axis; NaN where they are none.
    pub values: &'a [Vec<f64>],
}

/// Candidates beside the front in parallel coordinates; more cover each other.
const LINES: usize = 40;
/// Candidates of the front there, evenly from all.
const FRONT_LINES: usize = 12;
/// Least distance of markers on the front, as a share of the view: closer ones hide each other.
const APART: f64 = 0.02;
/// Goals below this are zero in a figure.
const SMALLEST: f64 = 1e-200;
const START: Role = Role::Linear;
const CHOSEN: Role = Role::RungeKutta;
const FRONT: Role = Role::Lpv;
const OTHERS: Role = Role::Member(2);

impl Drawn<'_> {
    /// All figures that there is something for.
    pub fn all(&self, comparisons: &[Comparison]) -> Vec<CaptionedFigure> {
        let mut figures = Vec::new();
        if self.judge.goals.len() > 1 {
            figures.push(self.front());
        }
        figures.push(self.parallel());
        figures.push(self.progress());
        figures.extend(self.pairs(comparisons));
        figures
    }

    fn goal(&self, candidate: usize, goal: usize) -> f64 {
        self.found.candidates[candidate].judged().goals[goal]
    }

    /// Candidates that were run in all worlds, by whether they keep all limits.
    fn whole(&self, keep: bool) -> Vec<usize> {
        let all = self
            .found
            .candidates
            .iter()
            .zip(&self.found.outcomes)
            .enumerate();
        let whole = all.filter(|(_, (entry, outcome))| {
            entry.state == State::Whole && (outcome.violation == 0.0) == keep
        });
        whole.map(|(place, _)| place).collect()
    }

    /// Each pair of goals against each other.
    fn front(&self) -> CaptionedFigure {
        let goals = self.judge.goals.len();
        let pairs = (0..goals).flat_map(|x| (x + 1..goals).map(move |y| (x, y)));
        let panels: Vec<Panel> = pairs.map(|(x, y)| self.front_panel(x, y)).collect();
        let columns = panels.len().min(2);
        CaptionedFigure {
            name: "front",
            caption: "Candidates that keep all limits, and those among them that no other one is \
                      better than in all goals: the Pareto front of everything that was evaluated."
                .to_owned(),
            figure: Figure {
                title: self.title.to_owned(),
                width: if columns == 1 { 720.0 } else { 1000.0 },
                height: 80.0 + 440.0 * panels.len().div_ceil(columns) as f64,
                panels,
                columns,
            },
        }
    }

    fn front_panel(&self, x: usize, y: usize) -> Panel {
        let series = |label: &str, cases: &[usize], style: Style, role: Role| {
            let of = |goal: usize| {
                cases
                    .iter()
                    .map(|case| self.goal(*case, goal))
                    .collect::<Vec<_>>()
            };
            Series::new(label, &of(x), &of(y), style, role)
        };
        let mut front = self.found.front.clone();
        front.sort_by(|a, b| self.goal(*a, x).total_cmp(&self.goal(*b, x)));
        // What is far behind the front would make it a point.
        let range = |goal: usize| {
            let shown = front.iter().chain([&0, &self.found.chosen]);
            let shown = shown
                .map(|case| self.goal(*case, goal))
                .filter(|value| value.is_finite());
            let ends = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
            let (low, high) = shown.fold((f64::INFINITY, 0.0_f64), ends);
            if high < SMALLEST {
                return (0.0, 1.0);
            }
            let margin = (0.1 * (high - low)).max(0.05 * high);
            ((low - margin).max(0.0), high + margin)
        };
        let (x_range, y_range) = (range(x), range(y));
        let mut marked: Vec<usize> = Vec::new();
        for case in &front {
            let distance = |other: &usize| {
                let of = |goal, (low, high): (f64, f64)| {
                    (self.goal(*case, goal) - self.goal(*other, goal)) / (high - low)
                };
                of(x, x_range).hypot(of(y, y_range))
            };
            if marked.iter().all(|other| distance(other) > APART) {
                marked.push(*case);
            }
        }
        let solid = Style::Line(Dash::Solid);
        let line = match self.judge.goals.len() {
            2 => front.clone(),
            _ => Vec::new(),
        };
        let start = match self.found.outcomes[0].violation > 0.0 {
            true => "start (exceeds a limit)",
            false => "start",
        };
        let mut others = self.whole(true);
        others.retain(|case| !front.contains(case));
        let all = [
            series("keeps all limits", &others, Style::Markers, OTHERS),
            series("Pareto front", &line, solid, FRONT),
            series("some of the Pareto front", &marked, Style::Markers, FRONT),
            series(start, &[0], Style::Markers, START),
            series("chosen", &[self.found.chosen], Style::Markers, CHOSEN),
        ];
        let [x_label, y_label] = [x, y].map(|goal| self.judge.goals[goal].to_string());
        let mut panel = Panel::new(&x_label, &y_label, all.into());
        panel.x_range = Some(x_range);
        panel.y_range = Some(y_range);
        panel
    }

    /// Parameters and goals of the front, of the start, and of the best others.
    fn parallel(&self) -> CaptionedFigure {
        let parameters = self
            .axes
            .iter()
            .zip(self.values)
            .map(|(axis, values)| Coordinate {
                name: axis.keys()[0].clone(),
                values: values.clone(),
                is_logarithmic: axis.is_logarithmic(),
            });
        let count = self.found.candidates.len();
        let goals = self
            .judge
            .goals
            .iter()
            .enumerate()
            .map(|(goal, quantity)| Coordinate {
                name: quantity.to_string(),
                values: (0..count).map(|case| self.goal(case, goal)).collect(),
                is_logarithmic: false,
            });
        let values = self.found.values();
        let mut others = self.whole(true);
        others.retain(|case| !self.found.front.contains(case) && *case != 0);
        others.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        others.truncate(LINES);
        let kind = |label: &str, role, cases: Vec<usize>| Kind {
            label: label.to_owned(),
            role,
            cases,
        };
        let mut front = self.found.front.clone();
        front.sort_by(|a, b| self.goal(*a, 0).total_cmp(&self.goal(*b, 0)));
        let step = front.len().div_ceil(FRONT_LINES).max(1);
        let front = front.into_iter().step_by(step).collect();
        let mut kinds = vec![kind("keeps all limits", OTHERS, others)];
        if self.judge.goals.len() > 1 {
            kinds.push(kind("some of the Pareto front", FRONT, front));
        }
        kinds.push(kind("start", START, vec![0]));
        kinds.push(kind("chosen", CHOSEN, vec![self.found.chosen]));
        let coordinates: Vec<Coordinate> = parameters.chain(goals).collect();
        let x_label = "parameter or goal, numbered as in the legend";
        CaptionedFigure {
            name: "parallel",
            caption: format!(
                "Parameters and goals of candidates, each a line: up to {FRONT_LINES} of the Pareto \
                 front, evenly over its first goal, and the {LINES} best others that keep all limits."
            ),
            figure: parallel_figure::figure(self.title, x_label, &coordinates, &kinds),
        }
    }

    /// The goals over the candidates' numbers.
    fn progress(&self) -> CaptionedFigure {
        let panels: Vec<Panel> = (0..self.judge.goals.len())
            .map(|goal| self.progress_panel(goal))
            .collect();
        CaptionedFigure {
            name: "progress",
            caption:
                "The goals over the candidates, in their order, and those of the best candidate \
                      so far under equal weights. Candidates that were given up are left out; what \
                      is far above the start is not shown."
                    .to_owned(),
            figure: Figure {
                title: self.title.to_owned(),
                height: 80.0 + 300.0 * panels.len() as f64,
                panels,
                columns: 1,
                width: 900.0,
            },
        }
    }

    fn progress_panel(&self, goal: usize) -> Panel {
        let points = |label: &str, cases: &[usize], role: Role| {
            let x: Vec<f64> = cases.iter().map(|case| *case as f64).collect();
            let y: Vec<f64> = cases.iter().map(|case| self.goal(*case, goal)).collect();
            Series::new(label, &x, &y, Style::Markers, role)
        };
        let values = self.found.values();
        let (mut best, mut incumbent) = (f64::INFINITY, 0);
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for (case, value) in values.iter().enumerate() {
            if self.found.outcomes[case].exact && *value < best {
                (best, incumbent) = (*value, case);
            }
            x.push(case as f64);
            y.push(self.goal(incumbent, goal));
        }
        let (kept, broken) = (self.whole(true), self.whole(false));
        let mut series = vec![
            points("keeps all limits", &kept, OTHERS),
            points("exceeds a limit", &broken, Role::Member(1)),
            Series::new(
                "best so far under equal weights",
                &x,
                &y,
                Style::Steps(Dash::Solid),
                CHOSEN,
            ),
        ];
        let quantity = &self.judge.goals[goal];
        if let Some(target) = quantity.at_most {
            let ends = [0.0, (values.len() - 1) as f64];
            let dashed = Style::Line(Dash::Dashed);
            series.push(Series::new(
                "target",
                &ends,
                &[target; 2],
                dashed,
                Role::Reference,
            ));
        }
        let mut panel = Panel::new("candidate", &quantity.to_string(), series);
        let finite = y
            .iter()
            .chain(quantity.at_most.as_ref())
            .copied()
            .filter(|y| y.is_finite());
        let most = finite.fold(0.0, f64::max);
        panel.y_range = (most > 0.0).then_some((0.0, 1.5 * most));
        panel.x_range = Some((-1.0, values.len() as f64));
        panel
    }

    /// Each world that the search has not seen, before and after.
    fn pairs(&self, comparisons: &[Comparison]) -> Option<CaptionedFigure> {
        let panel = |comparison: &Comparison| {
            let finite = comparison
                .pairs
                .iter()
                .filter(|(a, b)| a.is_finite() && b.is_finite());
            let (x, y): (Vec<f64>, Vec<f64>) = finite.copied().unzip();
            let ends = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
            let (low, high) = x.iter().chain(&y).fold((f64::INFINITY, 0.0_f64), ends);
            let (_, measure) = comparison.name.rsplit_once(' ')?;
            if !(high > 0.0) || measure == "failures" {
                return None;
            }
            let margin = 0.08 * (high - low).max(0.1 * high);
            let ends = [(low - margin).max(0.0), high + margin];
            let dashed = Style::Line(Dash::Dashed);
            let mut series = vec![
                Series::new("no change", &ends, &ends, dashed, Role::Reference),
                Series::new(
                    "a world that the search has not seen",
                    &x,
                    &y,
                    Style::Markers,
                    FRONT,
                ),
            ];
            if let Some(most) = comparison.at_most {
                let dotted = Style::Line(Dash::Dotted);
                series.push(Series::new(
                    "target or limit",
                    &ends,
                    &[most; 2],
                    dotted,
                    Role::Linear,
                ));
            }
            let [before, after] = ["before", "after"].map(|when| format!("{measure}, {when}"));
            let mut panel = Panel::new(&before, &after, series);
            panel.x_range = Some((ends[0], ends[1]));
            panel.y_range = panel.x_range;
            Some((measure.to_owned(), panel))
        };
        // One panel for each measure, whatever its statistics.
        let mut seen = Vec::new();
        let mut panels = Vec::new();
        for (measure, panel) in comparisons.iter().filter_map(panel) {
            if !seen.contains(&measure) {
                seen.push(measure);
                panels.push(panel);
            }
        }
        if panels.is_empty() {
            return None;
        }
        let columns = if panels.len() == 4 {
            2
        } else {
            panels.len().min(3)
        };
        Some(CaptionedFigure {
            name: "before-after",
            caption: "Each world that the search has not seen, with the start and with what was \
                      found; below the dashed line is better. Runs that did not come to their end are \
                      left out."
                .to_owned(),
            figure: Figure {
                title: self.title.to_owned(),
                width: 400.0 * columns as f64 + 60.0,
                height: 80.0 + 390.0 * panels.len().div_ceil(columns) as f64,
                panels,
                columns,
            },
        })
    }
}
