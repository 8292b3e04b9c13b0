// A search for pairs that overlap: what is known of a box is the box as it is.

alias Subject = Box;

// What the cells of a box are taken of.
fn reach_of(one: Subject) -> Box {
    return one;
}

fn has_moved(one: Subject) -> bool {
    return false;
}

// Whether a pair may matter, by the marks in the entries of both.
fn is_due(marks: u32) -> bool {
    return true;
}

// Whether a pair matters, by its boxes.
fn matter(a: Subject, b: Subject) -> bool {
    return overlap(a, b);
}
