//! The rules for batches of environments.

use rand::{RngExt, SeedableRng};
use thiserror::Error;

use crate::environment::Stream;
use crate::ppo::{BatchEnvironment, BatchStep, SeenBatch};

/// Steps of a check.
const STEPS: usize = 300;

/// The rule that a batch of environments breaks.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BatchViolation {
    /// There are no slots, or a vector has no components.
    #[error(
        "{slots} slots with an observation of {observation_len} and an action of {action_len} components"
    )]
    Empty {
        /// Episodes side by side.
        slots: usize,
        /// Components of the observation.
        observation_len: usize,
        /// Components of the action.
        action_len: usize,
    },
    /// Something that is seen is NaN or infinite, or was not written at all.
    #[error("entry {entry} of what is seen in slot {slot} is {value} after step {step}")]
    Seen {
        /// The slot.
        slot: usize,
        /// The component of the observation, or behind it of the privileged inputs.
        entry: usize,
        /// The step of the check, 0 for the reset.
        step: usize,
        /// The value.
        value: f32,
    },
    /// A reward is not finite, or a caution not from 0 to 1.
    #[error("step {step} in slot {slot} is {found}")]
    Step {
        /// The slot.
        slot: usize,
        /// The step of the check.
        step: usize,
        /// The step's result.
        found: String,
    },
    /// Slots that are stepped one by one do something else than slots that are stepped together.
    #[error("slot {slot} alone does something else than with the others at step {step}")]
    SlotsDepend {
        /// The slot.
        slot: usize,
        /// The step of the check.
        step: usize,
    },
}

/// Checks the rules of [`BatchEnvironment`] under random actions: `together` steps all slots at once, `alone`, which
/// must be a second batch like it, one slot after the other.
///
/// # Errors
/// Names the first rule that is broken.
pub fn check_batch<B: BatchEnvironment>(
    (together, alone): (&mut B, &mut B),
    rng: &mut Stream,
) -> Result<(), BatchViolation> {
    let spec = together.spec();
    let (slots, action_len) = (spec.slots, spec.lengths.action_len);
    if slots == 0 || spec.lengths.observation_len == 0 || action_len == 0 {
        let observation_len = spec.lengths.observation_len;
        return Err(BatchViolation::Empty { slots, observation_len, action_len });
    }
    let mut streams: Vec<Stream> = (0..slots).map(|_| Stream::from_rng(rng)).collect();
    let mut begin = |batches: [(&mut B, &mut SeenBatch); 2], slot: usize| {
        let before = streams[slot].clone();
        for (batch, seen) in batches {
            streams[slot] = before.clone();
            batch.reset(slot, &mut streams[slot], seen);
        }
    };
    let mut unwritten = SeenBatch::new(&spec);
    unwritten.observations.fill(f32::NAN);
    unwritten.privileged.fill(f32::NAN);
    let (mut seen, mut seen_alone) = (unwritten.clone(), unwritten);
    for slot in 0..slots {
        begin([(&mut *together, &mut seen), (&mut *alone, &mut seen_alone)], slot);
    }
    let mut steps = vec![BatchStep::default(); slots];
    for step in 0..=STEPS {
        for (slot, found) in steps.iter().enumerate() {
            check_slot(&seen, found, (slot, step), slots)?;
            if rows(&seen, slot, slots) != rows(&seen_alone, slot, slots) {
                return Err(BatchViolation::SlotsDepend { slot, step });
            }
        }
        let actions: Vec<f32> = (0..slots * action_len).map(|_| rng.random_range(-1.0..=1.0)).collect();
        together.step(0..slots, &actions, &mut seen, &mut steps);
        for (slot, action) in actions.chunks_exact(action_len).enumerate() {
            let mut single = [BatchStep::default()];
            alone.step(slot..slot + 1, action, &mut seen_alone, &mut single);
            if single[0] != steps[slot] {
                return Err(BatchViolation::SlotsDepend { slot, step });
            }
        }
        for slot in (0..slots).filter(|&slot| steps[slot].is_last()) {
            begin([(&mut *together, &mut seen), (&mut *alone, &mut seen_alone)], slot);
        }
    }
    Ok(())
}

/// What `seen` holds of one of `slots`.
fn rows(seen: &SeenBatch, slot: usize, slots: usize) -> [&[f32]; 2] {
    [&seen.observations, &seen.privileged].map(|all| {
        let length = all.len() / slots;
        &all[slot * length..(slot + 1) * length]
    })
}

/// What is seen in a slot, and what its step gave.
fn check_slot(
    seen: &SeenBatch,
    found: &BatchStep,
    (slot, step): (usize, usize),
    slots: usize,
) -> Result<(), BatchViolation> {
    let row = |values: &[f32]| values[slot * (values.len() / slots)..][..values.len() / slots].to_vec();
    let entries = [row(&seen.observations), row(&seen.privileged)].concat();
    if let Some(entry) = entries.iter().position(|value| !value.is_finite()) {
        return Err(BatchViolation::Seen { slot, entry, step, value: entries[entry] });
    }
    if found.reward.is_finite() && (0.0..=1.0).contains(&found.caution) {
        return Ok(());
    }
    Err(BatchViolation::Step { slot, step, found: format!("{found:?}") })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toy::Ledge;

    #[test]
    fn a_sound_batch_conforms() {
        let checked = check_batch((&mut Ledge::new(5), &mut Ledge::new(5)), &mut Stream::seed_from_u64(1));
        assert_eq!(checked, Ok(()));
    }

    #[test]
    fn broken_rules_are_named() {
        let mut rng = Stream::seed_from_u64(1);
        let check = |alone: &mut Ledge, rng: &mut Stream| {
            check_batch((&mut Ledge::new(3), alone), rng).expect_err("broken").to_string()
        };
        let mut careless = Ledge::new(3);
        careless.caution_max = 2.0;
        assert!(check(&mut careless, &mut rng).starts_with("slot"), "another batch");
        let none = check_batch((&mut Ledge::new(0), &mut Ledge::new(0)), &mut rng).expect_err("no slots");
        assert!(matches!(none, BatchViolation::Empty { slots: 0, .. }), "{none}");
        let (mut one, mut two) = (Ledge::new(3), Ledge::new(3));
        (one.caution_max, two.caution_max) = (2.0, 2.0);
        let found = check_batch((&mut one, &mut two), &mut rng).expect_err("a caution of 2");
        assert!(matches!(found, BatchViolation::Step { .. }), "{found}");
    }
}
