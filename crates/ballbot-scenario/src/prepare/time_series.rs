//! Numbers over time, from a CSV file.

use crate::error::ScenarioError;
use crate::words;
use std::path::PathBuf;

/// One quantity over time, in order, without gaps.
#[derive(Clone, Debug)]
pub(crate) struct TimeSeries {
    path: PathBuf,
    time: Vec<f64>,
    values: Vec<f64>,
    /// The line of each row in the file.
    lines: Vec<Option<u64>>,
}

/// A set point takes effect at the sample that lies within this much of its time, s.
pub(crate) const SAME_TIME: f64 = 1e-9;

/// An interval this many times the median one is a gap.
const GAP: f64 = 3.0;

impl TimeSeries {
    /// Reads two columns of a file, time (s) and value, refusing gaps rather than guessing what
    /// was meant.
    ///
    /// # Errors
    /// The file cannot be read, has no such columns or no rows, or a number makes no sense.
    pub(crate) fn read(path: PathBuf, names: [&str; 2]) -> Result<Self, ScenarioError> {
        let text = words::read(&path).map_err(|source| ScenarioError::Read {
            path: path.clone(),
            source,
        })?;
        let mut series = Self {
            path,
            time: Vec::new(),
            values: Vec::new(),
            lines: Vec::new(),
        };
        series.take_rows(&text, names)?;
        series.check_times()?;
        Ok(series)
    }

    /// Times (s) and values.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.time.iter().copied().zip(self.values.iter().copied())
    }

    /// What is wrong with the file.
    pub(crate) fn problem(&self, line: Option<u64>, problem: String) -> ScenarioError {
        ScenarioError::CsvFile {
            path: self.path.clone(),
            line,
            problem,
        }
    }

    fn take_rows(&mut self, text: &[u8], names: [&str; 2]) -> Result<(), ScenarioError> {
        // Spreadsheets of countries with decimal commas write semicolons.
        let names_of_columns = text.split(|byte| *byte == b'\n');
        let mut names_of_columns = names_of_columns.filter(|line| !line.starts_with(b"#"));
        let semicolons = names_of_columns
            .next()
            .is_some_and(|line| line.contains(&b';'));
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(if semicolons { b';' } else { b',' })
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text);
        let mut lines = Lines::of(text);
        let header = Some(lines.of_record(None));
        let headers = reader.headers();
        let headers = headers.map_err(|error| self.problem(header, error.to_string()))?;
        let column = |name: &str| {
            let mut places = (0..headers.len()).filter(|i| &headers[*i] == name);
            let place = places.next();
            if let (Some(first), Some(second)) = (place, places.next()) {
                let problem = format!(
                    "the header names `{name}` twice, as fields {} and {}: rename one",
                    first + 1,
                    second + 1
                );
                return Err(self.problem(header, problem));
            }
            place.ok_or_else(|| {
                let present = headers.iter().collect::<Vec<_>>().join(", ");
                let problem = format!("there is no column `{name}`; the columns are: {present}");
                self.problem(header, problem)
            })
        };
        let places = [column(names[0])?, column(names[1])?];
        for record in reader.records() {
            let record = record.map_err(|error| {
                let line = lines.of_record(error.position());
                self.problem(Some(line), error.to_string())
            })?;
            let line = Some(lines.of_record(record.position()));
            let number = |i: usize| {
                let (name, text) = (names[i], record.get(places[i]).unwrap_or(""));
                match text.parse::<f64>() {
                    Ok(value) if value.is_finite() => Ok(value),
                    _ if text.is_empty() => Err(self.problem(line, format!("`{name}` is missing"))),
                    _ => {
                        let point = text.replace(',', ".");
                        let hint = match point.parse::<f64>() {
                            Ok(_) if point != text => format!("; write {point}"),
                            _ => String::new(),
                        };
                        let problem =
                            format!("`{name}` is `{text}`, which is not a finite number{hint}");
                        Err(self.problem(line, problem))
                    }
                }
            };
            let (time, value) = (number(0)?, number(1)?);
            self.time.push(time);
            self.values.push(value);
            self.lines.push(line);
        }
        Ok(())
    }

    /// There are rows, and their times increase without a gap.
    fn check_times(&self) -> Result<(), ScenarioError> {
        if self.time.is_empty() {
            let problem = "there are no rows below the header".to_owned();
            return Err(self.problem(None, problem));
        }
        let intervals = self.time.windows(2).map(|pair| pair[1] - pair[0]);
        let mut sorted: Vec<f64> = intervals.clone().collect();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        for (i, interval) in intervals.enumerate() {
            let line = self.lines.get(i + 1).copied().flatten();
            let time = self.time[i];
            if interval <= 0.0 {
                let now = time + interval;
                let problem = format!("time does not increase: {now} s after {time} s");
                return Err(self.problem(line, problem));
            }
            if interval > GAP * median {
                let problem = format!(
                    "a gap of {interval:.6} s after {time} s, where rows are {median:.6} s apart; \
                     fill it in"
                );
                return Err(self.problem(line, problem));
            }
        }
        Ok(())
    }

    /// It is known from 0 s to the end of a run of `duration` seconds. A single row holds for all
    /// times.
    ///
    /// # Errors
    /// It begins too late or ends too early.
    pub(crate) fn check_covers(&self, duration: f64) -> Result<(), ScenarioError> {
        if let Some(first) = self.time.first()
            && *first > SAME_TIME
        {
            let problem = format!("it begins at {first} s; it must begin at 0 s or before");
            return Err(self.problem(self.lines.first().copied().flatten(), problem));
        }
        if let Some(last) = self.time.last()
            && *last < duration - SAME_TIME
            && self.time.len() > 1
        {
            let problem =
                format!("it ends at {last} s, before the run does (duration_s = {duration})");
            return Err(self.problem(self.lines.last().copied().flatten(), problem));
        }
        Ok(())
    }
}

/// The lines of a file. Those that the reader counts are behind by the ends of CRLF lines, and by
/// comments.
struct Lines<'a> {
    rest: &'a [u8],
    /// Bytes before the rest, and the number of its first line.
    bytes: usize,
    line: u64,
}

impl<'a> Lines<'a> {
    fn of(text: &'a [u8]) -> Self {
        Self {
            rest: text,
            bytes: 0,
            line: 1,
        }
    }

    /// The line of the first record from a position on, the begin of the file without one. To be asked
    /// in order.
    fn of_record(&mut self, from: Option<&csv::Position>) -> u64 {
        let from = from.map_or(0, |position| position.byte() as usize);
        while let Some(end) = self.rest.iter().position(|byte| *byte == b'\n') {
            let (line, rest) = self.rest.split_at(end + 1);
            let is_record = !line.starts_with(b"#") && !line.trim_ascii_end().is_empty();
            if is_record && from <= self.bytes {
                break;
            }
            (self.rest, self.bytes) = (rest, self.bytes + line.len());
            self.line += 1;
        }
        self.line
    }
}
