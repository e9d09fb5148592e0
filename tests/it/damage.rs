//! Group 8 of the list in `docs/testing.md`: whatever happens to the files of a library, it is noticed and named.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use sharp_drive::World;
use sharp_plan::{Answer, Method, OptionLibrary, Query, Sharp, hash};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{OccupancyGrid, Pose};

/// Four rooms in a row with doors at either end by turns, cells of 0.1 m.
fn rooms() -> OccupancyGrid {
    let row = |row: usize| {
        let cell = |col: usize| {
            let is_border = col == 0 || col == 159 || row == 0 || row == 39;
            let door = if col / 40 == 2 { 22..36 } else { 4..18 };
            let is_wall = col % 40 < 2 && col > 2 && !door.contains(&row);
            if is_border || is_wall { '#' } else { '.' }
        };
        (0..160).map(cell).collect::<String>()
    };
    OccupancyGrid::from_ascii(0.1, &(0..40).map(row).collect::<Vec<_>>().join("\n")).expect("drawn")
}

/// A library of a few options with the key `key-map`.
fn library() -> tempfile::TempDir {
    let root = tempfile::tempdir().expect("a folder");
    let mut method = Method::fast().with_episodes(20, 20, 20);
    method.search.direct = false;
    let library = OptionLibrary::open(root.path(), "key-map").expect("empty");
    let world = World::new(rooms(), RobotModel::limo());
    let mut sharp = Sharp::new(world, GeometricDetector::default()).with_method(method).with_library(library);
    let ends = [Pose::new(1.0, 1.0, 0.0), Pose::new(15.0, 1.0, 0.0)];
    for (start, goal) in [(0, 1), (1, 0)] {
        let query = Query { start: ends[start], goal: ends[goal] };
        assert!(matches!(sharp.solve(query, &()), Ok(Answer::Solved(_))), "there is a way");
    }
    sharp.library_mut().save().expect("written");
    root
}

fn files(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(root.join("key-map")).expect("a folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    paths.map(|path| (path.clone(), fs::read(path).expect("a file"))).collect()
}

/// Why the library is refused.
#[track_caller]
fn refusal(root: &Path, what: &str) -> String {
    match OptionLibrary::open(root, "key-map") {
        Ok(_) => panic!("{what}: it is read"),
        Err(error) => error.to_string(),
    }
}

fn name(path: &Path) -> String {
    path.file_name().expect("a file").to_string_lossy().into_owned()
}

#[test]
fn every_kind_of_damage_to_a_library_is_noticed_and_the_file_is_named() {
    let root = library();
    let sound = files(root.path());
    assert!(sound.keys().any(|path| name(path).ends_with(".safetensors")), "weights: {:?}", sound.keys());
    assert!(sound.keys().filter(|path| name(path).ends_with(".ron")).count() > 1, "{:?}", sound.keys());
    for (path, bytes) in &sound {
        let check = |what: &str, broken: &[u8]| {
            fs::write(path, broken).expect("written");
            let message = refusal(root.path(), &format!("{what} in {}", path.display()));
            assert!(message.contains(&name(path)), "{what}: {message}");
        };
        // Every byte of what a person could read; of weights, one in a hundred.
        let step = if name(path).ends_with(".ron") { 1 } else { 101 };
        for at in (0..bytes.len()).step_by(step) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            check(&format!("byte {at} is flipped"), &flipped);
        }
        for length in [0, 1, bytes.len() / 2, bytes.len() - 1] {
            check(&format!("cut to {length}"), &bytes[..length]);
        }
        check("zeros", &vec![0; bytes.len()]);
        check("longer by a byte", &[&bytes[..], b"\n"].concat());
        fs::remove_file(path).expect("it was there");
        if name(path).ends_with(".safetensors") {
            assert!(refusal(root.path(), "it is gone").contains(&name(path)));
        }
        fs::write(path, bytes).expect("written");
    }
    OptionLibrary::open(root.path(), "key-map").expect("all is well again");
}

#[test]
fn sound_files_in_the_wrong_place_or_of_another_time_are_refused() {
    let root = library();
    let sound = files(root.path());
    let options: Vec<&PathBuf> = sound.keys().filter(|path| name(path).ends_with(".ron")).collect();
    fs::write(options[0], &sound[options[1]]).expect("written");
    fs::write(options[1], &sound[options[0]]).expect("written");
    assert!(refusal(root.path(), "two are swapped").contains("holds the option"));
    fs::write(options[1], &sound[options[1]]).expect("written");

    let text = String::from_utf8(sound[options[0]].clone()).expect("text");
    let body = text.split_once('\n').expect("a checksum").1;
    let rewrite = |from: &str, to: &str| {
        assert!(body.contains(from), "{from} in {body}");
        let body = body.replacen(from, to, 1);
        fs::write(options[0], format!("// blake3: {}\n{body}", hash(body.as_bytes()))).expect("written");
        let message = refusal(root.path(), to);
        assert!(message.contains(&name(options[0])), "{to}: {message}");
        message
    };
    let format = body.split("format: ").nth(1).and_then(|rest| rest.split(',').next()).expect("a format");
    for other in ["0", "5", "7", "4294967295"] {
        let message = rewrite(&format!("format: {format}"), &format!("format: {other}"));
        assert!(message.contains(&format!("format is {other}")), "{message}");
    }
    rewrite("format:", "unheard_of: 3, format:");
    fs::write(options[0], &sound[options[0]]).expect("written");
    OptionLibrary::open(root.path(), "key-map").expect("all is well again");
}

#[test]
fn weights_that_are_no_numbers_or_lie_elsewhere_are_refused_under_a_checksum_that_fits() {
    let root = library();
    let sound = files(root.path());
    let weights = sound.keys().find(|path| name(path).ends_with(".safetensors")).expect("weights");
    let uses = |path: &&PathBuf| String::from_utf8_lossy(&sound[*path]).contains(&name(weights));
    let option = sound.keys().filter(|path| name(path).ends_with(".ron")).find(uses).expect("an option");
    let text = String::from_utf8(sound[option].clone()).expect("text");
    let body = text.split_once('\n').expect("a checksum").1;
    let point_at = |file: &str| {
        let body = body.replace(&name(weights), file);
        fs::write(option, format!("// blake3: {}\n{body}", hash(body.as_bytes()))).expect("written");
        refusal(root.path(), file)
    };
    let mut bytes = sound[weights].clone();
    let length = bytes.len();
    bytes[length - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    let poisoned = format!("{}.safetensors", &hash(&bytes)[..32]);
    fs::write(root.path().join("key-map").join(&poisoned), &bytes).expect("written");
    let message = point_at(&poisoned);
    assert!(message.contains("NaN") && message.contains(&poisoned), "{message}");

    let short = format!("{}.safetensors", &hash(b"short")[..32]);
    fs::write(root.path().join("key-map").join(&short), b"short").expect("written");
    assert!(point_at(&short).contains(&short));
    for elsewhere in ["../../etc/passwd", "/etc/passwd", "", ".", "../key-map/x", "\\\\host\\share"] {
        let message = point_at(&elsewhere.replace('\\', "\\\\"));
        assert!(message.contains("not the name of a weights file"), "{elsewhere}: {message}");
    }
}
