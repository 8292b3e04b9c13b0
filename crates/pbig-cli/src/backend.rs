//! Options that choose the backend and its adapter, and what a run on a GPU owes its user.

use pbig_core::{BroadPhase, Config, Finder, PairDevice};
use pbig_gpu::{DECLINED, GpuFinder};
use pbig_harness::options::BackendOption;
use pbig_harness::output::{Failure, warn};
use rapier_pbig::PbigBroadPhase;

#[derive(clap::Args)]
pub(crate) struct BackendArgs {
    /// The backend that searches.
    #[arg(long = "backend", value_enum, default_value_t)]
    kind: BackendOption,
    /// With `--backend gpu`: the adapter, by a part of its name in any case, or by its number in `pbig doctor`. Without it WGPU_ADAPTER_NAME chooses, or the best is taken.
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// With `--backend gpu`: status 1, without output, unless a GPU does all the work. A software adapter is not a GPU.
    #[arg(long)]
    require_gpu: bool,
}

impl BackendArgs {
    /// Returns a finder for one set of boxes.
    pub(crate) fn finder(&self) -> Result<Finder, Failure> {
        let config = Config { backend: self.kind.backend(), ..Config::DEFAULT };
        Ok(match self.device()? {
            Some(device) => Finder::with_device(config, device),
            None => Finder::new(config),
        })
    }

    /// Returns a finder for two sets or a mesh, which no device searches.
    pub(crate) fn finder_on_cpu(&self) -> Result<Finder, Failure> {
        self.check_options()?;
        let why = "a search with --with or --mesh runs on the CPU";
        if self.require_gpu {
            return Err(required(why));
        }
        if self.adapter.is_some() {
            return Err(Failure::Input(format!("--adapter: {why}")));
        }
        Ok(Finder::new(Config { backend: self.kind.backend(), ..Config::DEFAULT }))
    }

    pub(crate) fn broad_phase(&self, margin: f32) -> Result<BroadPhase, Failure> {
        let config = Config { margin, backend: self.kind.backend(), ..Config::DEFAULT };
        let made = match self.device()? {
            Some(device) => BroadPhase::with_device(config, device),
            None => BroadPhase::new(config),
        };
        made.map_err(|error| Failure::Input(format!("--margin: {error}")))
    }

    pub(crate) fn for_rapier(&self) -> Result<PbigBroadPhase, Failure> {
        Ok(self.kind.for_rapier_on(self.device()?))
    }

    /// See [`BackendOption::in_use`].
    pub(crate) fn in_use(&self, fallback: Option<&str>) -> &'static str {
        self.kind.in_use(fallback)
    }

    /// Returns the device to search on, if one is asked for.
    fn device(&self) -> Result<Option<Box<dyn PairDevice>>, Failure> {
        self.check_options()?;
        if self.kind != BackendOption::Gpu {
            return Ok(None);
        }
        let gpu = self.gpu()?;
        self.check_adapter(gpu.adapter())?;
        Ok(Some(Box::new(gpu)))
    }

    /// Opens the adapter. If a GPU is required, fails before the search.
    fn gpu(&self) -> Result<GpuFinder, Failure> {
        let mut gpu = match &self.adapter {
            Some(name) => {
                let gpu = pbig_gpu::adapter(Some(name)).and_then(|adapter| GpuFinder::on(&adapter));
                gpu.map_err(|error| self.no_adapter(format!("--adapter {name}: {error}")))?
            }
            None => GpuFinder::shared(),
        };
        match gpu.prepare() {
            Err(why) if self.require_gpu => Err(required(&why.to_string())),
            // The report of the search has the reason of a failure.
            _ => Ok(gpu),
        }
    }

    fn no_adapter(&self, why: String) -> Failure {
        if self.require_gpu { required(&why) } else { Failure::Input(why) }
    }

    /// Warns of a software adapter, or refuses it, before its long work.
    fn check_adapter(&self, name: &str) -> Result<(), Failure> {
        if !is_software(name) {
            return Ok(());
        }
        if self.require_gpu {
            return Err(required(&format!("{name} is a software adapter")));
        }
        warn(&format!(
            "{name} is a program on the CPU, slower than --backend cpu; `pbig doctor` says why no GPU is found"
        ));
        Ok(())
    }

    /// Refuses options that would have no effect.
    fn check_options(&self) -> Result<(), Failure> {
        match self.option_of_gpu() {
            Some(option) if self.kind != BackendOption::Gpu => {
                Err(Failure::Input(format!("{option} needs --backend gpu")))
            }
            _ => Ok(()),
        }
    }

    /// Returns an option that only a GPU has, if one is given.
    pub(crate) fn option_of_gpu(&self) -> Option<&'static str> {
        let of_gpu = [("--adapter", self.adapter.is_some()), ("--require-gpu", self.require_gpu)];
        of_gpu.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
    }

    /// Warns of work that no GPU did. If a GPU is required and did not do all the work, fails with the reason.
    pub(crate) fn check_use(&self, adapter: Option<&str>, fallback: Option<&str>) -> Result<(), Failure> {
        if let (true, Some(why)) = (self.require_gpu, no_gpu(adapter, fallback)) {
            return Err(required(&why));
        }
        if let Some(why) = fallback {
            warn(&format!("{}; `pbig doctor` says more", plain(why)));
        }
        Ok(())
    }
}

/// Returns the failure of `--require-gpu` for this reason.
fn required(why: &str) -> Failure {
    Failure::Check(format!("--require-gpu: {why}"))
}

/// Returns the reason why the work was not all done by a GPU.
fn no_gpu(adapter: Option<&str>, fallback: Option<&str>) -> Option<String> {
    match (fallback, adapter) {
        (Some(why), _) => Some(plain(why)),
        (None, None) => Some("there was no work for a GPU".into()),
        (None, Some(name)) => is_software(name).then(|| format!("{name} is a software adapter")),
    }
}

/// Returns the reason of a fallback in the words of the command line, which has no options of the library.
fn plain(why: &str) -> String {
    let why = why.strip_suffix(": the CPU does the work").unwrap_or(why);
    let why = why.replace("the device or GpuOptions::max_bytes", "the device");
    let why = why.replace("GpuOptions::max_total_bytes", "pbig").replace(" (GpuOptions::patience)", "");
    match why.strip_prefix(DECLINED) {
        Some(why) => format!("the GPU declined the boxes: {why}"),
        None => format!("the CPU did work: {why}"),
    }
}

/// Returns true for a description of a software adapter, such as `llvmpipe (LLVM 15) (software, vulkan)`.
pub(crate) fn is_software(adapter: &str) -> bool {
    adapter.rsplit_once(" (").is_some_and(|(_, kind)| kind.starts_with("software, "))
}

/// Returns a line of a summary about the adapter that did the work, if one did.
pub(crate) fn adapter_line(adapter: Option<&str>) -> String {
    adapter.map_or(String::new(), |name| format!("\nadapter: {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_gpu::GpuError;
    use std::time::Duration;

    #[test]
    fn only_hardware_that_did_all_the_work_is_a_gpu() {
        let hardware = Some("NVIDIA H100 (software edition) (discrete, vulkan)");
        assert_eq!(no_gpu(hardware, None), None);
        assert_eq!(no_gpu(hardware, Some("it was lost")).as_deref(), Some("the CPU did work: it was lost"));
        let declined = |what: &str| {
            no_gpu(hardware, Some(&format!("{DECLINED}{what}: the CPU does the work"))).expect("a reason")
        };
        assert_eq!(
            declined("the buffer out needs 9 bytes, but the device or GpuOptions::max_bytes allows 8"),
            "the GPU declined the boxes: the buffer out needs 9 bytes, but the device allows 8"
        );
        assert_eq!(
            declined("the device's buffers need 9 bytes, but GpuOptions::max_total_bytes allows 8"),
            "the GPU declined the boxes: the device's buffers need 9 bytes, but pbig allows 8"
        );
        let late = format!("{}: the CPU does the work", GpuError::Timeout(Duration::from_secs(30)));
        let late = no_gpu(hardware, Some(&late));
        assert_eq!(late.as_deref(), Some("the CPU did work: the device did not answer within 30s"));
        assert_eq!(no_gpu(None, None).as_deref(), Some("there was no work for a GPU"));
        let software = no_gpu(Some("llvmpipe (LLVM 15) (software, vulkan)"), None);
        assert_eq!(software.as_deref(), Some("llvmpipe (LLVM 15) (software, vulkan) is a software adapter"));
    }
}
