//! Networks, priors and training states from safetensors.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sharp_drive::{CostModel, Prior};
use sharp_rl::{Actor, ActorScratch, Mlp, TrainState};

fuzz_target!(|bytes: &[u8]| {
    _ = Mlp::from_bytes(bytes);
    _ = TrainState::from_bytes(bytes);
    _ = Prior::from_bytes(bytes);
    _ = CostModel::from_bytes(bytes);
    let Ok((actor, notes)) = Actor::from_bytes(bytes) else { return };
    let spec = actor.spec();
    if spec.observation_len > 4096 || spec.action_len > 4096 {
        return;
    }
    let mut action = vec![0.0; spec.action_len];
    actor.act_mean(&vec![0.5; spec.observation_len], &mut ActorScratch::default(), &mut action);
    let again = Actor::from_bytes(&actor.to_bytes(&notes)).expect("just written");
    assert_eq!(again, (actor, notes), "written and read");
});
