//! `sharp export`: a plan in a format that others read.

use std::path::{Path, PathBuf};

use serde::Serialize;
use sharp_export::{PlanNetwork, PlannedPath, RouteGraph, networks, planned_mcap};
use sharp_plan::{Plan, write_atomic};

use crate::args::{Export, ExportFormat};
use crate::commands::run::load_plan;
use crate::outcome::{Exit, Failure, say, to_json};

/// `sharp.export/1`.
#[derive(Debug, Serialize)]
struct ExportReport {
    schema: &'static str,
    format: &'static str,
    files: Vec<ExportedFile>,
}

#[derive(Debug, Serialize)]
struct ExportedFile {
    path: String,
    bytes: usize,
    /// The options that a network drives.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    options: Vec<String>,
}

pub(crate) fn run(args: &Export, json: bool) -> Result<Exit, Failure> {
    let plan = load_plan(&args.plan_dir)?;
    let mut files = Vec::new();
    for (path, bytes, options) in contents(&plan, args)? {
        write_atomic(&path, &bytes)?;
        files.push(ExportedFile { path: path.display().to_string(), bytes: bytes.len(), options });
    }
    let report = ExportReport { schema: "sharp.export/1", format: name(args.format), files };
    if json {
        say!("{}", to_json(&report));
        return Ok(Exit::Done);
    }
    for ExportedFile { path, bytes, options } in &report.files {
        let drives =
            if options.is_empty() { String::new() } else { format!(", drives {}", options.join(" ")) };
        say!("{path}: {bytes} bytes{drives}");
    }
    Ok(Exit::Done)
}

const fn name(format: ExportFormat) -> &'static str {
    match format {
        ExportFormat::Csv => "csv",
        ExportFormat::Json => "json",
        ExportFormat::Mcap => "mcap",
        ExportFormat::Geojson => "geojson",
        ExportFormat::Onnx => "onnx",
        ExportFormat::Safetensors => "safetensors",
    }
}

/// A file to write, and the options that a network in it drives.
type Content = (PathBuf, Vec<u8>, Vec<String>);

fn contents(plan: &Plan, args: &Export) -> Result<Vec<Content>, Failure> {
    let one = |bytes: Vec<u8>| vec![(args.out.clone(), bytes, Vec::new())];
    Ok(match args.format {
        ExportFormat::Csv => one(PlannedPath::new(plan).to_csv(plan).into_bytes()),
        ExportFormat::Json => one(PlannedPath::new(plan).to_json(plan).into_bytes()),
        ExportFormat::Mcap => one(planned_mcap(plan)?),
        ExportFormat::Geojson => one(RouteGraph::of_plan(plan).to_geojson().into_bytes()),
        ExportFormat::Onnx => each(plan, &args.out, PlanNetwork::to_onnx)?,
        ExportFormat::Safetensors => each(plan, &args.out, PlanNetwork::to_safetensors)?,
    })
}

/// One file for each network of `plan`.
fn each(
    plan: &Plan,
    out: &Path,
    encode: impl Fn(&PlanNetwork, &Plan) -> Vec<u8>,
) -> Result<Vec<Content>, Failure> {
    let networks = networks(plan);
    if networks.is_empty() {
        let policies: Vec<String> = plan
            .solution
            .steps
            .iter()
            .map(|step| format!("{} {}", step.option.id, step.learnt.policy.kind()))
            .collect();
        let message = format!(
            "the plan has no network to export, its legs are driven by hand-written followers: {}",
            policies.join(", ")
        );
        return Err(Failure::new("NO_NETWORK", message));
    }
    let file = |(index, network): (usize, &PlanNetwork)| {
        let options = network.options.iter().map(|(id, _)| id.clone()).collect();
        (numbered(out, index + 1), encode(network, plan), options)
    };
    Ok(networks.iter().enumerate().map(file).collect())
}

/// `out` for the first file, with a number before its ending for those after it.
fn numbered(out: &Path, number: usize) -> PathBuf {
    if number == 1 {
        return out.to_owned();
    }
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let ending = out.extension().map_or(String::new(), |ending| format!(".{}", ending.to_string_lossy()));
    out.with_file_name(format!("{stem}-{number}{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_after_the_first_are_numbered() {
        for (number, expected) in [(1, "out/policy.onnx"), (2, "out/policy-2.onnx")] {
            assert_eq!(numbered(Path::new("out/policy.onnx"), number), Path::new(expected));
        }
        assert_eq!(numbered(Path::new("policy"), 3), Path::new("policy-3"));
    }
}
