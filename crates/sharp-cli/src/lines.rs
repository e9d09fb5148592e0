//! Lines from outside, of which a broken one must not end a service, and a huge one must not fill the memory.

use std::io::{BufRead, ErrorKind, Write};

use crate::outcome::{Exit, Failure};

/// Ten times the longest line that means anything: a route of a thousand goals.
const LINE_MAX_BYTES: usize = 1 << 20;

/// A line, or why it could not be taken.
pub(crate) type Line = Result<String, String>;

/// Answers each line of standard input that is not blank with lines on standard output, until one of them is closed. `answer`
/// is told the line, or why it could not be taken, and its number, from 1.
pub(crate) fn answer_lines(
    mut answer: impl FnMut(Line, usize) -> Result<Vec<String>, Failure>,
) -> Result<Exit, Failure> {
    let mut out = std::io::stdout().lock();
    let mut input = std::io::stdin().lock();
    for number in 1_usize.. {
        let line = next_line(&mut input)
            .map_err(|error| Failure::new("INPUT", format!("line {number}: {error}")))?;
        let Some(line) = line else { break };
        if line.as_ref().is_ok_and(|line| line.trim().is_empty()) {
            continue;
        }
        let text = answer(line, number)?;
        let written = text.iter().try_for_each(|line| writeln!(out, "{line}")).and_then(|()| out.flush());
        // A closed pipe ends the service; there is nobody left to tell.
        if written.is_err() {
            break;
        }
    }
    Ok(Exit::Done)
}

/// Reads the next line of `input`, without its end; `None` at the end of `input`. Bytes that are no text are replaced:
/// they make a broken line, not the end. Of a line that is too long the rest is passed over.
///
/// # Errors
/// Returns an error if `input` cannot be read.
fn next_line(input: &mut impl BufRead) -> std::io::Result<Option<Line>> {
    let mut line = Vec::new();
    let (mut has_begun, mut length) = (false, 0_usize);
    loop {
        let chunk = match input.fill_buf() {
            Ok(chunk) => chunk,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        if chunk.is_empty() {
            break;
        }
        has_begun = true;
        let end = chunk.iter().position(|&byte| byte == b'\n');
        let part = &chunk[..end.unwrap_or(chunk.len())];
        length = length.saturating_add(part.len());
        if length <= LINE_MAX_BYTES {
            line.extend_from_slice(part);
        }
        let used = part.len() + usize::from(end.is_some());
        input.consume(used);
        if end.is_some() {
            break;
        }
    }
    if length > LINE_MAX_BYTES {
        return Ok(Some(Err(format!("has {length} bytes, at most {LINE_MAX_BYTES} are read"))));
    }
    Ok(has_begun.then(|| Ok(String::from_utf8_lossy(&line).into_owned())))
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    fn lines(bytes: &[u8]) -> Vec<Line> {
        // A small buffer: lines come in parts.
        let mut input = BufReader::with_capacity(7, bytes);
        std::iter::from_fn(|| next_line(&mut input).expect("readable")).collect()
    }

    #[test]
    fn lines_end_at_line_ends_and_at_the_end() {
        let all = lines(b"one\n\na longer line\n\xff\nlast");
        let expected = ["one", "", "a longer line", "\u{fffd}", "last"].map(|line| Ok(line.to_owned()));
        assert_eq!(all, expected);
        assert!(lines(b"").is_empty(), "nothing");
    }

    #[test]
    fn a_huge_line_is_refused_and_the_next_is_read() {
        let mut bytes = vec![b'x'; LINE_MAX_BYTES + 1];
        bytes.extend(b"\nnext\n");
        let all = lines(&bytes);
        assert_eq!(all.len(), 2);
        assert!(all[0].as_ref().is_err_and(|problem| problem.contains("1048577 bytes")), "{:?}", all[0]);
        assert_eq!(all[1], Ok("next".to_owned()));
        let fits = lines(&bytes[1..]);
        assert_eq!(fits[0].as_ref().map(String::len), Ok(LINE_MAX_BYTES), "the longest that is read");
    }
}
