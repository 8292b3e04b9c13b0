//! Keys: numbers of boxes, such as the vertices of triangles. Two boxes with a key in common never pair.

/// Up to four numbers of a box; [`NO_KEY`] where there are fewer.
///
/// Boxes of a mesh have their vertices: `[v, NO_KEY, NO_KEY, NO_KEY]` is a vertex, `[v, w, NO_KEY, NO_KEY]` an edge.
pub type Keys = [u32; 4];

/// An unused place in [`Keys`], which nothing has in common.
pub const NO_KEY: u32 = u32::MAX;

/// Returns true if two boxes share no key. Without a branch, so that the compiler compares four at once.
#[inline(always)]
pub(crate) fn share_none(one: &Keys, other: &Keys) -> bool {
    let mut shared = [0; 4];
    for &key in one {
        for (shared, &other) in shared.iter_mut().zip(other) {
            *shared |= u32::from(key == other) & u32::from(key != NO_KEY);
        }
    }
    shared == [0; 4]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_compared_wherever_they_stand() {
        for i in 0..4 {
            for j in 0..4 {
                let (mut one, mut other) = ([NO_KEY; 4], [NO_KEY; 4]);
                assert!(share_none(&one, &other));
                (one[i], other[j]) = (7, 7);
                assert!(!share_none(&one, &other));
                other[j] = 8;
                assert!(share_none(&one, &other));
            }
        }
    }
}
