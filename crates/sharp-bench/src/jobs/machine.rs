//! What times are taken on, and which program takes them.

#![allow(clippy::disallowed_methods, reason = "a result says on which machine it was measured")]

use std::fs;
use std::sync::OnceLock;

use sharp_plan::hash;

use crate::result::Machine;

/// Version and build of this program, as in `0.1.0+1f0c9a7e`: what two builds measure may differ.
pub(super) fn version() -> &'static str {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION.get_or_init(|| {
        let version = env!("CARGO_PKG_VERSION");
        // The first is there even if the file was replaced meanwhile.
        let program = fs::read("/proc/self/exe").or_else(|_| fs::read(std::env::current_exe()?));
        program.map_or(version.to_owned(), |bytes| format!("{version}+{}", &hash(&bytes)[..8]))
    })
}

/// This machine, as far as the system tells.
pub(super) fn machine() -> Machine {
    parse(&fs::read_to_string("/proc/cpuinfo").unwrap_or_default()).unwrap_or_else(|| Machine {
        cpu: std::env::consts::ARCH.to_owned(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
    })
}

/// Processors counted and named in what Linux says of them.
fn parse(cpuinfo: &str) -> Option<Machine> {
    let values = |name: &'static str| {
        cpuinfo.lines().filter_map(move |line| {
            let (key, value) = line.split_once(':')?;
            (key.trim() == name).then(|| value.trim())
        })
    };
    Some(Machine { cpu: values("model name").next()?.to_owned(), cores: values("processor").count() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linux_names_its_processors() {
        let text = "processor\t: 0\nmodel name\t: AMD EPYC\n\nprocessor\t: 1\nmodel name\t: AMD EPYC\n";
        assert_eq!(parse(text), Some(Machine { cpu: "AMD EPYC".into(), cores: 2 }));
        assert_eq!(parse("processor : 0\n"), None, "no name, nothing to go by");
        assert!(machine().cores > 0, "{:?}", machine());
    }
}
