//! Groups 1 to 3: files that would fill the memory are refused within bounds of memory and time.

use std::fs::File;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::small::{Small, panicked};

/// What reading any file may take, kilobytes; the shell holds the command to it.
const MEMORY_MAX_KB: u32 = 600 << 10;
const TIME_MAX: Duration = Duration::from_secs(2);

fn chunk(bytes: &mut Vec<u8>, name: &[u8; 4], data: &[u8]) {
    bytes.extend((data.len() as u32).to_be_bytes());
    let start = bytes.len();
    bytes.extend(name);
    bytes.extend(data);
    let crc = bytes[start..].iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    });
    bytes.extend((!crc).to_be_bytes());
}

/// A PNG of that size, depth and kind whose pixels are `data`.
fn png(width: u32, height: u32, depth: u8, kind: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[depth, kind, 0, 0, 0]].concat();
    chunk(&mut bytes, b"IHDR", &header);
    chunk(&mut bytes, b"IDAT", data);
    chunk(&mut bytes, b"IEND", &[]);
    bytes
}

#[test]
fn files_that_would_fill_the_memory_are_refused_within_bounds() {
    let place = Small::new();
    let mut files: Vec<(&str, Vec<u8>)> = vec![
        ("p5.pgm", b"P5\n40000 40000\n255\n\x00\x00\x00".to_vec()),
        ("wrap.pgm", b"P5\n65535 65537\n255\n\x00\x00\x00".to_vec()),
        ("huge.pgm", b"P5\n4294967295 4294967295\n255\n".to_vec()),
        ("line.pgm", b"P5\n4294967295 1\n255\n".to_vec()),
        ("zero.pgm", b"P5\n0 0\n255\n".to_vec()),
        ("p2.pgm", [b"P2\n8192 8192\n255\n".to_vec(), b"0 ".repeat(1000)].concat()),
        ("p6.ppm", b"P6\n30000 30000\n65535\n".to_vec()),
        ("bomb.png", png(40_000, 40_000, 8, 0, &[0x78, 0x9c, 0])),
        ("deep.png", png(8192, 8192, 16, 6, &[0x78, 0x9c, 0])),
        ("huge.map", b"type octile\nheight 4000000000\nwidth 4000000000\nmap\n".to_vec()),
        ("wrap.map", b"type octile\nheight 18446744073709551615\nwidth 2\nmap\n".to_vec()),
        (
            "plan.ron",
            b"(size_m: (1e12, 1e12), resolution_m: 1e-6, wall_thickness_m: 0.2, walls: [])".to_vec(),
        ),
        ("long.yaml", vec![b'#'; 11 << 20]),
    ];
    let mut laughs = "a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n".to_owned();
    for level in 1..12 {
        let before = format!("*a{}", level - 1);
        laughs += &format!("a{level}: &a{level} [{}]\n", vec![before; 10].join(","));
    }
    files.push(("laughs.yaml", laughs.into_bytes()));
    files.push(("nested.yaml", [b"image: ".to_vec(), vec![b'['; 100_000]].concat()));
    for (name, bytes) in &files {
        place.write(name, bytes);
        refused(&place, name);
    }
    // A hole of 8 GB, which no reader may take in.
    let hole = File::create(place.path().join("hole.pgm")).expect("a file");
    hole.set_len(8 << 30).expect("a hole");
    refused(&place, "hole.pgm");
}

/// `sharp map info` of that file says what is wrong with it, in bounded time and memory.
fn refused(place: &Small, name: &str) {
    let begun = Instant::now();
    let limited = format!("ulimit -v {MEMORY_MAX_KB}; exec \"$0\" \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &limited, env!("CARGO_BIN_EXE_sharp"), "map", "info", name, "--resolution", "0.05"]);
    let output = command.current_dir(place.path()).output().expect("a shell");
    assert_eq!(output.status.code(), Some(2), "{name}: {output:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains(name) && !panicked(&output), "{name}: {said}");
    assert!(begun.elapsed() < TIME_MAX, "{name} took {:?}", begun.elapsed());
}
