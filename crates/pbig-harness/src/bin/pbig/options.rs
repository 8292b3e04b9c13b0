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

/// A number of threads: beyond the most, starting them takes longer than any work.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    const MOST: usize = 1024;
    match positive(text)? {
        count if count > MOST => Err(format!("must be at most {MOST}")),
        count => Ok(count),
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
