"""The Gymnasium environments of `sharp`. Prints "all checks passed" at the end."""

import warnings

import numpy as np
from gymnasium.utils.env_checker import check_env

import sharp

plan = sharp.solve(sharp.Map("a"), "husky", problem=2)

for observation in ("guide", "absolute"):
    for reward in ("progress", "paper"):
        for env in (
            sharp.OptionEnv(plan, 0, observation=observation, reward=reward),
            sharp.ProblemEnv(plan, observation=observation, reward=reward),
        ):
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                # An environment without pictures has no render mode, which is worth a remark to Gymnasium.
                warnings.filterwarnings("ignore", message=".*render_mode.*")
                warnings.filterwarnings("ignore", message=".*no render modes.*")
                # It is made from a plan, not from the register.
                warnings.filterwarnings("ignore", message=".*spec.*")
                check_env(env, skip_render_check=True)

# Seeds repeat episodes, and going on without a seed does not.
env = sharp.OptionEnv(plan, 1)
first = [env.reset(seed=7)[0], env.reset()[0], env.reset()[0]]
assert all((a == b).all() for a, b in zip(first, [env.reset(seed=7)[0], env.reset()[0], env.reset()[0]]))
assert not (first[0] == first[1]).all(), "the episodes of one seed differ"

# The plan's own networks drive the whole problem in its environment.
policy = plan.policy(next(leg for leg, told in enumerate(plan.legs) if told["policy"] == "learnt"))
env, successes = sharp.ProblemEnv(plan), 0
for episode in range(5):
    seen, _ = env.reset(seed=episode)
    over = False
    while not over:
        seen, reward, terminated, truncated, info = env.step(policy.act(seen))
        over = terminated or truncated
    successes += info["is_success"]
assert successes >= 4, f"{successes} of 5"

# Side by side: the same as alone, one slot after the other begins anew.
count = 4
vector = sharp.VectorEnv(plan, count, leg=0)
alone = [sharp.OptionEnv(plan, 0) for _ in range(count)]
seen, _ = vector.reset(seed=11)
for slot, env in enumerate(alone):
    assert (seen[slot] == env.reset(seed=11 + slot)[0]).all()
rng, over, ends = np.random.default_rng(2), [False] * count, 0
for _ in range(300):
    actions = rng.uniform(-1, 1, (count, 2)).astype(np.float32)
    seen, rewards, terminated, truncated, infos = vector.step(actions)
    assert vector.observation_space.contains(seen)
    for slot, env in enumerate(alone):
        if over[slot]:
            assert rewards[slot] == 0 and (seen[slot] == env.reset()[0]).all(), "the next episode"
            over[slot] = False
            continue
        expected = env.step(actions[slot])
        assert (seen[slot] == expected[0]).all() and rewards[slot] == expected[1]
        assert (terminated[slot], truncated[slot]) == expected[2:4]
        over[slot] = expected[2] or expected[3]
        ends += over[slot]
assert ends > 3, f"{ends} episodes ended"

# Seeds may be numbers of NumPy; a list has one for each slot.
seen, _ = vector.reset(seed=11)
for seed in (np.int64(11), [11, 12, 13, 14], np.arange(11, 15)):
    assert (vector.reset(seed=seed)[0] == seen).all(), seed
assert (sharp.OptionEnv(plan, 0).reset(seed=np.int64(11))[0] == seen[0]).all()

for call in (
    lambda: sharp.OptionEnv(plan, 99),
    lambda: sharp.OptionEnv(plan, 0, reward="gold"),
    lambda: sharp.ProblemEnv(plan, observation="lidar"),
    lambda: sharp.VectorEnv(plan, 0),
    lambda: vector.step(np.zeros((count + 1, 2))),
    lambda: vector.reset(seed=[1] * (count - 1)),
    lambda: vector.reset(seed=[1] * (count + 1)),
    # It was a panic.
    lambda: sharp.OptionEnv(plan, 0).step(np.zeros(2)),
    lambda: sharp.VectorEnv(plan, count, leg=0).step(np.zeros((count, 2))),
):
    try:
        call()
    except sharp.SharpError as error:
        assert error.code == "USAGE", error.code
    else:
        raise AssertionError("refused")
print("all checks passed")
