//! The kernels in a search for changes, which has each box now and at the last update.

use super::*;

impl State {
    /// Returns true in a search for changes.
    pub(super) fn finds_changes(&self) -> bool {
        !self.motions.is_empty()
    }

    /// Returns the bounds of a box now and at the last update.
    pub(super) fn bounds(&self, id: usize) -> DeviceBox {
        self.motions.get(id).map_or_else(|| DeviceBox::new(&self.boxes[id]), bounds_of)
    }

    /// Returns true if this update has changed a box, or if the device got the box now and before.
    pub(super) fn has_changed(&self, id: usize) -> bool {
        id >= self.params.known as usize || self.changed[id / 32] >> (id % 32) & 1 != 0
    }

    /// Brings the boxes now and before into the form that the checks need.
    pub(super) fn renew(&mut self) {
        for id in 0..self.motions.len() {
            if !self.has_changed(id) {
                self.motions[id].before = self.motions[id].now;
            }
        }
    }

    pub(super) fn has_moved(&self, id: usize) -> bool {
        self.motions.get(id).is_some_and(|motion| motion.now != motion.before)
    }

    /// Returns the mark of a pair in plain output.
    pub(super) fn mark_of(&self, pair: &Pair) -> u32 {
        let [a, b] = [pair.a, pair.b].map(|id| self.motions.get(id as usize));
        if a.zip(b).is_some_and(|(a, b)| !overlap(&a.now, &b.now)) { ENDED } else { 0 }
    }

    /// Returns true if two boxes overlap; in a search for changes, if their overlap has changed.
    pub(super) fn is_wanted(&self, i: usize, j: usize) -> bool {
        match (self.motions.get(i), self.motions.get(j)) {
            (Some(a), Some(b)) => overlap(&a.now, &b.now) != overlap(&a.before, &b.before),
            _ => overlap(&self.bounds(i), &self.bounds(j)),
        }
    }

    /// Adds the boxes that the device has from the last update, and the lists of changes.
    pub(super) fn add_changes(&mut self, case: &Case) {
        for (id, (now, before)) in (0u32..).zip(case.boxes.iter().zip(&case.before)) {
            let long_ago = DeviceBox::new(&case.boxes[0]);
            // The device may still have an old box where there was none at the last update.
            let known = if before.is_valid() { *before } else { case.boxes[1] };
            self.motions.push(Motion { now: DeviceBox::new(&known), before: long_ago });
            if !before.is_valid() || now != before {
                let mark = if before.is_valid() { 0 } else { WAS_ABSENT };
                self.box_changes.push(BoxChange { marked_id: id | mark, now: DeviceBox::new(now) });
            }
            if id.is_multiple_of(9) {
                self.filter_changes.push(FilterChange { id, filter: filter(id + 1) });
            }
        }
        self.changed = vec![0; case.boxes.len().div_ceil(32)];
        self.params.known = self.motions.len() as u32;
        self.params.box_changes = self.box_changes.len() as u32;
        self.params.filter_changes = self.filter_changes.len() as u32;
    }
}

fn bounds_of(motion: &Motion) -> DeviceBox {
    let (now, before) = (&motion.now, &motion.before);
    DeviceBox {
        low: std::array::from_fn(|k| now.low[k].min(before.low[k])),
        high: std::array::from_fn(|k| now.high[k].max(before.high[k])),
    }
}

/// Returns the boxes that the plan is made for: the bounds of each box now and before.
pub(super) fn all_bounds(case: &Case) -> Vec<Aabb> {
    let both = |(i, now): (usize, &Aabb)| match case.before.get(i) {
        Some(before) if before.is_valid() && now.is_valid() => Aabb::new(
            std::array::from_fn(|k| now.min[k].min(before.min[k])),
            std::array::from_fn(|k| now.max[k].max(before.max[k])),
        ),
        Some(before) if before.is_valid() => *before,
        _ => *now,
    };
    case.boxes.iter().enumerate().map(both).collect()
}

/// Returns the cases with moving boxes: half of them move a little, come from anywhere, appear or disappear.
pub(super) fn moving_cases() -> Vec<Case> {
    cases().into_iter().map(moving).collect()
}

pub(super) fn moving(mut case: Case) -> Case {
    let all = case.boxes.clone();
    case.before = all.clone();
    for i in 0..all.len() / 2 {
        let by = |x: f32| x + (i % 3) as f32 * 0.4;
        case.before[i] = match i % 6 {
            0 | 1 => Aabb::new(all[i].min.map(by), all[i].max.map(by)),
            2 => Aabb::NOWHERE,
            3 => all[i * 7 % all.len()],
            _ => all[i],
        };
        if i % 6 == 4 {
            case.boxes[i] = Aabb::NOWHERE;
        }
    }
    case
}

/// Returns the level. For an invalid box it is larger than all levels.
pub(super) fn own_level(at: &Located) -> u32 {
    at.shape & ((1 << SPAN_BITS) - 1)
}

/// Returns true if a cell may own a pair of entries with these marks, and the pair may be wanted.
pub(super) fn may_be_wanted(s: &State, marks: u32) -> bool {
    marks >> AXIS_BITS == 7 && (!s.finds_changes() || marks & MOVED != 0)
}

pub(super) fn by_change(s: &State) -> u32 {
    s.params.box_changes.max(s.params.filter_changes).div_ceil(LANES)
}

pub(super) fn apply_changes(s: &mut State) {
    for one in &s.box_changes[..s.params.box_changes as usize] {
        let id = one.marked_id & !WAS_ABSENT;
        let motion = &mut s.motions[id as usize];
        motion.before = if one.marked_id & WAS_ABSENT == 0 { motion.now } else { DeviceBox::INVALID };
        motion.now = one.now;
        s.changed[id as usize / 32] |= 1 << (id % 32);
    }
    for one in &s.filter_changes[..s.params.filter_changes as usize] {
        s.filters[one.id as usize] = one.filter;
    }
}

/// Boxes and filters beyond the ends of the lists must not change.
#[test]
fn apply_changes_changes_nothing_else() {
    let mut before = State::before("apply_changes", &moving(pile()));
    before.params.box_changes /= 2;
    before.params.filter_changes -= 1;
    assert_eq!(fault(twin("apply_changes"), &GpuOptions::DEFAULT, &before), None);
}

/// Boxes beyond the known ones came up with the place where they were.
#[test]
fn locate_and_check_all_take_new_boxes_as_they_are() {
    for kernel in ["locate", "check_all"] {
        let mut before = State::before(kernel, &Case { boxes: set("pile", 900), ..moving(pile()) });
        before.params.known -= 300;
        assert_eq!(fault(twin(kernel), &GpuOptions::DEFAULT, &before), None, "{kernel}");
    }
}

#[test]
fn the_twins_together_find_what_one_of_two_states_has() {
    for case in moving_cases() {
        let state = State::before("check_small", &case);
        let (now, before) = (oracle::pairs(&case.boxes), oracle::pairs(&case.before));
        let differs = |pair: &&Pair| now.binary_search(pair).is_err() || before.binary_search(pair).is_err();
        let wanted: Vec<_> = sorted(&[&now[..], &before[..]].concat());
        let wanted: Vec<_> = wanted.iter().filter(differs).copied().collect();
        let pairs = |kernel| decoded(&after_twin(twin(kernel), &state)).expect("a twin writes plain pairs");
        let both = sorted(&[pairs("check_small"), pairs("check_large")].concat());
        assert_eq!(difference(&both, &wanted), None, "{}", case.name);
        assert_eq!(difference(&pairs("check_all"), &wanted), None, "{}", case.name);
    }
}

/// The other tests would mean little if no box moved, or if all did.
#[test]
fn the_moving_sets_have_large_items_without_and_with_movement() {
    let marks = |s: &State, item: &LargeItem| -> u32 {
        let entries = &s.entries[item.start as usize..(item.start + item.boxes) as usize];
        entries.iter().fold(0, |marks, entry| marks | entry)
    };
    let states: Vec<_> = moving_cases().iter().map(|case| State::before("check_large", case)).collect();
    let some =
        |has: fn(u32) -> bool| states.iter().any(|s| s.large_items.iter().any(|item| has(marks(s, item))));
    assert!(some(|marks| marks >> AXIS_BITS == 7 && marks & MOVED == 0), "all large cells have movement");
    assert!(some(|marks| marks >> AXIS_BITS == 7 && marks & MOVED != 0), "no large cell has movement");
}

#[test]
fn faults_planted_in_what_is_known_of_boxes_are_noticed() {
    let faults: [(&str, Plant); 6] = [
        ("locate", |s| s.motions[3].before.low[0] += 1),
        ("locate", |s| s.motions.swap(0, 8)),
        ("apply_changes", |s| s.changed[0] ^= 4),
        ("apply_changes", |s| s.motions[7].now.high[2] -= 1),
        ("apply_changes", |s| s.motions[2].before = s.motions[2].now),
        ("apply_changes", |s| s.filters[9].mask ^= 1),
    ];
    are_noticed(&faults, &moving(pile()));
}
