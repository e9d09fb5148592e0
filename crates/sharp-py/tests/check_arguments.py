"""Whatever arguments are given, the package answers or raises an error of its own. Prints "all checks passed" at the end.

What may be raised: `SharpError` for values that mean nothing, and what Python itself raises for objects of another type or
numbers that are too large. A panic of the native half is a BaseException and none of these.
"""

import math
import os
import pathlib
import random
import sys
import tempfile

import numpy as np

import sharp

# Relative names, "../.." too, stay inside a folder that is cleared in the end.
scratch = tempfile.TemporaryDirectory()
below = pathlib.Path(scratch.name) / "a" / "b" / "c"
below.mkdir(parents=True)
os.chdir(below)

CALLS = int(sys.argv[1]) if len(sys.argv) > 1 else 1500
ALLOWED = (sharp.SharpError, TypeError, ValueError, OverflowError, AttributeError, OSError, IndexError)

NUMBERS = [0, 1, -1, 2, 0.1, -0.0, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf, 2**31, 2**64, -(2**70), True]
WORDS = ["", "a", "husky", "limo", "nominal", "nominal*99", "none*nan", "fast", "net", "grid", "\0", "../..", "/dev/null", "ä" * 300]
OTHERS = [None, [], (), {}, b"", b"\0" * 7, object(), lambda *_: None, np.nan, np.array(3), np.zeros((0, 0)), [[1, 2], [3]]]

rng = random.Random(18)


def odd():
    return rng.choice(rng.choice([NUMBERS, WORDS, OTHERS]))


def array():
    shape = tuple(rng.choice([0, 1, 2, 3, 7, 20]) for _ in range(rng.randrange(4)))
    kind = rng.choice([np.int8, np.uint8, np.int64, np.float32, np.float64, bool, object, "U3"])
    return np.full(shape, rng.choice([0, 1, 100, -1, 200]), dtype=kind)


def pose():
    if rng.random() < 0.3:
        return odd()
    numbers = [rng.choice([0.5, 1.0, 2.0, 2.5, 3.5, odd()]) for _ in range(rng.choice([0, 1, 2, 3, 3, 3, 4]))]
    return rng.choice([tuple, list])(numbers)


cells = np.zeros((30, 40), np.int8)
cells[[0, -1], :] = cells[:, [0, -1]] = 100
room = sharp.Map(cells, resolution=0.1)
ends = {"start": (1.0, 1.0, 0.0), "goal": (3.0, 2.0), "regions": "geometric"}
plan = sharp.solve(room, "limo", **ends)
network = next((leg for leg, told in enumerate(plan.legs) if told["policy"] == "learnt"), None)
text = "(footprint: (half_length_m: 0.2, half_width_m: 0.1), drive: Differential(), max_speed_mps: 0.5)"
folder = below / "out"
folder.mkdir()
env = sharp.OptionEnv(plan, leg=0)
many = sharp.VectorEnv(plan, 3)
settings = [
    "options", "learning", "noise", "regions", "simulator", "library", "seed", "failure_cost", "goal_heading_tolerance",
    "speed_mask", "speed_base", "speed_multiplier", "speed_absolute", "prior", "progress", "problem", "start", "goal",
]  # fmt: skip


def ron():
    at = rng.randrange(len(text))
    return text[:at] + rng.choice(["", "NaN", "-", "1e999", "(", "\0", "inf"]) + text[at + rng.randrange(3) :]


def setting():
    name = rng.choice(settings)
    return {name: pose() if name in ("start", "goal") else odd()}


def in_folder(value):
    return folder / value if isinstance(value, str) and value and "\0" not in value and ".." not in value else folder / "x"


def short(value):
    return value if not isinstance(value, (int, float)) or value < 100 else 3


def solve():
    sharp.solve(room, "limo", **{**ends, **setting()}, time_limit=5.0)


def run():
    name = rng.choice(["noise", "simulator", "recovery", "contact_ends", "seed"])
    plan.run(**{"episodes": short(odd()), name: odd()})


def act():
    driver = plan.driver()
    for _ in range(3):
        driver.act(pose(), *(odd() for _ in range(rng.randrange(3))))


def observe():
    if network is not None:
        policy = plan.policy(network)
        good = np.full(policy.observation_len, rng.choice([0.0, math.nan, math.inf, 1e38]))
        policy.act(rng.choice([array(), good]))


def step():
    env.reset(seed=rng.choice([None, 1, 2]))
    seen, reward, *_ = env.step(rng.choice([array(), np.full(2, rng.choice(NUMBERS[:12])), odd()]))
    assert np.isfinite(seen).all() and math.isfinite(reward), (seen, reward)


def step_many():
    many.reset()
    seen, rewards, *_ = many.step(rng.choice([array(), np.full((3, 2), rng.choice(NUMBERS[:12])), odd()]))
    assert np.isfinite(seen).all() and np.isfinite(rewards).all(), (seen, rewards)


calls = [
    lambda: sharp.Map(rng.choice([array(), odd()]), resolution=rng.choice([0.1, odd()]), origin=rng.choice([(0, 0, 0), pose()])),
    lambda: sharp.Robot(odd()),
    lambda: sharp.Robot(ron=rng.choice([ron(), odd()])),
    solve,
    run,
    act,
    observe,
    step,
    step_many,
    lambda: plan.policy(odd()),
    lambda: plan.export(odd(), in_folder(odd())),
    lambda: sharp.Plan.load(odd()),
    lambda: plan.save(in_folder(odd())),
    lambda: sharp.OptionEnv(plan, leg=odd()),
    lambda: sharp.OptionEnv(plan, leg=0, **{rng.choice(["observation", "reward", "noise", "simulator"]): odd()}),
    lambda: sharp.VectorEnv(plan, short(odd())),
    lambda: env._core.reset(odd(), odd()),
    lambda: env._core.step(rng.choice([b"", b"123", np.zeros(2, np.float32).tobytes()]), rng.choice([b"", b"\0", b"\0\7"])),
]

answered = 0
for number in range(CALLS):
    try:
        rng.choice(calls)()
        answered += 1
    except ALLOWED:
        pass
    except BaseException:
        print(f"call {number} of {CALLS}", file=sys.stderr)
        raise

assert answered > CALLS // 10, f"only {answered} of {CALLS} calls mean something"
print(f"{CALLS} calls, {answered} answered")
os.chdir("/")
scratch.cleanup()
print("all checks passed")
