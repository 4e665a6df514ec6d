//! When something that saves time, if it comes to an answer, is worth a try: not each time, where it comes to nothing time
//! and again.

/// So many times in vain without an answer are no reason for a pause. After more of them it is tried after 1, 3, 7 and then
/// 15 samples without.
const FREE: u8 = 2;
const MOST: u8 = FREE + 4;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Retries {
    /// How much more often it was in vain than not.
    misses: u8,
    /// For how many samples it is not tried.
    pause: u8,
}

impl Retries {
    /// Whether it is tried in this sample.
    pub fn are_due(&mut self) -> bool {
        let due = self.pause == 0;
        self.pause = self.pause.saturating_sub(1);
        due
    }

    /// Whether it, tried, has led to the answer, and not at too great a cost.
    pub fn learn(&mut self, found: bool) {
        if found {
            self.misses = self.misses.saturating_sub(1);
        } else {
            self.misses = (self.misses + 1).min(MOST);
            self.pause = (1 << self.misses.saturating_sub(FREE)) - 1;
        }
    }

    /// The same of what takes as long in vain as it saves else: there is a pause after the first time.
    pub fn learn_of_dear(&mut self, found: bool) {
        if !found {
            self.misses = self.misses.max(FREE);
        }
        self.learn(found);
    }

    /// It is as if it had been in vain time and again.
    pub fn give_up(&mut self) {
        self.misses = MOST;
        self.learn(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples without a try before the next one, of which is learnt.
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
        let pauses = [(); 6].map(|()| pause(&mut retries, |retries| retries.learn_of_dear(false)));
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
    }
}
