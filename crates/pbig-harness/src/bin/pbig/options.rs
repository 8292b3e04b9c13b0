//! Options that several commands share.

use crate::output::Failure;
use clap::ValueEnum;
use pbig_core::{Backend, Config, Report};

/// `--backend`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendOption {
    /// What is expected to be fastest.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// A GPU; without one the CPU does the work and the output says so.
    Gpu,
    /// Every pair is tested.
    Brute,
}

impl BackendOption {
    /// The settings that this asks for.
    pub(crate) fn config(self) -> Config {
        let backend = match self {
            Self::Auto => Backend::Auto,
            Self::Cpu => Backend::Cpu,
            Self::Gpu => Backend::Gpu,
            Self::Brute => Backend::Brute,
        };
        Config { backend, ..Config::DEFAULT }
    }

    /// The backend that does the work.
    pub(crate) fn in_use(self) -> &'static str {
        if self == Self::Brute { "brute" } else { "cpu" }
    }
}

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
