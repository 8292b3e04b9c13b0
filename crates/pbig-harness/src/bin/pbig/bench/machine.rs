//! The machine on which times are measured.

use crate::doctor::simd_found;
use serde_json::{Value, json};

pub(crate) struct Machine {
    pub(crate) cpu: String,
    cores: usize,
    threads: usize,
    simd: String,
    /// The day, in UTC.
    pub(crate) day: String,
}

impl Machine {
    pub(crate) fn here() -> Self {
        Self {
            cpu: cpu_model().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            threads: rayon::current_num_threads(),
            simd: simd_found().join(" "),
            day: time::OffsetDateTime::now_utc().date().to_string(),
        }
    }

    pub(crate) fn line(&self) -> String {
        let Self { cpu, cores, threads, simd, day } = self;
        format!("{cpu}, {cores} cores, {threads} threads, SIMD found: {simd}; {day}")
    }

    pub(crate) fn object(&self) -> Value {
        let Self { cpu, cores, threads, simd, .. } = self;
        json!({ "cpu": cpu, "cores": cores, "threads": threads, "simd": simd })
    }
}

/// As Linux tells it.
fn cpu_model() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// A name as a part of a file's name.
pub(crate) fn slug(name: &str) -> String {
    let lower = name.to_lowercase();
    let words = lower.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests {
    use super::slug;

    #[test]
    fn a_name_becomes_a_part_of_a_files_name() {
        assert_eq!(slug("AMD EPYC(tm) 9B14 / 2.6 GHz"), "amd-epyc-tm-9b14-2-6-ghz");
    }
}
