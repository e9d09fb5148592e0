//! Names of options that last: they depend on the diagram only, not on the order of synthesis.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use sharp_rbvd::StateId;
use thiserror::Error;

/// The two families of options.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OptionKind {
    /// From the centroid of one critical region to that of a neighbour (`O_c`).
    Centroid,
    /// From one interface of a state, across the state, to another (`O_i`).
    Interface,
}

/// Names an option `o_ij` or `o_ijk`.
///
/// Written and serialised as `c:3-7`, `c:3-7-9` or `i:3-7-9`. If a pair of states shares several portals,
/// `@` and the portals' positions among those of their pairs follow: `i:3-7-9@0.1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum OptionId {
    /// A centroid option `o_ij`.
    Centroid {
        /// The state i it leaves.
        from: StateId,
        /// The state j it enters.
        to: StateId,
    },
    /// From the centroid of i to that of k through j, whose centroid it passes by: where that lies
    /// aside, a robot that cannot turn on the spot could not go on from it. The paper has none.
    Passing {
        /// The state i it leaves.
        from: StateId,
        /// The state j it crosses.
        through: StateId,
        /// The state k it enters.
        to: StateId,
    },
    /// An interface option `o_ijk`.
    Interface {
        /// The state i it leaves.
        from: StateId,
        /// The state j it crosses.
        through: StateId,
        /// The state k it enters.
        to: StateId,
        /// Which of the portals between i and j and which between j and k, from 0; `None` if
        /// there is only one of each.
        portals: Option<(u32, u32)>,
    },
}

impl OptionId {
    /// The family it belongs to.
    #[must_use]
    pub const fn kind(self) -> OptionKind {
        match self {
            Self::Centroid { .. } | Self::Passing { .. } => OptionKind::Centroid,
            Self::Interface { .. } => OptionKind::Interface,
        }
    }

    /// The state it leaves, i.
    #[must_use]
    pub const fn from(self) -> StateId {
        match self {
            Self::Centroid { from, .. } | Self::Passing { from, .. } | Self::Interface { from, .. } => from,
        }
    }

    /// The state it crosses: j of `o_ijk`.
    #[must_use]
    pub const fn through(self) -> Option<StateId> {
        match self {
            Self::Centroid { .. } => None,
            Self::Passing { through, .. } | Self::Interface { through, .. } => Some(through),
        }
    }

    /// The state it enters: j of `o_ij`, k of `o_ijk`.
    #[must_use]
    pub const fn to(self) -> StateId {
        match self {
            Self::Centroid { to, .. } | Self::Passing { to, .. } | Self::Interface { to, .. } => to,
        }
    }
}

impl fmt::Display for OptionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Centroid { from, to } => write!(f, "c:{}-{}", from.0, to.0),
            Self::Passing { from, through, to } => write!(f, "c:{}-{}-{}", from.0, through.0, to.0),
            Self::Interface { from, through, to, portals } => {
                write!(f, "i:{}-{}-{}", from.0, through.0, to.0)?;
                portals.map_or(Ok(()), |(entry, exit)| write!(f, "@{entry}.{exit}"))
            }
        }
    }
}

/// A text that names no option.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "{0:?} names no option, expected c:FROM-TO, c:FROM-THROUGH-TO, i:FROM-THROUGH-TO or i:FROM-THROUGH-TO@ENTRY.EXIT"
)]
pub struct OptionIdError(pub String);

impl FromStr for OptionId {
    type Err = OptionIdError;

    fn from_str(text: &str) -> Result<Self, OptionIdError> {
        // Whatever is not the one way to write an id, such as `c:03-7`, is refused.
        parse(text).filter(|id| id.to_string() == text).ok_or_else(|| OptionIdError(text.to_owned()))
    }
}

impl TryFrom<String> for OptionId {
    type Error = OptionIdError;

    fn try_from(text: String) -> Result<Self, OptionIdError> {
        text.parse()
    }
}

impl From<OptionId> for String {
    fn from(id: OptionId) -> Self {
        id.to_string()
    }
}

fn parse(text: &str) -> Option<OptionId> {
    let (kind, rest) = text.split_once(':')?;
    let (states, portals) = rest.split_once('@').map_or((rest, None), |(s, p)| (s, Some(p)));
    let portals = match portals.map(|text| text.split_once('.')) {
        None => None,
        Some(pair) => pair.map(|(entry, exit)| Some((entry.parse().ok()?, exit.parse().ok()?)))?,
    };
    let states: Option<Vec<StateId>> = states.split('-').map(|s| s.parse().ok().map(StateId)).collect();
    match (kind, states?[..].as_ref(), portals) {
        ("c", &[from, to], None) if from != to => Some(OptionId::Centroid { from, to }),
        (kind, &[from, through, to], portals) if from != through && through != to && from != to => {
            match (kind, portals) {
                ("c", None) => Some(OptionId::Passing { from, through, to }),
                ("i", portals) => Some(OptionId::Interface { from, through, to, portals }),
                _ => None,
            }
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_survive_text_and_files() {
        arbtest::arbtest(|u| {
            let [from, through, to] =
                [0, 1, 2].map(|i| StateId(u.arbitrary::<u32>().unwrap_or(i) / 3 * 3 + i));
            let id = match u.int_in_range(0..=2)? {
                0 => OptionId::Centroid { from, to },
                1 => OptionId::Passing { from, through, to },
                _ => OptionId::Interface { from, through, to, portals: u.arbitrary()? },
            };
            assert_eq!(id.to_string().parse(), Ok(id), "{id}");
            let stored = ron::to_string(&id).unwrap();
            assert_eq!(stored, format!("{:?}", id.to_string()), "an id is stored as text");
            assert_eq!(ron::from_str(&stored), Ok(id), "{id}");
            Ok(())
        });
    }

    #[test]
    fn other_texts_are_refused() {
        let texts = [
            "",
            "c",
            "c:3",
            "c:3-3",
            "c:03-7",
            "c:+3-7",
            "c:3-7-3",
            "c:3-7@0.1",
            "c:3-7-9@0.1",
            "x:1-2-3",
            "x:1-2",
            "c:-1-2",
            "c:3-7 ",
        ];
        let more =
            ["i:3-7", "i:3-7-3", "i:3-3-7", "i:1-2-3@", "i:1-2-3@0", "i:1-2-3@0.1.2", "i:1-2-4294967296"];
        for text in texts.into_iter().chain(more) {
            assert_eq!(text.parse::<OptionId>(), Err(OptionIdError(text.to_owned())), "{text:?}");
        }
    }
}
