//! The programs for rapier 0.36.1 in the documents, which are not run there: each of their lines stands here.
#![cfg(not(any(feature = "dim2", feature = "f64")))]

use rapier::prelude::*;
use std::path::Path;

fn text_of(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the lines of the programs of a document that are not run, without what stands behind `//`.
fn lines(document: &str) -> Vec<String> {
    let text = text_of(document);
    let programs = text.split("```rust,ignore\n").skip(1).filter_map(|rest| rest.split("```").next());
    let code = |line: &str| line.split(" //").next().unwrap_or_default().trim().to_owned();
    programs.flat_map(str::lines).map(code).filter(|line| !line.is_empty()).collect()
}

#[test]
fn each_line_of_the_programs_is_compiled() {
    let own = include_str!("documents.rs");
    let lines = ["README.md", "docs/GETTING_STARTED.md"].map(lines).concat();
    assert!(lines.len() > 20, "{lines:?}");
    let missing: Vec<_> = lines.iter().filter(|line| !own.contains(line.as_str())).collect();
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn one_line_puts_pbig_into_a_world_that_is_asked_and_saved() -> Result<(), postcard::Error> {
    let mut world = PhysicsWorld::new();
    rapier_pbig::install(&mut world.broad_phase);
    let (_, ground) = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(10.0, 0.5, 10.0));
    #[rustfmt::skip]
    let (_, ball) = world.insert(RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 3.0, 0.0)), ColliderBuilder::ball(0.5));
    world.step();
    let pbig = rapier_pbig::finder(&world.broad_phase).expect("it is installed");
    println!("{}", pbig.why(ball, ground));
    assert!(matches!(pbig.why(ball, ground), rapier_pbig::Why::Apart { axis: 1, .. }));

    let saved = postcard::to_stdvec(&world)?;
    let mut world: PhysicsWorld = postcard::from_bytes(&saved)?;
    assert!(!rapier_pbig::is_installed(&world.broad_phase));
    rapier_pbig::install(&mut world.broad_phase);
    debug_assert!(rapier_pbig::is_installed(&world.broad_phase));
    for _ in 0..200 {
        world.step();
    }
    assert!((world.colliders[ball].translation().y - 1.0).abs() < 0.05);
    Ok(())
}

#[test]
fn a_shadow_compares_each_update() {
    let mut world = PhysicsWorld::new();
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(10.0, 0.5, 10.0));
    let at = Vector::new(0.0, 3.0, 0.0);
    world.insert(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.5));
    use rapier_pbig::{PbigFinder, Shadow};

    let finder = PbigFinder::default().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    rapier_pbig::install_finder(&mut world.broad_phase, finder);
    for _ in 0..300 {
        world.step();
    }
    let checker = rapier_pbig::shadow::checker(&world.broad_phase).expect("a shadow");
    println!("{} updates compared", checker.compared);
    assert!(checker.differences.is_empty(), "{}", checker.differences[0]);
    assert!(checker.compared > 30);
}

#[test]
fn the_patch_is_as_long_as_the_documents_say() {
    let patch = text_of("patches/rapier3d+0.36.1.patch");
    let count = |sign: char, header: &str| {
        patch.lines().filter(|line| line.starts_with(sign) && !line.starts_with(header)).count()
    };
    let said = format!("{} lines added, {} removed", count('+', "+++ "), count('-', "--- "));
    assert!(text_of("docs/DROP_IN.md").contains(&said), "{said}");
}
