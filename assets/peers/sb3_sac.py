"""Soft actor-critic in Stable-Baselines3: `sb3_sac.py updates SECONDS RESULT` writes gradient steps per
second on one and on two threads, `sb3_sac.py curve SEED RESULT` the returns of learning the point mass,
each as one JSON object to RESULT."""

import json
import math
import sys
import time

import gymnasium
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger

OBSERVATION_LEN, ACTION_LEN = 51, 2
BUFFER = 10_000
CHUNK = 10


def box(length, bound):
    return gymnasium.spaces.Box(-bound, bound, (length,), np.float32)


class Blank(gymnasium.Env):
    """Nothing but the lengths of its vectors."""

    observation_space = box(OBSERVATION_LEN, np.inf)
    action_space = box(ACTION_LEN, 1.0)


class PointMass(gymnasium.Env):
    """The equations of `sharp_rl::toy::PointMass`."""

    observation_space = box(4, np.inf)
    action_space = box(2, 1.0)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        angle = self.np_random.uniform(0.0, 2.0 * math.pi)
        self.place = np.array([math.cos(angle), math.sin(angle)])
        self.velocity = np.zeros(2)
        self.steps_left = 40
        return self.observe(), {}

    def observe(self):
        return np.concatenate([self.place, self.velocity]).astype(np.float32)

    def step(self, action):
        before = math.hypot(*self.place)
        noise = self.np_random.standard_normal(2)
        self.velocity = 0.9 * self.velocity + 0.2 * (action + 0.1 * noise)
        self.place = self.place + 0.2 * self.velocity
        self.steps_left -= 1
        after = math.hypot(*self.place)
        success = after < 0.15
        reward = before - after - 0.02 + (1.0 if success else 0.0)
        return self.observe(), reward, success, not success and self.steps_left == 0, {}


def fill(buffer, rng):
    buffer.observations[:] = rng.uniform(-1, 1, buffer.observations.shape)
    buffer.next_observations[:] = rng.uniform(-1, 1, buffer.next_observations.shape)
    buffer.actions[:] = rng.uniform(-1, 1, buffer.actions.shape)
    buffer.rewards[:] = buffer.observations[:, :, 0] + buffer.actions[:, :, 1]
    buffer.dones[:] = buffer.observations[:, :, 1] > 0.9
    buffer.full = True


def rate(width, batch, threads, seconds):
    torch.set_num_threads(threads)
    kwargs = {"net_arch": [width, width]}
    model = SAC("MlpPolicy", Blank(), batch_size=batch, buffer_size=BUFFER, policy_kwargs=kwargs, device="cpu")
    model.set_logger(Logger(None, []))
    fill(model.replay_buffer, np.random.default_rng(1))
    model.train(CHUNK, batch)
    count, begun = 0, time.perf_counter()
    while count == 0 or time.perf_counter() - begun < seconds:
        model.train(CHUNK, batch)
        count += CHUNK
    return count / (time.perf_counter() - begun)


def updates(seconds, result):
    for width, batch in ((256, 256), (64, 128)):
        for threads in (1, 2):
            result[f"{width}x{width}.b{batch}.{threads}"] = rate(width, batch, threads, seconds)


def evaluate(model, env, episodes):
    total = 0.0
    for _ in range(episodes):
        observation, _ = env.reset()
        over = False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, _ = env.step(action)
            total += reward
            over = terminated or truncated
    return total / episodes


def curve(seed, result):
    torch.set_num_threads(1)
    model = SAC(
        "MlpPolicy",
        PointMass(),
        policy_kwargs={"net_arch": [64, 64]},
        gamma=0.97,
        tau=0.01,
        learning_rate=1e-3,
        batch_size=128,
        buffer_size=BUFFER,
        ent_coef="auto_0.05",
        target_entropy=-2.0,
        learning_starts=500,
        seed=seed,
        device="cpu",
    )
    world = PointMass()
    world.reset(seed=1000 + seed)
    result["steps"], result["returns"] = [], []
    begun = time.perf_counter()
    for _ in range(6):
        model.learn(250, reset_num_timesteps=False)
        result["steps"].append(model.num_timesteps)
        result["returns"].append(evaluate(model, world, 30))
    result["rate"] = model.num_timesteps / (time.perf_counter() - begun)


def main():
    result = {"name": f"stable-baselines3 {stable_baselines3.__version__}, torch {torch.__version__}"}
    what, argument, path = sys.argv[1:]
    if what == "updates":
        updates(float(argument), result)
    else:
        curve(int(argument), result)
    with open(path, "w") as file:
        json.dump(result, file)


main()
