//! When something is worth a try: not each time, where it comes to nothing time and again.

/// It is tried after 0, 0, 1, 3 and then 7 samples without, the more often in a row it was in vain.
const MISSES: u32 = 5;

/// What has come to nothing in the solves before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AllRetries {
    /// The last answer's bounds, once more.
    pub repeats: Retries,
    /// The same, without a solution of the end of the horizon by itself.
    pub without_end: Retries,
    /// The inputs that the regulator saturates.
    pub saturations: Retries,
    /// The phase as a whole.
    pub turns: Retries,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retries {
    /// How often in a row it was in vain.
    misses: u32,
    /// For how many samples it is not tried.
    pause: u32,
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
        self.misses = if found { 0 } else { self.misses + 1 }.min(MISSES);
        self.pause = ((1 << self.misses) / 4_u32).saturating_sub(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples without a guess before the next one.
    fn pause(retries: &mut Retries) -> usize {
        core::iter::repeat_with(|| retries.are_due())
            .take_while(|due| !due)
            .count()
    }

    #[test]
    fn guesses_in_vain_become_rare() {
        let mut retries = Retries::default();
        let pauses = [(); 8].map(|()| {
            let pause = pause(&mut retries);
            retries.learn(false);
            pause
        });
        assert_eq!(pauses, [0, 0, 0, 1, 3, 7, 7, 7]);
        assert_eq!(pause(&mut retries), 7);
        retries.learn(true);
        assert_eq!(pause(&mut retries), 0);
    }
}
