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
    let [api, named] = ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"].map(|name| std::env::var(name).ok());
    if let Some(api) = api.as_ref().filter(|api| wgpu::Backends::from_comma_list(api).is_empty()) {
        let why = format!(": WGPU_BACKEND={api:?} names no API (known: vulkan, metal, dx12)");
        return Err(GpuError::NoAdapter(why));
    }
    let all = best_first().await;
    let names: Vec<_> = all.iter().map(|adapter| adapter.get_info().name).collect();
    let cause = match (api, &named) {
        (Some(api), _) if names.is_empty() => format!("; WGPU_BACKEND={api:?} leaves out other APIs"),
        (_, Some(_)) if name.is_none() => "; WGPU_ADAPTER_NAME has that name".to_owned(),
        _ => String::new(),
    };
    let place =
        place_of(name.or(named.as_deref()), &names).map_err(|why| GpuError::NoAdapter(why + &cause))?;
    Ok(all[place].clone())
}

/// Returns the place of the first adapter with the wanted name, or what was wanted and found. A part of the name is enough, in any
/// case.
fn place_of(wanted: Option<&str>, names: &[String]) -> Result<usize, String> {
    let part = wanted.unwrap_or_default().to_lowercase();
    names.iter().position(|name| name.to_lowercase().contains(&part)).ok_or_else(|| {
        let wanted = wanted.map(|name| format!(" named {name:?}")).unwrap_or_default();
        let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        format!("{wanted}; found: {found}")
    })
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
        let why = |wanted, names: &[String]| place_of(wanted, names).unwrap_err();
        assert_eq!(why(Some("no such"), &names), r#" named "no such"; found: Iris Xe, llvmpipe (LLVM 15)"#);
        assert_eq!(why(Some("no such"), &[]), r#" named "no such"; found: none"#);
        assert_eq!(why(None, &[]), "; found: none");
    }
}
