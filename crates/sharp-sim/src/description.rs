//! Reading robots and noise models from RON, with errors that show the line.

use serde::de::DeserializeOwned;
use thiserror::Error;

/// Longer lines are cut in messages, characters.
const SHOWN_MAX: usize = 80;

/// Text that cannot be read as a robot or a noise model.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line} {text:?}: {reason}")]
pub struct SyntaxError {
    /// The line, from 1.
    pub line: usize,
    /// The text of that line, cut if it is long.
    pub text: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Reads a value from RON.
pub(crate) fn parse<T: DeserializeOwned>(text: &str) -> Result<T, SyntaxError> {
    ron::from_str(text).map_err(|error| {
        let line = error.span.start.line;
        let shown = text.lines().nth(line.saturating_sub(1)).unwrap_or_default().trim();
        let shown = shown.chars().take(SHOWN_MAX).collect();
        SyntaxError { line, text: shown, reason: error.code.to_string() }
    })
}
