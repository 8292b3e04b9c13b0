//! The one way to print and to write what a suite has measured.

use crate::chart::Chart;
use crate::output::{Failure, print};
use crate::table::Table;
use serde_json::{Value, json};
use std::path::Path;

#[derive(Clone, Debug, Default)]
pub struct BenchReport {
    /// The name of the suite, with which the names of its files begin.
    pub suite: String,
    /// Conditions of the run besides the machine, each with its name.
    pub head: Vec<(&'static str, String)>,
    pub tables: Vec<Table>,
    pub charts: Vec<Chart>,
    /// The conclusion, for a person; empty if there is none.
    pub verdict: String,
}

impl BenchReport {
    /// Returns a report without conditions and charts.
    pub fn new(suite: &str, tables: Vec<Table>) -> Self {
        Self { suite: suite.into(), tables, ..Self::default() }
    }

    fn heads(&self) -> impl Iterator<Item = (&'static str, String)> + '_ {
        machine().into_iter().chain(self.head.clone())
    }

    /// Returns the name and the content of each table's file: conditions in lines that begin with `#`, then one row a case.
    pub fn files(&self) -> Vec<(String, String)> {
        let head: String = self.heads().map(|(name, value)| format!("# {name}: {value}\n")).collect();
        let name = |table: &Table| match self.tables.len() {
            1 => format!("{}.csv", self.suite),
            _ => format!("{}-{}.csv", self.suite, table.file_name()),
        };
        self.tables.iter().map(|table| (name(table), format!("{head}{}", table.csv()))).collect()
    }

    pub fn object(&self) -> Value {
        let head: serde_json::Map<_, _> =
            self.heads().map(|(name, value)| (name.into(), json!(value))).collect();
        let tables: serde_json::Map<_, _> =
            self.tables.iter().map(|table| (table.name.clone(), table.object())).collect();
        json!({ "suite": self.suite, "head": head, "tables": tables, "verdict": self.verdict })
    }

    /// Prints the tables, or one JSON object; writes the files and the charts if there is a folder for them.
    pub fn finish(&self, as_json: bool, folder: Option<&Path>) -> Result<(), Failure> {
        if as_json {
            print(&self.object().to_string())?;
        } else {
            let head: String = self.heads().map(|(name, value)| format!("{name}: {value}\n")).collect();
            print(&(head + &self.tables.iter().map(Table::show).collect::<String>() + &self.verdict))?;
        }
        folder.map_or(Ok(()), |folder| self.write(folder))
    }

    /// Writes a file for each table, and the charts, into a folder, which is made if there is none.
    pub fn write(&self, folder: &Path) -> Result<(), Failure> {
        let named = |path: &Path| format!("{}: ", path.display());
        std::fs::create_dir_all(folder).map_err(|error| named(folder) + &error.to_string())?;
        for (name, content) in self.files() {
            let path = folder.join(name);
            std::fs::write(&path, content).map_err(|error| named(&path) + &error.to_string())?;
        }
        self.charts.iter().try_for_each(|chart| chart.write(&folder.join(format!("{}.svg", chart.name))))?;
        Ok(())
    }
}

/// Returns the machine, the day and the commit of a run.
fn machine() -> Vec<(&'static str, String)> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    vec![
        ("machine", cpu_model().unwrap_or_else(|| std::env::consts::ARCH.to_owned())),
        ("cores", cores.to_string()),
        ("threads", rayon::current_num_threads().to_string()),
        ("simd", simd_found().join(" ")),
        ("day", time::OffsetDateTime::now_utc().date().to_string()),
        ("commit", commit().unwrap_or_else(|| "unknown".into())),
    ]
}

/// Returns the processor's name as Linux gives it.
fn cpu_model() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Returns the commit of the sources, where they still are.
fn commit() -> Option<String> {
    let args = ["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--dirty", "--exclude", "*"];
    let output = std::process::Command::new("git").args(args).output().ok()?;
    let name = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !name.is_empty()).then_some(name)
}

/// Returns the SIMD extensions of this processor; of others than x86-64 the architecture, which implies its extensions.
pub fn simd_found() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let found = [(std::env::consts::ARCH, true)];
    found.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells;

    fn table(name: &str) -> Table {
        let mut table = Table::new(name, "case | ms");
        table.row(cells!["a, b", 0.5]);
        table
    }

    #[test]
    fn each_table_has_a_file_and_an_error_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("inner");
        let tables = vec![table("one"), table("Two")];
        BenchReport::new("suite", tables.clone()).write(&inner).expect("written");
        assert!(inner.join("suite-one.csv").is_file() && inner.join("suite-two.csv").is_file());
        let error =
            BenchReport::new("suite", tables).write(&inner.join("suite-one.csv")).expect_err("no folder");
        assert!(error.to_string().contains("suite-one.csv"), "{error}");
    }
}
