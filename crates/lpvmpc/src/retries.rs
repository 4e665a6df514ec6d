//! When something that saves time, if it comes to an answer, is worth a try: not each time, where it comes to nothing time
//! and again.

/// So many failures that no answer has made up for are no reason for a pause. After more of them it is tried after 1, 3, 7 and
/// then 15 programs without.
const WITHOUT_PAUSE: u8 = 2;
const MOST_FAILURES: u8 = WITHOUT_PAUSE + 4;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Retries {
    /// Failures that no answer has made up for, up to [`MOST_FAILURES`].
    failures: u8,
    /// For how many programs it is not tried.
    pause: u8,
}

impl Retries {
    /// Whether it is tried now; asked once for each program.
    pub fn are_due(&mut self) -> bool {
        let due = self.pause == 0;
        self.pause = self.pause.saturating_sub(1);
        due
    }

    /// Whether there was no failure that no answer has made up for.
    pub fn no_failure_is_left(&self) -> bool {
        self.failures == 0
    }

    /// Whether it, tried, has led to the answer, and not at too great a cost.
    pub fn learn(&mut self, found: bool) {
        if found {
            self.failures = self.failures.saturating_sub(1);
        } else {
            self.failures = (self.failures + 1).min(MOST_FAILURES);
            self.pause = (1 << self.failures.saturating_sub(WITHOUT_PAUSE)) - 1;
        }
    }

    /// The same of what costs as much in vain as it saves else: there is a pause after the first failure.
    pub fn learn_costly(&mut self, found: bool) {
        if !found {
            self.failures = self.failures.max(WITHOUT_PAUSE);
        }
        self.learn(found);
    }

    /// It is as if it had been in vain time and again.
    pub fn give_up(&mut self) {
        self.failures = MOST_FAILURES;
        self.learn(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Programs without a try before the next one, of which is learnt.
    fn pause(retries: &mut Retries, learn: impl FnOnce(&mut Retries)) -> usize {
        let pause = core::iter::repeat_with(|| retries.are_due()).take_while(|due| !due);
        let pause = pause.count();
        learn(retries);
        pause
    }

    #[test]
    fn tries_in_vain_become_rare() {
        let mut retries = Retries::default();
        let pauses = [(); 8].map(|()| pause(&mut retries, |retries| retries.learn(false)));
        assert_eq!(pauses, [0, 0, 0, 1, 3, 7, 15, 15]);
        let mut retries = Retries::default();
        let pauses = [(); 6].map(|()| pause(&mut retries, |retries| retries.learn_costly(false)));
        assert_eq!(pauses, [0, 1, 3, 7, 15, 15]);
        let mut retries = Retries::default();
        let pauses = [(); 3].map(|()| pause(&mut retries, Retries::give_up));
        assert_eq!(pauses, [0, 15, 15]);
    }

    /// As long as each leads to an answer there is no pause, and each makes up for one in vain.
    #[test]
    fn each_answer_makes_up_for_one_in_vain() {
        let mut retries = Retries::default();
        let mut learn = |found| pause(&mut retries, |retries| retries.learn(found));
        let tries = [false, false, false, false, true, true, false, false];
        assert_eq!(tries.map(&mut learn), [0, 0, 0, 1, 3, 0, 0, 1]);
        let mut retries = Retries::default();
        let none = [true, false, true].map(|found| {
            retries.learn(found);
            retries.no_failure_is_left()
        });
        assert_eq!(none, [true, false, true]);
    }
}
