"""Soft actor-critic of Stable-Baselines3 on an option that `peer_option serve` runs: `sb3_option.py SEED
LIMIT THREADS RESULT SERVER ARGUMENT...` learns with the library's defaults until 95 % of the episodes
succeed, for at most 150,000 steps and LIMIT seconds, and writes one JSON object to RESULT. The rule of
judging is that of `peer_option`."""

import json
import resource
import struct
import subprocess
import sys
import time

import gymnasium
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback

WANTED = 0.95
JUDGE_EVERY = 1_000
FEW, MANY = 20, 200
MAX_STEPS = 150_000


class Option(gymnasium.Env):
    """The task that a server runs behind a pipe."""

    def __init__(self, server, seed):
        self.server = subprocess.Popen([*server, "serve", str(seed)], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        observations, actions = struct.unpack("<II", self.server.stdout.read(8))
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (observations,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self.size = 4 * observations

    def ask(self, request, size):
        self.server.stdin.write(request)
        self.server.stdin.flush()
        return self.server.stdout.read(size)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.frombuffer(self.ask(b"r", self.size), "<f4").copy(), {}

    def step(self, action):
        answer = self.ask(b"s" + np.asarray(action, "<f4").tobytes(), self.size + 5)
        observation = np.frombuffer(answer[: self.size], "<f4").copy()
        reward, end = struct.unpack("<fB", answer[self.size :])
        return observation, reward, bool(end & 1), bool(end & 2), {"success": bool(end & 4)}

    def close(self):
        self.server.stdin.close()
        self.server.wait()


def success_rate(model, env, episodes):
    successes = 0
    for _ in range(episodes):
        observation, _ = env.reset()
        over = success = False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observation, _, terminated, truncated, info = env.step(action)
            success = success or info["success"]
            over = terminated or truncated
        successes += success
    return successes / episodes


class Judge(BaseCallback):
    """Stops learning when the option is learnt or the time is over."""

    def __init__(self, env, limit):
        super().__init__()
        self.env, self.limit, self.looks = env, limit, []
        self.begun = time.perf_counter()

    def rate(self):
        first = success_rate(self.model, self.env, FEW)
        return first if first < WANTED else min(first, success_rate(self.model, self.env, MANY))

    def _on_step(self):
        if self.num_timesteps % JUDGE_EVERY == 0:
            self.looks.append((self.num_timesteps, self.rate()))
            if self.looks[-1][1] >= WANTED:
                return False
        return time.perf_counter() - self.begun < self.limit


def cpu_seconds():
    return time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def main():
    seed, limit, threads, path, *server = sys.argv[1:]
    torch.set_num_threads(int(threads))
    env, world = Option(server, int(seed)), Option(server, 1000 + int(seed))
    model = SAC("MlpPolicy", env, seed=int(seed), device="cpu")
    cpu = cpu_seconds()
    judge = Judge(world, float(limit))
    model.learn(MAX_STEPS, callback=judge)
    seconds = time.perf_counter() - judge.begun
    env.close()
    world.close()
    best = max((rate for _, rate in judge.looks), default=0.0)
    result = {
        "name": f"stable-baselines3 {stable_baselines3.__version__}, torch {torch.__version__}",
        "reached": best >= WANTED,
        "seconds": seconds,
        "cpu_seconds": cpu_seconds() - cpu,
        "steps": model.num_timesteps,
        "updates": model._n_updates,
        "best": best,
        "looks": judge.looks,
    }
    with open(path, "w") as file:
        json.dump(result, file)


main()
