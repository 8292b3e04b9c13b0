//! The choice of an adapter.

use super::GpuError;

/// Returns all adapters, best first. Of several a browser shows one.
pub(super) async fn best_first() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::all());
    let mut adapters = instance.enumerate_adapters(backends).await;
    let low = wgpu::PowerPreference::from_env() == Some(wgpu::PowerPreference::LowPower);
    adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type, low));
    adapters
}

/// Returns the rank of a kind of adapter, best first, and its name.
fn kind_of(kind: wgpu::DeviceType) -> (usize, &'static str) {
    match kind {
        wgpu::DeviceType::DiscreteGpu => (0, "discrete"),
        wgpu::DeviceType::IntegratedGpu => (1, "integrated"),
        wgpu::DeviceType::VirtualGpu => (2, "virtual"),
        wgpu::DeviceType::Other => (3, "unknown kind"),
        wgpu::DeviceType::Cpu => (4, "software"),
    }
}

fn rank(kind: wgpu::DeviceType, low_power: bool) -> usize {
    let (rank, _) = kind_of(kind);
    // For low power the first two kinds change places.
    if low_power && rank < 2 { 1 - rank } else { rank }
}

/// Returns the adapter of the given name, or of `WGPU_ADAPTER_NAME`, or the best.
pub(super) async fn choose(name: Option<&str>) -> Result<wgpu::Adapter, GpuError> {
    check_api()?;
    let named = std::env::var("WGPU_ADAPTER_NAME").ok().filter(|_| name.is_none());
    let all = best_first().await;
    let names: Vec<_> = all.iter().map(|adapter| adapter.get_info().name).collect();
    let api = std::env::var("WGPU_BACKEND").ok().filter(|_| names.is_empty());
    let cause = api.map(|api| format!("WGPU_BACKEND={api:?} leaves out other APIs"));
    let cause = cause.or(named.as_ref().map(|_| "WGPU_ADAPTER_NAME has that name".to_owned()));
    let place = place_of(name.or(named.as_deref()), &names).map_err(|error| blame(error, cause))?;
    Ok(all[place].clone())
}

/// Adds what leaves no adapter.
fn blame(error: GpuError, cause: Option<String>) -> GpuError {
    match (error, cause) {
        (GpuError::NoAdapter(what), Some(cause)) => GpuError::NoAdapter(format!("{what}; {cause}")),
        (error, _) => error,
    }
}

/// Returns the place of the first adapter with the wanted name. A part of the name is enough, in any case.
fn place_of(wanted: Option<&str>, names: &[String]) -> Result<usize, GpuError> {
    let part = wanted.unwrap_or_default().to_lowercase();
    names.iter().position(|name| name.to_lowercase().contains(&part)).ok_or_else(|| {
        let wanted = wanted.map(|name| format!(" named {name:?}")).unwrap_or_default();
        let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        GpuError::NoAdapter(format!("{wanted}; found: {found}"))
    })
}

/// Returns an error if `WGPU_BACKEND` names no API that wgpu knows.
fn check_api() -> Result<(), GpuError> {
    match std::env::var("WGPU_BACKEND") {
        Ok(api) if wgpu::Backends::from_comma_list(&api).is_empty() => Err(GpuError::NoAdapter(format!(
            ": WGPU_BACKEND={api:?} names no API (known: vulkan, metal, dx12)"
        ))),
        _ => Ok(()),
    }
}

/// Returns an adapter's name, kind and API, as reports show them.
pub fn describe(info: &wgpu::AdapterInfo) -> String {
    format!("{} ({}, {})", info.name, kind_of(info.device_type).1, info.backend)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn software_comes_last_and_low_power_prefers_integrated() {
        use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu, Other, VirtualGpu};
        let best_first = |low| {
            let mut kinds = [Cpu, Other, VirtualGpu, IntegratedGpu, DiscreteGpu];
            kinds.sort_by_key(|&kind| rank(kind, low));
            kinds
        };
        assert_eq!(best_first(false), [DiscreteGpu, IntegratedGpu, VirtualGpu, Other, Cpu]);
        assert_eq!(best_first(true)[..2], [IntegratedGpu, DiscreteGpu]);
    }

    #[test]
    fn a_part_of_a_name_in_any_case_chooses_an_adapter() {
        let names = ["Iris Xe", "llvmpipe (LLVM 15)"].map(str::to_owned);
        assert_eq!(
            [None, Some("xe"), Some("LLVMPIPE")].map(|name| place_of(name, &names)),
            [Ok(0), Ok(0), Ok(1)]
        );
        let why = |names: &[String]| place_of(Some("no such"), names).unwrap_err().to_string();
        assert_eq!(why(&names), r#"no GPU adapter named "no such"; found: Iris Xe, llvmpipe (LLVM 15)"#);
        assert_eq!(why(&[]), r#"no GPU adapter named "no such"; found: none"#);
        let none = place_of(None, &[]).unwrap_err();
        assert_eq!(blame(none.clone(), None).to_string(), "no GPU adapter; found: none");
        let blamed = blame(none, Some("a variable".into())).to_string();
        assert_eq!(blamed, "no GPU adapter; found: none; a variable");
    }
}
