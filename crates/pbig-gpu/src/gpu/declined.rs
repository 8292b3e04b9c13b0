//! Calls that the device leaves to the CPU because its grid would make too many tests.

/// Maximum number of calls for which a set is declined unseen.
const MAX_CALLS: u32 = 64;

/// The last declined set. Sets of about its size are declined without a map, for twice as many calls each time.
#[derive(Debug, Default)]
pub(super) struct Declined {
    boxes: usize,
    why: String,
    calls: u32,
    calls_left: u32,
}

impl Declined {
    /// Returns the reason if a set of this size is declined unseen.
    pub(super) fn unseen(&mut self, boxes: usize) -> Option<String> {
        let is_alike = boxes / 2 <= self.boxes && self.boxes / 2 <= boxes;
        self.calls_left = self.calls_left.checked_sub(1)?;
        is_alike.then(|| format!("a set of about this size was declined before: {}", self.why))
    }

    pub(super) fn note(&mut self, boxes: usize, why: &str) {
        let calls = (2 * self.calls).clamp(1, MAX_CALLS);
        *self = Self { boxes, why: why.to_owned(), calls, calls_left: calls };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_declined_set_is_tried_again_ever_more_rarely() {
        let mut declined = Declined::default();
        assert_eq!(declined.unseen(1000), None);
        let mut tries = Vec::new();
        for call in 0..200 {
            if declined.unseen(1000).is_none() {
                tries.push(call);
                declined.note(1000, "why");
            }
        }
        assert_eq!(tries, [0, 2, 5, 10, 19, 36, 69, 134, 199]);
        assert_eq!(declined.unseen(400), None, "another set is tried at once");
    }
}
