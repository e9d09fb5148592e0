//! Pictures for the page: the abstraction and the drives of one problem of each environment and kind.

use std::path::Path;

use super::Evaluation;
use super::lines::ResultLine;
use crate::outcome::Failure;

/// A picture that travels inside the page.
#[derive(Debug)]
pub(super) struct Picture {
    /// Its place in the page.
    pub(super) id: String,
    pub(super) caption: String,
    /// The picture itself, as a data URI.
    pub(super) uri: String,
}

/// What is shown of a plan: the file and what it shows. The abstraction is smaller as SVG, the drives
/// are smaller as PNG.
const SHOWN: [(&str, &str, &str); 2] =
    [("abstraction.svg", "image/svg+xml", "abstraction"), ("run.png", "image/png", "executions")];

/// The pictures of the first solved problem of each environment and kind; pictures that are gone are left out.
///
/// # Errors
/// Returns an error if a picture is there but cannot be read.
pub(super) fn collect(evaluation: &Evaluation<'_>) -> Result<Vec<Picture>, Failure> {
    let mut shown: Vec<&ResultLine> = Vec::new();
    for line in evaluation.lines.iter().filter(|line| line.is_solved()) {
        if !shown.iter().any(|other| (&other.env, &other.options) == (&line.env, &line.options)) {
            shown.push(line);
        }
    }
    shown.sort_by_key(|line| (&line.env, &line.options));
    let mut pictures = Vec::new();
    for line in shown {
        let folder = line.plan_folder(evaluation.out);
        for (file, kind, what) in SHOWN {
            let number = pictures.len() + 1;
            pictures.extend(read(&folder.join(file), kind)?.map(|uri| Picture {
                id: format!("picture-{number}"),
                caption: caption(line, what),
                uri,
            }));
        }
    }
    Ok(pictures)
}

fn caption(line: &ResultLine, what: &str) -> String {
    let ResultLine { env, options, robot, problem, successes, episodes, .. } = line;
    match what {
        "executions" => {
            format!(
                "{env}, {options}: {robot}, problem {problem}, {successes} of {episodes} executions arrived"
            )
        }
        _ => format!("{env}, {options}: {what} for {robot}"),
    }
}

fn read(path: &Path, kind: &str) -> Result<Option<String>, Failure> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(format!("data:{kind};base64,{}", base64(&bytes)))),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Failure::new("FILE_INVALID", format!("{}: {error}", path.display()))),
    }
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word =
            chunk.iter().enumerate().fold(0, |word, (i, &byte)| word | u32::from(byte) << (16 - 8 * i));
        for i in 0..4 {
            let index = word >> (18 - 6 * i) & 63;
            text.push(if i <= chunk.len() { char::from(ALPHABET[index as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_text_as_the_standard_says() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text, "{bytes}");
        }
        assert_eq!(base64(&[255, 239, 190]), "/+++");
    }

    #[test]
    fn one_problem_of_each_environment_and_kind_is_shown() {
        let folder = tempfile::tempdir().expect("a folder");
        let lines = [
            ResultLine { status: "no_plan".into(), ..ResultLine::example("a", "husky", "centroid", 1) },
            ResultLine::example("a", "husky", "centroid", 2),
            ResultLine::example("a", "limo", "centroid", 1),
            ResultLine::example("a", "limo", "interface", 1),
        ];
        for line in &lines {
            let plan = line.plan_folder(folder.path());
            std::fs::create_dir_all(&plan).expect("a folder");
            std::fs::write(plan.join("run.png"), "png").expect("a file");
        }
        let evaluation = Evaluation {
            lines: lines.iter().collect(),
            baselines: vec![],
            command: String::new(),
            out: folder.path(),
        };
        let pictures = collect(&evaluation).expect("pictures");
        let captions: Vec<&str> = pictures.iter().map(|picture| picture.caption.as_str()).collect();
        assert_eq!(
            captions,
            [
                "a, centroid: husky, problem 2, 20 of 20 executions arrived",
                "a, interface: limo, problem 1, 20 of 20 executions arrived"
            ]
        );
        assert_eq!(pictures[0].uri, "data:image/png;base64,cG5n");
    }
}
