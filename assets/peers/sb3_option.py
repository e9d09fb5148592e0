"""Soft actor-critic of Stable-Baselines3 on an option that `peer_option serve` runs: `sb3_option.py
paper|tuned SEED LIMIT THREADS RESULT SERVER ARGUMENT...` learns until 95 % of the episodes succeed, for at
most 150,000 steps and LIMIT seconds, and writes one JSON object to RESULT. `paper` has the library's
defaults, `tuned` the settings of our tuned mode, for which 100 random steps are taken before the clock starts.
The rule of judging is that of `peer_option`."""

import json
import os
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
STOP_RETURN = 500.0
WARMUP = 100
REWARD_SCALE = 0.01
TUNED = {
    "policy_kwargs": {"net_arch": [64, 64]},
    "batch_size": 128,
    "learning_rate": 1e-3,
    "gamma": 0.97,
    "tau": 0.01,
}


SERVERS = []


class Option(gymnasium.Env):
    """The task that a server runs behind a pipe."""

    def __init__(self, server, kind, seed):
        self.server = subprocess.Popen([*server, "serve", kind, str(seed)], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        SERVERS.append(self.server.pid)
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


class Scaled(gymnasium.Wrapper):
    """Observations and rewards of about the size of one."""

    def __init__(self, env, mean, deviation):
        super().__init__(env)
        self.mean, self.deviation = mean, deviation

    def scaled(self, observation):
        return ((observation - self.mean) / self.deviation).astype(np.float32)

    def reset(self, **options):
        observation, info = self.env.reset(**options)
        return self.scaled(observation), info

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self.scaled(observation), REWARD_SCALE * reward, terminated, truncated, info


def spread(env, seed):
    """Mean and deviation of what random actions see."""
    rng = np.random.default_rng(seed)
    seen = [env.reset()[0]]
    while len(seen) < WARMUP:
        observation, _, terminated, truncated, _ = env.step(rng.uniform(-1, 1, env.action_space.shape))
        seen.append(env.reset()[0] if terminated or truncated else observation)
    return np.mean(seen, axis=0), np.maximum(np.std(seen, axis=0), 1e-3)


def judged(model, env, episodes):
    """Success rate and mean return."""
    successes, total = 0, 0.0
    for _ in range(episodes):
        observation, _ = env.reset()
        over = success = False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, info = env.step(action)
            total += reward
            success = success or info["success"]
            over = terminated or truncated
        successes += success
    return successes / episodes, total / episodes


class Judge(BaseCallback):
    """Stops learning when the option is learnt or the time is over."""

    def __init__(self, env, limit, reward_scale):
        super().__init__()
        self.env, self.limit, self.reward_scale = env, limit, reward_scale
        self.looks, self.stop = [], None
        self.begun, self.cpu = time.perf_counter(), cpu_seconds()

    def spent(self):
        seconds = time.perf_counter() - self.begun
        return {"seconds": seconds, "cpu_seconds": cpu_seconds() - self.cpu, "steps": self.num_timesteps}

    def rate(self):
        first, mean_return = judged(self.model, self.env, FEW)
        if self.stop is None and mean_return / self.reward_scale >= STOP_RETURN:
            self.stop = self.spent()
        return first if first < WANTED else min(first, judged(self.model, self.env, MANY)[0])

    def _on_step(self):
        if self.num_timesteps % JUDGE_EVERY == 0:
            self.looks.append((self.num_timesteps, self.rate()))
            if self.looks[-1][1] >= WANTED:
                return False
        return time.perf_counter() - self.begun < self.limit


def cpu_seconds():
    """Of this process and of the servers, which run the environments."""
    total = time.process_time()
    for pid in SERVERS:
        with open(f"/proc/{pid}/stat") as file:
            fields = file.read().rsplit(") ")[-1].split(" ")
        total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total


def main():
    kind, seed, limit, threads, path, *server = sys.argv[1:]
    is_tuned = kind == "tuned"
    torch.set_num_threads(int(threads))
    env, world = Option(server, kind, int(seed)), Option(server, kind, 1000 + int(seed))
    if is_tuned:
        scale = spread(env, int(seed))
        env, world = Scaled(env, *scale), Scaled(world, *scale)
    model = SAC("MlpPolicy", env, seed=int(seed), device="cpu", **(TUNED if is_tuned else {}))
    judge = Judge(world, float(limit), REWARD_SCALE if is_tuned else 1.0)
    model.learn(MAX_STEPS, callback=judge)
    spent = judge.spent()
    env.close()
    world.close()
    best = max((rate for _, rate in judge.looks), default=0.0)
    result = {
        "name": f"stable-baselines3 {stable_baselines3.__version__}, torch {torch.__version__}",
        "reached": best >= WANTED,
        **spent,
        "stop": judge.stop,
        "updates": model._n_updates,
        "best": best,
        "looks": judge.looks,
    }
    with open(path, "w") as file:
        json.dump(result, file)


main()
