//! Long computations: without the interpreter's lock, with progress, and with an end at Ctrl-C.
//!
//! The work is done on a thread of its own, since Python hears of signals on the thread that called.
//! It is stopped where it tells its progress: from there it unwinds, which needs nothing of the
//! libraries' interfaces, reaches through the threads that they start, and frees what they hold.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::any::Any;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How often the calling thread looks for signals and tells of the progress.
const TICK: Duration = Duration::from_millis(50);
/// As much as a program's first thread has.
const STACK: usize = 8 << 20;
/// Steps of work that is told by the part of it that is done.
const PARTS: f64 = 1000.0;

/// What is called with the name of the work, the steps that are done, and all of them.
pub type Report<'py> = Option<Bound<'py, PyAny>>;

/// How far the work is, and whether it is to end.
pub struct Watch {
    work: Mutex<(String, usize)>,
    done: AtomicUsize,
    stopped: AtomicBool,
}

/// What a thread that is stopped unwinds with.
struct Stopped;

impl Watch {
    /// From here on it is work called `what`, of so many steps.
    pub fn begin(&self, what: &str, steps: usize) {
        let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
        if work.0 != what {
            *work = (what.to_owned(), steps);
            self.done.store(0, Relaxed);
        }
    }

    /// So many steps are done.
    pub fn set(&self, done: usize) {
        self.done.store(done, Relaxed);
        self.look();
    }

    /// One step more is done.
    pub fn step(&self) {
        self.done.fetch_add(1, Relaxed);
        self.look();
    }

    /// This part of the work called `what` is done.
    pub fn set_part(&self, what: &str, done: f64) {
        self.begin(what, PARTS as usize);
        self.set((done * PARTS) as usize);
    }

    /// A clock at which the work ends, too: it is read in the midst of what tells no progress.
    pub fn clock(&self) -> impl Fn() -> Duration + Sync + '_ {
        let start = Instant::now();
        move || {
            self.look();
            start.elapsed()
        }
    }

    /// Ends the work here if it is to end.
    pub fn look(&self) {
        if self.stopped.load(Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Does `task` on a thread of its own.
///
/// # Errors
/// `KeyboardInterrupt`, what `report` raises, or `RuntimeError`: there is no thread, or the task panicked.
/// The task has then ended.
pub fn work<T: Send>(
    py: Python<'_>,
    report: &Report<'_>,
    task: impl FnOnce(&Watch) -> T + Send,
) -> PyResult<T> {
    let watch = Watch {
        work: Mutex::default(),
        done: AtomicUsize::new(0),
        stopped: AtomicBool::new(false),
    };
    let caller = thread::current();
    thread::scope(|scope| {
        let run = || {
            let found = task(&watch);
            caller.unpark();
            found
        };
        let builder = thread::Builder::new().stack_size(STACK);
        let worker = builder.spawn_scoped(scope, run);
        let worker = worker.map_err(|error| {
            PyRuntimeError::new_err(format!("there is no thread to work on: {error}"))
        })?;
        let mut ended = Ok(());
        while ended.is_ok() && !worker.is_finished() {
            py.detach(|| thread::park_timeout(TICK));
            ended = py.check_signals().and_then(|()| tell(&watch, report));
        }
        watch.stopped.store(ended.is_err(), Relaxed);
        let found = py.detach(|| worker.join());
        ended?;
        match found {
            Ok(found) => tell(&watch, report).map(|()| found),
            Err(panic) => Err(fault(panic.as_ref())),
        }
    })
}

/// What should never be: a fault of this package, told as an error like any other.
fn fault(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    PyRuntimeError::new_err(format!(
        "a fault in lpvmpc, please report it: {}",
        text.unwrap_or("(nothing is known of it)")
    ))
}

fn tell(watch: &Watch, report: &Report<'_>) -> PyResult<()> {
    let Some(report) = report else {
        return Ok(());
    };
    let (what, steps) = watch
        .work
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    if steps > 0 {
        report.call1((what, watch.done.load(Relaxed), steps))?;
    }
    Ok(())
}
