//! The output of a program, and its exit status.

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use std::fmt;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// The reason why the program ends with a status other than 0.
#[derive(Debug)]
pub enum Failure {
    /// A check failed: status 1.
    Check(String),
    /// Bad usage or bad input: status 2.
    Input(String),
}

impl Failure {
    pub fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Check(_) => 1,
            Self::Input(_) => 2,
        })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Check(message) | Self::Input(message)) = self;
        // One short line, even if a file or a name contains long or strange text.
        const LONGEST: usize = 600;
        let plain = message.chars().map(|c| if c.is_control() { ' ' } else { c });
        let end = if message.chars().count() > LONGEST { "..." } else { "" };
        write!(f, "{}{end}", plain.take(LONGEST).collect::<String>().trim_end())
    }
}

impl From<pbig_core::Error> for Failure {
    fn from(error: pbig_core::Error) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<String> for Failure {
    fn from(message: String) -> Self {
        Self::Input(message)
    }
}

/// Prints to stdout. A reader that has gone away (`pbig scenes | head -1`) is not an error.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    let newline = if text.ends_with('\n') { "" } else { "\n" };
    match write!(stdout, "{text}{newline}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::Input(format!("stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints to stderr, for what stdout must not hold.
pub fn print_aside(text: &str) {
    // Nothing is left to do if stderr is closed.
    _ = std::io::stderr().write_all(format!("{text}\n").as_bytes());
}

/// Prints a warning to stderr.
pub fn warn(what: &str) {
    print_aside(&format!("pbig: warning: {}", what.replace(char::is_control, " ")));
}

/// Ends a program: an error is one line on stderr.
pub fn finish(program: &str, result: Result<(), Failure>) -> ExitCode {
    let Err(failure) = result else { return ExitCode::SUCCESS };
    print_aside(&format!("{program}: {failure}"));
    failure.code()
}

/// A progress bar on stderr, when that is a terminal.
pub fn progress(length: usize, what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}").expect("a template");
    let bar = ProgressBar::new(length as u64).with_message(what).with_style(style);
    bar.with_finish(ProgressFinish::AndClear)
}

/// Returns the items one by one, and shows how many are done.
pub fn tracked<T>(items: impl IntoIterator<Item = T>, what: &'static str) -> impl Iterator<Item = T> {
    let items: Vec<T> = items.into_iter().collect();
    progress(items.len(), what).wrap_iter(items.into_iter())
}

/// Returns a failed check unless something holds.
pub fn check(holds: bool, message: impl FnOnce() -> String) -> Result<(), Failure> {
    if holds { Ok(()) } else { Err(Failure::Check(message())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_of_bearable_length() {
        let text = Failure::Input(format!("a\nb\u{1b}[1m{}", "x".repeat(10_000))).to_string();
        assert!(text.starts_with("a b [1mx") && text.len() < 700, "{text}");
    }
}
