//! The choice of an adapter.

use super::error::{GpuError, Result};

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
pub(super) async fn choose(name: Option<&str>) -> Result<wgpu::Adapter> {
    let [api, named] = ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"].map(|name| std::env::var(name).ok());
    let all = best_first().await;
    let names: Vec<_> = all.iter().map(|adapter| adapter.get_info().name).collect();
    let place = place_of(name, api.as_deref(), named.as_deref(), &names).map_err(GpuError::NoAdapter)?;
    Ok(all[place].clone())
}

/// Returns the place of the wanted adapter, or what was wanted and found. It is wanted by its place, such as `1` or `gpu 1`, or by
/// another part of its name, in any case; the first with that part counts. `api` and `named` are the values of `WGPU_BACKEND` and
/// `WGPU_ADAPTER_NAME`.
fn place_of(
    name: Option<&str>,
    api: Option<&str>,
    named: Option<&str>,
    names: &[String],
) -> Result<usize, String> {
    if let Some(api) = api.filter(|api| wgpu::Backends::from_comma_list(api).is_empty()) {
        return Err(format!(": WGPU_BACKEND={api:?} names no API (known: vulkan, metal, dx12)"));
    }
    let wanted = name.or(named);
    let part = wanted.unwrap_or_default().to_lowercase();
    let number = part.strip_prefix("gpu ").unwrap_or(&part);
    // Longer numbers, such as 4090, are parts of names.
    let place = if matches!(number.len(), 1 | 2) && number.bytes().all(|byte| byte.is_ascii_digit()) {
        number.parse().ok().filter(|place| *place < names.len())
    } else {
        names.iter().position(|name| name.to_lowercase().contains(&part))
    };
    place.ok_or_else(|| {
        let wanted = wanted.map(|name| format!(" named {name:?}")).unwrap_or_default();
        let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let cause = match api {
            Some(api) if names.is_empty() => format!("; WGPU_BACKEND={api:?} leaves out other APIs"),
            _ if name.is_none() && named.is_some() => "; WGPU_ADAPTER_NAME has that name".to_owned(),
            _ => String::new(),
        };
        format!("{wanted}; found: {found}{cause}")
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
        let of_call = [None, Some("xe"), Some("LLVMPIPE")].map(|name| place_of(name, None, None, &names));
        assert_eq!(of_call, [Ok(0), Ok(0), Ok(1)]);
        // A short number is no part of a name.
        let of_place = ["0", "gpu 1", "15", "2"].map(|name| place_of(Some(name), None, None, &names).ok());
        assert_eq!(of_place, [Some(0), Some(1), None, None]);
        assert_eq!(place_of(Some("4090"), None, None, &["A".into(), "RTX 4090".into()]), Ok(1));
        assert_eq!(place_of(None, None, Some("llvm"), &names), Ok(1), "the variable's");
        assert_eq!(place_of(Some("iris"), None, Some("llvm"), &names), Ok(0), "the call's comes first");
        assert_eq!(place_of(None, Some("vulkan"), None, &names), Ok(0));
    }

    #[test]
    fn an_error_says_what_was_wanted_what_was_found_and_which_variable_is_the_cause() {
        let names = ["Iris Xe", "llvmpipe (LLVM 15)"].map(str::to_owned);
        let why = |name, api, named, names: &[String]| place_of(name, api, named, names).unwrap_err();
        let found = r#" named "no such"; found: Iris Xe, llvmpipe (LLVM 15)"#;
        assert_eq!(why(Some("no such"), None, None, &names), found);
        assert_eq!(
            why(Some("no such"), Some("vulkan"), Some("xe"), &names),
            found,
            "no variable is the cause"
        );
        let of_variable = format!("{found}; WGPU_ADAPTER_NAME has that name");
        assert_eq!(why(None, None, Some("no such"), &names), of_variable);
        assert_eq!(why(Some("no such"), None, None, &[]), r#" named "no such"; found: none"#);
        assert_eq!(why(None, None, None, &[]), "; found: none");
        let others = r#"; found: none; WGPU_BACKEND="metal" leaves out other APIs"#;
        assert_eq!(why(None, Some("metal"), None, &[]), others);
        let both = format!(r#" named "no such"{others}"#);
        assert_eq!(why(None, Some("metal"), Some("no such"), &[]), both, "the API leaves out all adapters");
        let unknown = r#": WGPU_BACKEND="cuda" names no API (known: vulkan, metal, dx12)"#;
        assert_eq!(why(None, Some("cuda"), None, &names), unknown);
    }
}
