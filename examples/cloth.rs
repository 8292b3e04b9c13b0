//! Self-collision candidates of a cloth over a step: edges with edges, and vertices with faces, without neighbours.
//!
//! `cargo run --release --example cloth`

use pbig_core::{Aabb, Boxes, Error, Finder, Keys, NO_KEY};

const SIDE: u32 = 100;

/// Returns the place of a vertex of a cloth that folds over a ball.
fn place(vertex: u32, time: f32) -> [f32; 3] {
    let [x, y] = [vertex % SIDE, vertex / SIDE].map(|i| i as f32 - 49.5);
    let angle = x * (0.01 + 0.05 * time);
    [angle.sin() * 20.0, y, angle.cos() * 20.0 * (1.0 + 0.02 * y.sin())]
}

/// Returns the box of some vertices, and their straight ways during a step.
fn swept(corners: &Keys) -> Aabb {
    let ways =
        corners.iter().filter(|vertex| **vertex != NO_KEY).flat_map(|v| [place(*v, 1.0), place(*v, 1.01)]);
    ways.fold(Aabb::NOWHERE, |all, at| all.union(&Aabb::new(at, at)))
}

fn main() -> Result<(), Error> {
    let vertices: Vec<Keys> = (0..SIDE * SIDE).map(|v| [v, NO_KEY, NO_KEY, NO_KEY]).collect();
    let inner = (0..SIDE * (SIDE - 1)).filter(|v| v % SIDE < SIDE - 1);
    let faces: Vec<Keys> =
        inner.flat_map(|v| [[v, v + 1, v + SIDE, NO_KEY], [v + 1, v + SIDE + 1, v + SIDE, NO_KEY]]).collect();
    let ends = |[u, v, w, _]: &Keys| {
        [[*u, *v], [*v, *w], [*w, *u]].map(|[a, b]| [a.min(b), a.max(b), NO_KEY, NO_KEY])
    };
    let mut edges: Vec<Keys> = faces.iter().flat_map(ends).collect();
    edges.sort_unstable();
    edges.dedup();
    let [v, e, f] = [&vertices, &edges, &faces].map(|all| all.iter().map(swept).collect::<Vec<Aabb>>());

    // Elements that share a vertex always touch, so their keys leave them out.
    let mut finder = Finder::default();
    let edge_edge = finder.find_without_shared(&e, &edges)?.len();
    let (v, f) = (Boxes::new(&v).with_keys(&vertices), Boxes::new(&f).with_keys(&faces));
    let vertex_face = finder.find_between(v, f)?.len();
    println!("{edge_edge} pairs of edges, {vertex_face} pairs of a vertex and a face");
    // Where nothing but a count or a sum is wanted, no list is needed.
    assert_eq!(finder.for_each_pair_between(v, f, |_| ())?, vertex_face as u64);
    Ok(())
}
