//! Event files that TensorBoard reads: numbers and pictures by step.
//!
//! A file is a row of records (length, checksum, payload, checksum), each payload an `Event` in the
//! encoding of protocol buffers. Both formats are simple enough to write out here.

#![allow(clippy::disallowed_methods, reason = "an event has the time at which it was written")]

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::time::SystemTime;

/// An event file that grows.
#[derive(Debug)]
pub struct EventFile {
    file: File,
}

impl EventFile {
    /// Opens a new file in `folder`; readers take all files of a folder as one run.
    ///
    /// # Errors
    /// If the folder or the file cannot be made.
    pub fn create(folder: &Path) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        let now_s = now_s();
        let name = format!("events.out.tfevents.{}.sharp.{}", now_s as u64, std::process::id());
        let file = OpenOptions::new().create(true).append(true).open(folder.join(name))?;
        let mut events = Self { file };
        let mut version = event(now_s, 0);
        put_bytes(&mut version, 3, b"brain.Event:2");
        events.write(&version)?;
        Ok(events)
    }

    /// Adds numbers at `step`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn scalars<S: AsRef<str>>(&mut self, step: u64, values: &[(S, f64)]) -> io::Result<()> {
        let mut summary = Vec::new();
        for (tag, number) in values {
            let mut value = Vec::new();
            put_bytes(&mut value, 1, tag.as_ref().as_bytes());
            put_key(&mut value, 2, Wire::Fixed32);
            value.extend((*number as f32).to_le_bytes());
            put_bytes(&mut summary, 1, &value);
        }
        self.summary(step, &summary)
    }

    /// Adds a PNG picture of `width` x `height` pixels at `step`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn picture(
        &mut self,
        step: u64,
        tag: &str,
        (width, height): (u32, u32),
        png: &[u8],
    ) -> io::Result<()> {
        let mut image = Vec::new();
        for (field, number) in [(1, u64::from(height)), (2, u64::from(width)), (3, 4)] {
            put_key(&mut image, field, Wire::Varint);
            put_varint(&mut image, number);
        }
        put_bytes(&mut image, 4, png);
        let mut value = Vec::new();
        put_bytes(&mut value, 1, tag.as_bytes());
        put_bytes(&mut value, 4, &image);
        let mut summary = Vec::new();
        put_bytes(&mut summary, 1, &value);
        self.summary(step, &summary)
    }

    fn summary(&mut self, step: u64, summary: &[u8]) -> io::Result<()> {
        let mut message = event(now_s(), step);
        put_bytes(&mut message, 5, summary);
        self.write(&message)
    }

    fn write(&mut self, payload: &[u8]) -> io::Result<()> {
        // In one piece: a reader of the growing file shall see whole records.
        self.file.write_all(&record(payload))
    }
}

fn now_s() -> f64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

/// How a field's value is laid out.
#[derive(Clone, Copy)]
enum Wire {
    Varint = 0,
    Fixed64 = 1,
    Bytes = 2,
    Fixed32 = 5,
}

/// An event that has its time and step.
fn event(time_s: f64, step: u64) -> Vec<u8> {
    let mut message = Vec::new();
    put_key(&mut message, 1, Wire::Fixed64);
    message.extend(time_s.to_le_bytes());
    put_key(&mut message, 2, Wire::Varint);
    put_varint(&mut message, step);
    message
}

fn put_key(message: &mut Vec<u8>, field: u64, wire: Wire) {
    put_varint(message, field << 3 | wire as u64);
}

fn put_bytes(message: &mut Vec<u8>, field: u64, bytes: &[u8]) {
    put_key(message, field, Wire::Bytes);
    put_varint(message, bytes.len() as u64);
    message.extend(bytes);
}

/// Seven bits a byte, the lowest first; the top bit says that more follow.
fn put_varint(message: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        message.push(number as u8 | 0x80);
        number >>= 7;
    }
    message.push(number as u8);
}

fn record(payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u64).to_le_bytes();
    let mut record = length.to_vec();
    record.extend(masked(crc32c(&length)).to_le_bytes());
    record.extend(payload);
    record.extend(masked(crc32c(payload)).to_le_bytes());
    record
}

/// A checksum of data that holds its own checksum is no good, so stored ones are turned and shifted.
const fn masked(crc: u32) -> u32 {
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// The cyclic redundancy check with Castagnoli's polynomial.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(
            crc ^ u32::from(byte),
            |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_castagnolis() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283, "the published check value");
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa, "32 zeros, from RFC 3720");
        assert_eq!(crc32c(b""), 0, "nothing");
    }

    #[test]
    fn numbers_take_seven_bits_a_byte() {
        for (number, expected) in [(0, vec![0]), (127, vec![127]), (300, vec![0xac, 2])] {
            let mut bytes = Vec::new();
            put_varint(&mut bytes, number);
            assert_eq!(bytes, expected, "{number}");
        }
    }

    #[test]
    fn a_file_is_a_row_of_whole_records() {
        let folder = tempfile::tempdir().unwrap();
        let mut events = EventFile::create(folder.path()).unwrap();
        events.scalars(7, &[("train/loss", 0.5)]).unwrap();
        events.picture(8, "samples", (2, 1), b"png").unwrap();
        let path = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
        let bytes = std::fs::read(path).unwrap();
        let mut rest = bytes.as_slice();
        let mut payloads = Vec::new();
        while !rest.is_empty() {
            let length = u64::from_le_bytes(rest[..8].try_into().unwrap()) as usize;
            let payload = &rest[12..12 + length];
            assert_eq!(record(payload), &rest[..length + 16], "record {}", payloads.len());
            payloads.push(payload.to_vec());
            rest = &rest[length + 16..];
        }
        assert_eq!(payloads.len(), 3, "version, scalars, picture");
        assert!(payloads[1].ends_with(&0.5_f32.to_le_bytes()), "{:?}", payloads[1]);
    }
}
