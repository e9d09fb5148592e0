//! What machine times are taken on.

use std::fs;

use sharp_bench::Machine;

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
