//! Options that several commands share.

use pbig_core::{Error, Report};
use pbig_harness::files;
use pbig_harness::output::{Failure, print, print_aside};
use pbig_harness::runner::milliseconds;
use std::ops::RangeInclusive;
use std::path::Path;

/// Runs `work` on `threads` threads, or on all.
pub(crate) fn with_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    let Some(threads) = threads else { return work() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Failure::Input(format!("--threads {threads}: {error}")))?.install(work)
}

/// Checks the file of `-o` or another option before the work.
pub(crate) fn check_output(
    option: &str,
    output: Option<&Path>,
    known: &[&str],
    input: &Path,
    as_json: bool,
) -> Result<(), Failure> {
    let Some(output) = output else { return Ok(()) };
    if files::is_stream(output) && as_json {
        let both = format!("{option} - and --json both write to stdout: leave out one");
        return Err(Failure::Input(both));
    }
    Ok(files::check_output(option, output, known, input)?)
}

/// Prints a summary where it does not mix with an output.
pub(crate) fn print_summary(outputs: &[Option<&Path>], summary: &str) -> Result<(), Failure> {
    if outputs.iter().flatten().any(|output| files::is_stream(output)) {
        print_aside(summary);
        return Ok(());
    }
    print(summary)
}

/// Numbers of threads: beyond the largest, starting them takes longer than any work.
pub(crate) const THREADS: RangeInclusive<u64> = 1..=1024;

/// Numbers of bodies: beyond the largest, no machine has the memory for their world.
pub(crate) const BODIES: RangeInclusive<u64> = 1..=10_000_000;

/// Returns a parser of whole numbers within bounds.
pub(crate) fn whole<T: TryFrom<u64>>(
    bounds: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| {
        let number = text.parse().ok().filter(|number| bounds.contains(number));
        let (least, most) = (bounds.start(), bounds.end());
        let number = number.and_then(|number| number.try_into().ok());
        number.ok_or_else(|| format!("must be a whole number from {least} to {most}"))
    }
}

/// A length for `Config::margin`.
pub(crate) fn margin(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(length) if length < 0.0 => Err("must be at least 0".into()),
        Ok(length) if length > f32::MAX => Err(format!("must be at most {:e}, the largest f32", f32::MAX)),
        Ok(length) if !length.is_nan() => Ok(length),
        _ => Err("must be a number".into()),
    }
}

/// A distance by which boxes grow.
pub(crate) fn thickness(text: &str) -> Result<f64, String> {
    margin(text)?;
    text.parse().map_err(|_| "must be a number".into())
}

/// Checks that stdin is not two inputs.
pub(crate) fn check_inputs(inputs: &[&Path]) -> Result<(), Failure> {
    let streams = inputs.iter().filter(|path| files::is_stream(path)).count();
    if streams < 2 {
        Ok(())
    } else {
        Err(Failure::Input("- is stdin, and cannot be two inputs: name a file".into()))
    }
}

/// Returns the message of an error, with a remedy that the program's user has.
pub(crate) fn search_text(error: &Error) -> String {
    let way_out = "for more, use the crate pbig-core with larger `Limits`";
    match error {
        Error::TooManyBoxes { boxes, limit } => format!("{boxes} boxes are more than {limit}; {way_out}"),
        Error::TooManyPairs { limit } => {
            format!("more than {limit} overlapping pairs, perhaps by a large margin; {way_out}")
        }
        other => other.to_string(),
    }
}

/// The plan in words, and why the wanted backend was not used.
pub(crate) fn plan_text(report: &Report) -> String {
    let why = report.fallback.as_deref().map_or(String::new(), |why| format!("; {why}"));
    format!("{}{why}", report.plan)
}

/// Stage times in milliseconds, by name.
pub(crate) fn stages(report: &Report) -> serde_json::Value {
    report.stages.named().into_iter().map(|(name, time)| (name, milliseconds(time))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_come_with_what_a_user_of_the_program_can_do() {
        let pairs = search_text(&Error::TooManyPairs { limit: 268_435_456 });
        assert!(
            pairs.starts_with("more than 268435456 overlapping pairs, perhaps by a large margin; for"),
            "{pairs}"
        );
        let boxes = search_text(&Error::TooManyBoxes { boxes: 9, limit: 8 });
        assert!(boxes.starts_with("9 boxes are more than 8; for more, use"), "{boxes}");
        assert!([pairs, boxes].iter().all(|text| !text.contains("raise")));
    }
}
