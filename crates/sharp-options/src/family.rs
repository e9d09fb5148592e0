//! A family of options: how options are made from states (Definitions 4 and 6), as a trait.

use std::fmt::Debug;

use sharp_rbvd::StateAbstraction;

use crate::centroid::CentroidOptions;
use crate::id::OptionKind;
use crate::interface::InterfaceOptions;
use crate::set::{OptionSet, OptionSettings};

/// Makes options ⟨I, β⟩ from the states, regions and portals of an abstraction.
///
/// [`conformance`](crate::conformance) checks what every family promises. Ours are
/// [`CentroidOptions`], [`InterfaceOptions`] and [`BypassOptions`](crate::BypassOptions).
pub trait OptionFamily: Send + Sync + Debug {
    /// A short word for files and messages, such as `centroid`.
    fn name(&self) -> &str;

    /// The set O of this family's options on `states`, with endpoints as large as `settings` say.
    ///
    /// Endpoints are shared: a second option can follow a first only if its initiation set I is the
    /// same endpoint as the termination set β of the first. Equal input gives an equal set. If the
    /// abstraction allows no option, the set is empty.
    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet;
}

impl<F: OptionFamily + ?Sized> OptionFamily for &F {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet {
        (**self).synthesize(states, settings)
    }
}

impl OptionKind {
    /// The family that makes options of this kind; `None` for [`OptionKind::Custom`].
    #[must_use]
    pub fn family(self) -> Option<&'static dyn OptionFamily> {
        match self {
            Self::Centroid => Some(&CentroidOptions),
            Self::Interface => Some(&InterfaceOptions),
            Self::Custom => None,
        }
    }
}
