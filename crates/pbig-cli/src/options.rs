//! Options that several commands share.

use pbig_core::{Error, Report};
use pbig_harness::output::Failure;
use std::num::IntErrorKind;

/// Runs `work` on `threads` threads, or on all.
pub(crate) fn with_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    let Some(threads) = threads else { return work() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Failure::Input(format!("--threads {threads}: {error}")))?.install(work)
}

/// A whole number within bounds; which one is broken is told of a number of any length.
fn whole(text: &str, least: u64, most: u64) -> Result<u64, String> {
    let number = text.parse::<i128>().or_else(|error| match error.kind() {
        IntErrorKind::PosOverflow => Ok(i128::MAX),
        IntErrorKind::NegOverflow => Ok(i128::MIN),
        _ => Err("must be a whole number"),
    })?;
    if number < i128::from(least) {
        return Err(format!("must be at least {least}"));
    }
    u64::try_from(number).ok().filter(|&fits| fits <= most).ok_or_else(|| format!("must be at most {most}"))
}

fn count_up_to(text: &str, most: usize) -> Result<usize, String> {
    whole(text, 1, most as u64).map(|count| count as usize)
}

/// A count of at least one.
pub(crate) fn positive(text: &str) -> Result<usize, String> {
    count_up_to(text, usize::MAX)
}

/// A number of threads: beyond the most, starting them takes longer than any work.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    count_up_to(text, 1024)
}

/// A number of bodies: beyond the most, no machine has the memory for a world of them.
pub(crate) fn bodies(text: &str) -> Result<usize, String> {
    count_up_to(text, 10_000_000)
}

/// Parses the seed of random numbers.
pub(crate) fn seed(text: &str) -> Result<u64, String> {
    whole(text, 0, u64::MAX)
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

/// Returns the message of an error, with a remedy that the program's user has.
pub(crate) fn search_text(error: &Error) -> String {
    let way_out = "for more, use the crate pbig-core with larger `Limits`";
    match error {
        Error::TooManyBoxes { boxes, limit } => format!("{boxes} boxes are more than {limit}; {way_out}"),
        Error::TooManyPairs { limit } => format!("more than {limit} overlapping pairs; {way_out}"),
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
    let ms = |time: std::time::Duration| serde_json::Value::from(time.as_secs_f64() * 1e3);
    let named = report.stages.named().map(|(name, time)| (name.to_string(), ms(time)));
    named.into_iter().collect::<serde_json::Map<_, _>>().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_come_with_what_a_user_of_the_program_can_do() {
        let pairs = search_text(&Error::TooManyPairs { limit: 268_435_456 });
        assert!(pairs.starts_with("more than 268435456 overlapping pairs; for more, use"), "{pairs}");
        let boxes = search_text(&Error::TooManyBoxes { boxes: 9, limit: 8 });
        assert!(boxes.starts_with("9 boxes are more than 8; for more, use"), "{boxes}");
        assert!([pairs, boxes].iter().all(|text| !text.contains("raise")));
    }
}
