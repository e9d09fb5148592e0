//! Services that read a line from outside and answer it at once.

use std::io::{BufRead, Write};

use crate::outcome::{Exit, Failure};

/// Answers each line of standard input that is not blank with lines on standard output, until one of them is closed. `answer`
/// is told the line and its number, from 1.
pub(crate) fn answer_lines(
    mut answer: impl FnMut(&str, usize) -> Result<Vec<String>, Failure>,
) -> Result<Exit, Failure> {
    let mut out = std::io::stdout().lock();
    for (index, line) in std::io::stdin().lock().split(b'\n').enumerate() {
        let line = line.map_err(|error| Failure::new("INPUT", format!("line {}: {error}", index + 1)))?;
        // Bytes that are no text make a broken line, not the end.
        let line = String::from_utf8_lossy(&line);
        if line.trim().is_empty() {
            continue;
        }
        let text = answer(&line, index + 1)?;
        let written = text.iter().try_for_each(|line| writeln!(out, "{line}")).and_then(|()| out.flush());
        // A closed pipe ends the service; there is nobody left to tell.
        if written.is_err() {
            break;
        }
    }
    Ok(Exit::Done)
}
