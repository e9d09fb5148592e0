"""Runs the weights of `sharp export PLAN --format safetensors` in NumPy:
python read_safetensors.py POLICY.safetensors [OBSERVATIONS.json]"""

import json
import sys

import numpy as np
from safetensors import safe_open

with safe_open(sys.argv[1], framework="numpy") as file:
    header = json.loads(file.metadata()["sharp-rl"])
    tensors = {name: file.get_tensor(name) for name in file.keys()}
sizes, notes = header["sizes"], header["notes"]
expected = json.load(open(sys.argv[2])) if len(sys.argv) > 2 else {}
seen = expected.get("observations") or np.random.default_rng(1).uniform(-1, 1, (100, sizes[0]))
x = (np.asarray(seen, np.float32) - tensors["actor.mean"]) / tensors["actor.std"]
for layer in range(len(sizes) - 1):
    x = x @ tensors[f"actor.{layer}.weight"].T + tensors[f"actor.{layer}.bias"]
    x = np.maximum(x, 0.0) if layer < len(sizes) - 2 else x
action = np.tanh(x[:, : sizes[-1] // 2])  # the other half are deviations that training draws with
print(f"layers {sizes}, a full action is {notes['sharp.action_scale']} {notes['sharp.action_unit']}")
if "actions" in expected:
    print(f"action: differs by at most {np.abs(np.asarray(expected['actions']) - action).max():.1e}")
