//! Arguments that cannot be: one line on stderr that names the option, its bounds and where they are listed.

use super::{pbig, refused};

/// The one line on stderr, without the program's name.
fn line(args: &[&str]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    refused(&pbig(folder.path(), args), &["pbig: "]).replacen("pbig: ", "", 1)
}

#[test]
fn numbers_out_of_bounds_are_told_the_bound() {
    for (command, option, value, why) in [
        ("simulate", "--bodies", "10000001", "must be a whole number from 1 to 10000000"),
        ("simulate", "--bodies", "-5", "must be a whole number from 1 to 10000000"),
        ("simulate", "--bodies", "many", "must be a whole number from 1 to 10000000"),
        ("simulate", "--steps", "-1", "must be a whole number from 1 to 18446744073709551615"),
        ("simulate", "--seed", "-1", "must be a whole number from 0 to 18446744073709551615"),
        (
            "simulate",
            "--seed",
            "18446744073709551616",
            "must be a whole number from 0 to 18446744073709551615",
        ),
        ("pairs", "--threads", "0", "must be a whole number from 1 to 1024"),
        ("pairs", "--threads", "99999999999", "must be a whole number from 1 to 1024"),
        ("pairs", "--repeat", "1.5", "must be a whole number from 1 to 18446744073709551615"),
        ("pairs", "--repeat", &"9".repeat(40), "must be a whole number from 1 to 18446744073709551615"),
        ("replay", "--margin", "-1", "must be at least 0"),
        ("replay", "--margin", "-1e40", "must be at least 0"),
        ("replay", "--margin", "1e40", "must be at most 3.4028235e38, the largest f32"),
        ("replay", "--margin", "inf", "must be at most 3.4028235e38, the largest f32"),
        ("replay", "--margin", "nan", "must be a number"),
    ] {
        let wanted = format!("{option} {value}: {why} (see pbig {command} --help)");
        assert_eq!(line(&[command, option, value]), wanted);
        assert_eq!(line(&[command, &format!("{option}={value}")]), wanted);
    }
}

#[test]
fn every_error_names_the_help_and_guesses_nothing() {
    for (args, wanted) in [
        (
            &["pairs", "x.npy", "--output", "y"][..],
            "unexpected argument '--output' found (see pbig pairs --help)",
        ),
        (&["replay", "x.npy", "-1"], "unexpected argument '-1' found (see pbig replay --help)"),
        (&["doctor", "x"], "unexpected argument 'x' found (see pbig doctor --help)"),
        (
            &[],
            "a command is missing: pairs, replay, simulate, scenes, bench, accuracy or doctor (see pbig --help)",
        ),
        (&["pears"], "unrecognized subcommand 'pears' (see pbig --help)"),
        (&["--jsn", "pairs"], "unexpected argument '--jsn' found (see pbig --help)"),
        (
            &["pairs", "x.npy", "--elements", "ee"],
            "the argument '[INPUT]' cannot be used with '--elements <KINDS>' (see pbig pairs --help)",
        ),
        (
            &["pairs", "x.npy", "--next", "y.obj"],
            "the argument '[INPUT]' cannot be used with '--next <FRAME>' (see pbig pairs --help)",
        ),
        (&["pairs"], "the following required arguments were not provided: <INPUT> (see pbig pairs --help)"),
    ] {
        assert_eq!(line(args), wanted, "{args:?}");
    }
    let scene = line(&["simulate", "--scene", "colum"]);
    assert!(scene.contains("colum") && scene.contains("column, spheres"), "{scene}");
    for args in [&["pairs", "x.npy", "--backend", "gpo"][..], &["bench", "stage"]] {
        let line = line(args);
        assert!(line.contains("possible values") && !line.contains("tip"), "{line}");
        assert!(line.ends_with(&format!("(see pbig {} --help)", args[0])), "{line}");
    }
}

#[test]
fn what_stock_would_ignore_is_refused() {
    let stock = ["simulate", "--scene", "column", "--broad-phase", "stock"];
    let line = line(&[&stock[..], &["--check"]].concat());
    let wanted = "leave out --check or --broad-phase stock";
    assert!(line.starts_with("--check is for pbig") && line.ends_with(wanted), "{line}");
    let line = self::line(&[&stock[..], &["--require-gpu"]].concat());
    assert!(
        line.starts_with("--require-gpu is for pbig") && line.contains("leave out --require-gpu or"),
        "{line}"
    );
}

/// Returns the words of a text that begin with two hyphens.
fn options(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !c.is_ascii_lowercase() && c != '-');
    words.filter(|word| word.strip_prefix("--").is_some_and(|name| name.starts_with(char::is_alphabetic)))
}

#[test]
fn every_option_of_the_document_is_one_of_the_program() {
    let document =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/CLI.md")).expect("CLI.md");
    let (of_program, _) = document.split_once("\n## The viewer").expect("another program's options");
    let help = |command: &&str| pbig(std::path::Path::new("."), &[command, "--help"]).stdout;
    let commands = ["pairs", "replay", "simulate", "bench", "doctor"];
    let help = String::from_utf8(commands.iter().flat_map(help).collect()).expect("UTF-8");
    let known: Vec<&str> = options(&help).chain(["--bin", "--release"]).collect();
    let unknown: Vec<&str> = options(of_program).filter(|option| !known.contains(option)).collect();
    assert!(known.contains(&"--require-gpu") && unknown.is_empty(), "{unknown:?}");
    assert_eq!(help.matches("A software adapter is not a GPU").count(), 3, "{help}");
}
