//! Options that several commands share.

use crate::output::Failure;
use pbig_core::Report;

/// Runs `work` on `threads` threads, or on all.
pub(crate) fn with_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    let Some(threads) = threads else { return work() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Failure::Input(format!("--threads {threads}: {error}")))?.install(work)
}

/// A count of at least one.
pub(crate) fn positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".into()),
        Ok(count) => Ok(count),
        Err(_) => Err("must be a whole number".into()),
    }
}

/// Stage times in milliseconds, by name.
pub(crate) fn stages(report: &Report) -> serde_json::Value {
    let ms = |time: std::time::Duration| serde_json::Value::from(time.as_secs_f64() * 1e3);
    let named = report.stages.named().map(|(name, time)| (name.to_string(), ms(time)));
    named.into_iter().collect::<serde_json::Map<_, _>>().into()
}
