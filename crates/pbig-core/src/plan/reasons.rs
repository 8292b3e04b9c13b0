//! Why an update went its way, where what earlier ones have taken decides.

use crate::Look;
use std::fmt;

/// At which rows boxes look in the search of the CPU's grid: in how many levels. None where nothing, or only what has changed,
/// is searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Looks {
    /// [`Look::Everywhere`].
    pub everywhere: u32,
    /// [`Look::Trimmed`].
    pub trimmed: u32,
    /// [`Look::Seldom`].
    pub seldom: u32,
}

impl Looks {
    /// One more level.
    pub(crate) fn count(&mut self, look: Look) {
        match look {
            Look::Auto => {}
            Look::Everywhere => self.everywhere += 1,
            Look::Trimmed => self.trimmed += 1,
            Look::Seldom => self.seldom += 1,
        }
    }
}

/// The list that [`crate::plan::Chosen::Near`] tests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearPlan {
    /// How far a box may go from where it was when it was last searched for, in the unit of the boxes.
    pub skin: f32,
    /// Pairs that are near each other, whether they overlap or not.
    pub pairs: u64,
    /// Updates that have used it since the one that searched for it.
    pub age: u32,
}

/// Why there is no list of near pairs, where so many boxes change that there might be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoNear {
    /// It is not known yet what updates cost without one.
    Unmeasured,
    /// They pay, and after some this is measured again, by an update without.
    Compared,
    /// The last ones did not pay, or did not last: so many updates more go without.
    Unpaid(u32),
    /// Too many pairs would be near, as boxes move far, are crowded or filtered: so many updates more go without; none where
    /// a list is asked for.
    Many(u32),
    /// How far boxes move is not known: most that have changed were not there before, or are where they were.
    Unknown,
    /// [`crate::Config::study`] asks for another way.
    Unwanted,
}

/// What the ways to do an update have taken here, as far as that has been measured and decides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// How many boxes of a search of all take as long as the edit of one.
    pub edit: Option<f32>,
    /// By changed box: what updates with the last list of near pairs took, of what those without do.
    pub near: Option<f32>,
    /// Of up to 1024 boxes of which many change: what the grid takes, of what the bitmap does.
    pub grid: Option<f32>,
    /// What a device takes, of what the CPU does.
    pub gpu: Option<f32>,
}

/// `1200 pairs in a list that 5 updates have used, with a skin of 0.1`.
impl fmt::Display for NearPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { skin, pairs, age } = self;
        write!(f, "{pairs} pairs in a list that {age} updates have used, with a skin of {skin}")
    }
}

impl fmt::Display for NoNear {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unmeasured => write!(f, "what updates take without them is measured first"),
            Self::Compared => write!(f, "they pay, which is measured again by an update without"),
            Self::Unpaid(pause) => write!(f, "the last ones did not pay or last, {}", Pause(*pause)),
            Self::Many(pause) => write!(f, "too many would be near, {}", Pause(*pause)),
            Self::Unknown => write!(f, "how far most boxes move is not known"),
            Self::Unwanted => write!(f, "another way is asked for"),
        }
    }
}

/// `trimmed`, or `trimmed in 1 level, seldom in 2`.
impl fmt::Display for Looks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = [("everywhere", self.everywhere), ("trimmed", self.trimmed), ("seldom", self.seldom)];
        let mut used = all.into_iter().filter(|(_, levels)| *levels > 0);
        let Some((name, levels)) = used.next() else { return f.write_str("none") };
        let mut others = used.peekable();
        if others.peek().is_none() {
            return f.write_str(name);
        }
        write!(f, "{name} in {levels} level{}", if levels == 1 { "" } else { "s" })?;
        others.try_for_each(|(name, levels)| write!(f, ", {name} in {levels}"))
    }
}

/// Updates that go without a list.
struct Pause(u32);

impl fmt::Display for Pause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => write!(f, "the next update may try again"),
            1 => write!(f, "one more update goes without"),
            updates => write!(f, "{updates} more updates go without"),
        }
    }
}

/// Each as `; …`: what is not known is left out.
impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(boxes) = self.edit {
            write!(f, "; the edit of a box takes as long as {boxes:.0} of a search of all")?;
        }
        let times = [
            (self.near, "near pairs take", "an update without"),
            (self.grid, "a grid takes", "the bitmap's time"),
            (self.gpu, "the GPU takes", "the CPU's time"),
        ];
        for (share, what, of) in times {
            if let Some(share) = share {
                write!(f, "; {what} {share:.2} of {of}")?;
            }
        }
        Ok(())
    }
}
