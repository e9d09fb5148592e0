//! Pictures for the page: the abstraction (appendix A) and the drives of one problem of each environment
//! and kind.

use std::path::Path;

use super::ReportError;
use crate::data_uri::data_uri;
use crate::result::ResultLine;

/// Pictures of one sort.
#[derive(Debug)]
pub(super) struct Gallery {
    /// Its place in the page.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    /// How to read it.
    pub(super) text: &'static str,
    pub(super) pictures: Vec<GalleryPicture>,
}

/// A picture that travels inside the page.
#[derive(Debug)]
pub(super) struct GalleryPicture {
    /// Its place in the page, and the name of its file.
    pub(super) name: String,
    pub(super) caption: String,
    /// The picture itself, as a data URI.
    pub(super) uri: String,
    /// Its PNG, for a file beside the page.
    pub(super) png: Vec<u8>,
}

/// Both galleries, with pictures of the first solved problem of each environment and kind in `lines`,
/// whose plans lie below `out`; pictures that are gone are left out.
///
/// # Errors
/// Returns an error if a picture is there but cannot be read.
pub(super) fn collect(lines: &[&ResultLine], out: &Path) -> Result<[Gallery; 2], ReportError> {
    let mut shown: Vec<&ResultLine> = Vec::new();
    for line in lines.iter().filter(|line| line.is_solved()) {
        if !shown.iter().any(|other| (&other.env, &other.options) == (&line.env, &line.options)) {
            shown.push(line);
        }
    }
    shown.sort_by_key(|line| (&line.env, &line.options));
    Ok([abstractions(&shown, out)?, executions(&shown, out)?])
}

fn abstractions(lines: &[&ResultLine], out: &Path) -> Result<Gallery, ReportError> {
    let mut pictures = Vec::new();
    for line in lines {
        let ResultLine { env, options, robot, .. } = line;
        let folder = line.plan_folder(out);
        let files = (read(&folder.join("abstraction.svg"))?, read(&folder.join("abstraction.png"))?);
        if let (Some(svg), Some(png)) = files {
            pictures.push(GalleryPicture {
                name: format!("abstraction-{env}-{options}"),
                caption: format!("{env}, {options} options for {robot}"),
                // Smaller than the PNG, and sharp at every size.
                uri: data_uri("image/svg+xml", &svg),
                png,
            });
        }
    }
    Ok(Gallery {
        name: "abstractions",
        title: "Abstract states and options (appendix A)",
        text: "Each colour is an abstract state, a cell of the region-based Voronoi diagram; outlines are critical \
               regions. White circles are what options connect: centroids of critical regions, or interfaces \
               between two states. A picture opens large.",
        pictures,
    })
}

fn executions(lines: &[&ResultLine], out: &Path) -> Result<Gallery, ReportError> {
    let mut pictures = Vec::new();
    for line in lines {
        let ResultLine { env, options, robot, problem, successes, episodes, .. } = line;
        pictures.extend(read(&line.plan_folder(out).join("run.png"))?.map(|png| GalleryPicture {
            name: format!("executions-{env}-{options}"),
            caption: format!(
                "{env}, {options}: {robot}, problem {problem}, {successes} of {episodes} executions arrived"
            ),
            uri: data_uri("image/png", &png),
            png,
        }));
    }
    Ok(Gallery {
        name: "executions",
        title: "Trajectories",
        text: "All executions of one problem of each environment and kind of option: guides blue, arrivals green, \
               failures red. A picture opens large.",
        pictures,
    })
}

/// The bytes of `path`; `None` if there is no such file.
fn read(path: &Path) -> Result<Option<Vec<u8>>, ReportError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(ReportError::Picture { path: path.to_owned(), source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let svg = lines[1].plan_folder(folder.path());
        std::fs::write(svg.join("abstraction.svg"), "svg").expect("a file");
        std::fs::write(svg.join("abstraction.png"), "png").expect("a file");
        let lines: Vec<&ResultLine> = lines.iter().collect();
        let [abstractions, executions] = collect(&lines, folder.path()).expect("pictures");
        let captions: Vec<&str> = executions.pictures.iter().map(|picture| &*picture.caption).collect();
        assert_eq!(
            captions,
            [
                "a, centroid: husky, problem 2, 20 of 20 executions arrived",
                "a, interface: limo, problem 1, 20 of 20 executions arrived"
            ]
        );
        assert_eq!(executions.pictures[0].uri, "data:image/png;base64,cG5n");
        assert_eq!(abstractions.pictures.len(), 1, "the other one is gone");
        assert_eq!(abstractions.pictures[0].name, "abstraction-a-centroid");
        assert_eq!(abstractions.pictures[0].uri, "data:image/svg+xml;base64,c3Zn");
    }
}
