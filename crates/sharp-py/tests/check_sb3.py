"""Stable-Baselines3 trains on an option of `sharp`, unmodified. Prints "all checks passed" at the end."""

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import sharp

torch.set_num_threads(1)
plan = sharp.solve(sharp.Map("a"), "husky", problem=2)
leg = int(np.argmin([told["length_m"] for told in plan.legs]))
check_env(sharp.OptionEnv(plan, leg))
# By the paper's observation: in the guide's frame an untrained network, whose action is nothing, already follows the guide.
env = Monitor(sharp.OptionEnv(plan, leg, observation="absolute"), info_keywords=("is_success",))
model = SAC("MlpPolicy", env, seed=1, device="cpu", learning_starts=500, policy_kwargs={"net_arch": [64, 64]})
before, _ = evaluate_policy(model, env, 20)
model.learn(5_000)
after, _ = evaluate_policy(model, env, 20)
print(f"return {before:.2f} before, {after:.2f} after 5000 steps")
assert after > before, "it learns"
print("all checks passed")
