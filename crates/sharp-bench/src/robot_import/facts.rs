//! What the files of a robot say, each thing once, with its source.

use std::collections::BTreeMap;

use sharp_space::Footprint;

/// A number that a robot file may hold, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Quantity {
    MaxSpeed,
    MaxAccel,
    MaxYawRate,
    MaxYawAccel,
    GoalTolerance,
    Track,
    Wheelbase,
    MaxSteer,
    SteerRate,
    TurningRadius,
    Mass,
    YawInertia,
}

#[derive(Clone, Debug)]
pub(super) struct Fact<T> {
    pub(super) value: T,
    pub(super) source: String,
}

/// What is known so far; what was told first stays.
#[derive(Clone, Debug, Default)]
pub(super) struct Facts {
    pub(super) name: Option<String>,
    pub(super) footprint: Option<Fact<Footprint>>,
    pub(super) is_car: Option<Fact<bool>>,
    pub(super) numbers: BTreeMap<Quantity, Fact<f64>>,
    pub(super) warnings: Vec<String>,
}

impl Facts {
    pub(super) fn add(&mut self, quantity: Quantity, value: f64, source: impl Into<String>) {
        let source = source.into();
        if let Some(known) = self.numbers.get(&quantity) {
            if known.value != value {
                self.warnings.push(format!(
                    "{source} is {value}, but {} says {}, which counts",
                    known.source, known.value
                ));
            }
            return;
        }
        self.numbers.insert(quantity, Fact { value, source });
    }

    pub(super) fn say_drive(&mut self, is_car: bool, source: impl Into<String>) {
        self.is_car.get_or_insert_with(|| Fact { value: is_car, source: source.into() });
    }

    pub(super) fn say_footprint(&mut self, footprint: Footprint, source: impl Into<String>) {
        let source = source.into();
        match &self.footprint {
            Some(known) if known.value != footprint => {
                self.warnings
                    .push(format!("{source} is another footprint than {}, which counts", known.source));
            }
            Some(_) => {}
            None => self.footprint = Some(Fact { value: footprint, source }),
        }
    }

    pub(super) fn number(&self, quantity: Quantity) -> Option<f64> {
        self.numbers.get(&quantity).map(|fact| fact.value)
    }
}
