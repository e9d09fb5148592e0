//! Names of options. They depend on the states only, not on the order of synthesis, so they last.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use sharp_rbvd::StateId;
use thiserror::Error;

/// The kinds of options: the paper's two, and those of families from outside this library.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OptionKind {
    /// From the centroid of one critical region to that of a neighbour (`O_c`).
    Centroid,
    /// From one interface of a state, across the state, to another (`O_i`).
    Interface,
    /// Options of a family from outside this library.
    Custom,
}

impl OptionKind {
    /// Its name in files and messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Centroid => "centroid",
            Self::Interface => "interface",
            Self::Custom => "custom",
        }
    }
}

/// Names an option `o_ij` or `o_ijk`.
///
/// Written and serialised as `c:3-7` (centroid), `c:3-7-9` (bypass) or `i:3-7-9` (interface). If a pair
/// of states shares several portals, `@` and the portals' positions among those of their pairs follow:
/// `i:3-7-9@0.1`. An option of a family from outside is written like `w:3-7#0`.
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
    /// From the centroid of i to that of k, past the centroid of j. If the centroid of j lies to the
    /// side, a robot that cannot turn on the spot could not go on from it. The paper has none.
    Bypass {
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
    /// An option of a family from outside this library.
    Custom {
        /// The family's letter, from `a` to `z` but neither `c` nor `i`.
        family: char,
        /// The state it leaves.
        from: StateId,
        /// The state it enters.
        to: StateId,
        /// Tells the options of the family between the same two states apart.
        number: u32,
    },
}

impl OptionId {
    /// The family it belongs to.
    #[must_use]
    pub const fn kind(self) -> OptionKind {
        match self {
            Self::Centroid { .. } | Self::Bypass { .. } => OptionKind::Centroid,
            Self::Interface { .. } => OptionKind::Interface,
            Self::Custom { .. } => OptionKind::Custom,
        }
    }

    /// The state it leaves, i.
    #[must_use]
    pub const fn from(self) -> StateId {
        match self {
            Self::Centroid { from, .. }
            | Self::Bypass { from, .. }
            | Self::Interface { from, .. }
            | Self::Custom { from, .. } => from,
        }
    }

    /// The state it crosses: j of `o_ijk`.
    #[must_use]
    pub const fn through(self) -> Option<StateId> {
        match self {
            Self::Centroid { .. } | Self::Custom { .. } => None,
            Self::Bypass { through, .. } | Self::Interface { through, .. } => Some(through),
        }
    }

    /// The state it enters: j of `o_ij`, k of `o_ijk`.
    #[must_use]
    pub const fn to(self) -> StateId {
        match self {
            Self::Centroid { to, .. }
            | Self::Bypass { to, .. }
            | Self::Interface { to, .. }
            | Self::Custom { to, .. } => to,
        }
    }

    /// The state that a robot is in, or about to enter, when it may begin the option: i of `o_ij`, but
    /// j of `o_ijk`, since an interface option begins on the border from i to j.
    ///
    /// An option can follow another if it begins at the endpoint where the other ends, and leaves the
    /// state that the other enters.
    #[must_use]
    pub const fn leaves(self) -> StateId {
        match self {
            Self::Interface { through, .. } => through,
            Self::Centroid { from, .. } | Self::Bypass { from, .. } | Self::Custom { from, .. } => from,
        }
    }

    /// The state that a robot is in, or about to enter, when the option ends: j of `o_ij`, k of `o_ijk`.
    #[must_use]
    pub const fn enters(self) -> StateId {
        self.to()
    }
}

impl fmt::Display for OptionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Centroid { from, to } => write!(f, "c:{}-{}", from.0, to.0),
            Self::Bypass { from, through, to } => write!(f, "c:{}-{}-{}", from.0, through.0, to.0),
            Self::Interface { from, through, to, portals } => {
                write!(f, "i:{}-{}-{}", from.0, through.0, to.0)?;
                portals.map_or(Ok(()), |(entry, exit)| write!(f, "@{entry}.{exit}"))
            }
            Self::Custom { family, from, to, number } => write!(f, "{family}:{}-{}#{number}", from.0, to.0),
        }
    }
}

/// A text that names no option.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "{0:?} names no option, expected c:FROM-TO, c:FROM-THROUGH-TO, i:FROM-THROUGH-TO, \
     i:FROM-THROUGH-TO@ENTRY.EXIT or LETTER:FROM-TO#NUMBER"
)]
pub struct OptionIdError(pub String);

impl FromStr for OptionId {
    type Err = OptionIdError;

    fn from_str(text: &str) -> Result<Self, OptionIdError> {
        // Each id has one text. Another way to write it, such as `c:03-7`, is refused.
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
    if let Some((states, number)) = rest.split_once('#') {
        return parse_custom(kind, states, number);
    }
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
                ("c", None) => Some(OptionId::Bypass { from, through, to }),
                ("i", portals) => Some(OptionId::Interface { from, through, to, portals }),
                _ => None,
            }
        }
        _ => None,
    }
}

fn parse_custom(kind: &str, states: &str, number: &str) -> Option<OptionId> {
    let family = kind.parse().ok().filter(|&letter| is_custom_letter(letter))?;
    let (from, to) = states.split_once('-')?;
    let [from, to] = [from.parse().ok().map(StateId)?, to.parse().ok().map(StateId)?];
    Some(OptionId::Custom { family, from, to, number: number.parse().ok()? })
}

/// Returns true if a family from outside may use `letter`.
pub(crate) const fn is_custom_letter(letter: char) -> bool {
    letter.is_ascii_lowercase() && !matches!(letter, 'c' | 'i')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_survive_text_and_files() {
        arbtest::arbtest(|u| {
            let [from, through, to] =
                [0, 1, 2].map(|i| StateId(u.arbitrary::<u32>().unwrap_or(i) / 3 * 3 + i));
            let id = match u.int_in_range(0..=3)? {
                0 => OptionId::Centroid { from, to },
                1 => OptionId::Bypass { from, through, to },
                2 => OptionId::Interface { from, through, to, portals: u.arbitrary()? },
                _ => OptionId::Custom {
                    family: *u.choose(&['a', 'b', 'w', 'z'])?,
                    from,
                    to: *u.choose(&[from, to])?,
                    number: u.arbitrary()?,
                },
            };
            assert_eq!(id.to_string().parse(), Ok(id), "{id}");
            let stored = ron::to_string(&id).unwrap();
            assert_eq!(stored, format!("{:?}", id.to_string()), "an id is stored as text");
            assert_eq!(ron::from_str(&stored), Ok(id), "{id}");
            Ok(())
        });
    }

    #[test]
    fn options_of_other_families_come_last() {
        let mut ids: Vec<OptionId> =
            ["a:0-1#0", "i:0-1-2", "c:9-8-7", "c:3-4"].iter().map(|text| text.parse().unwrap()).collect();
        ids.sort_unstable();
        let names: Vec<String> = ids.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["c:3-4", "c:9-8-7", "i:0-1-2", "a:0-1#0"]);
    }

    #[test]
    fn an_option_leaves_the_state_where_it_begins_and_enters_the_one_where_it_ends() {
        let ends = |text: &str| {
            let id: OptionId = text.parse().unwrap();
            [id.leaves().0, id.enters().0]
        };
        assert_eq!(ends("c:3-7"), [3, 7]);
        assert_eq!(ends("c:3-7-9"), [3, 9]);
        assert_eq!(ends("i:3-7-9"), [7, 9], "it begins on the border to 7");
        assert_eq!(ends("w:3-7#0"), [3, 7]);
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
            "c:3-7#0",
            "i:3-7#0",
            "W:3-7#0",
            "w:3-7#",
            "w:3-7#00",
            "w:3-7-9#0",
            "w:3-7",
            "ww:3-7#0",
        ];
        let more =
            ["i:3-7", "i:3-7-3", "i:3-3-7", "i:1-2-3@", "i:1-2-3@0", "i:1-2-3@0.1.2", "i:1-2-4294967296"];
        for text in texts.into_iter().chain(more) {
            assert_eq!(text.parse::<OptionId>(), Err(OptionIdError(text.to_owned())), "{text:?}");
        }
    }
}
