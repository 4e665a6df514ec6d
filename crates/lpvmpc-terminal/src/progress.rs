//! A progress bar for what takes longer than a moment.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Work done within this time shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often the time on the bar moves, also where no step is done for long.
const TICK: Duration = Duration::from_millis(250);

/// Whether no bar is wanted at all.
static QUIET: AtomicBool = AtomicBool::new(false);

/// No bar from here on.
pub fn silence() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Steps of a bar that is told parts from 0 to 1.
const PARTS: f64 = 1000.0;

/// The bar of proofs of certificates: there while one is made.
#[derive(Debug, Default)]
pub struct ProofProgress(Mutex<Option<Progress>>);

impl ProofProgress {
    /// This part of a proof is done.
    pub fn set_part(&self, done: f64) {
        let mut bar = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match done < 1.0 {
            true => bar
                .get_or_insert_with(|| Progress::of_parts("proving the certificate"))
                .set_part(done),
            false => *bar = None,
        }
    }
}

/// Progress of some work on standard error. Nothing is drawn when that is no terminal, when the
/// work is done within a second, or after it is dropped.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// Shows the bar after a while; ends when the other side of the channel is dropped.
    curtain: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Progress {
    /// Work of `steps` steps, called `what`.
    pub fn new(what: impl Into<String>, steps: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(steps as u64), ProgressDrawTarget::hidden());
        let template = "{msg} {elapsed} {wide_bar} {percent:>3} % {eta:>4}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(what.into());
        let curtain = (!QUIET.load(Ordering::Relaxed)).then(|| {
            let (sender, dropped) = mpsc::channel();
            let shown = bar.clone();
            let raise = move || {
                if dropped.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                    // Draws nothing when standard error is not a terminal.
                    shown.set_draw_target(ProgressDrawTarget::stderr());
                    shown.enable_steady_tick(TICK);
                }
            };
            (sender, thread::spawn(raise))
        });
        Self { bar, curtain }
    }

    /// Work called `what` that is told by the part of it that is done.
    pub fn of_parts(what: impl Into<String>) -> Self {
        Self::new(what, PARTS as usize)
    }

    /// This part is done, of work that is told so.
    pub fn set_part(&self, done: f64) {
        self.set((done * PARTS) as usize);
    }

    /// So many steps are done.
    pub fn set(&self, done: usize) {
        self.bar.set_position(done as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((sender, thread)) = self.curtain.take() {
            drop(sender);
            // It cannot panic, and what it draws must not come after the end.
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}
