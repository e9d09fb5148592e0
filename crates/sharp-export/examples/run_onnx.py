"""Runs a policy of `sharp export PLAN --format onnx`: python run_onnx.py POLICY.onnx [OBSERVATIONS.json]

OBSERVATIONS.json holds "observations" and what this project's own network made of them, "actions" and
"scaled_actions"; without it, random observations are used."""

import json
import sys

import numpy as np
import onnx
import onnxruntime

onnx.checker.check_model(sys.argv[1], full_check=True)
session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
(observation,), notes = session.get_inputs(), session.get_modelmeta().custom_metadata_map
expected = json.load(open(sys.argv[2])) if len(sys.argv) > 2 else {}
seen = expected.get("observations") or np.random.default_rng(1).uniform(-1, 1, (100, observation.shape[1]))
action, scaled = session.run(["action", "scaled_action"], {observation.name: np.asarray(seen, np.float32)})
assert np.abs(action).max() <= 1.0 and np.allclose(scaled, action * json.loads(notes["sharp.action_scale"]))
print(f"{len(action)} actions of {len(action[0])} numbers in {notes['sharp.action_unit']}")
print(f"drives {' '.join(json.loads(notes['sharp.options']))}")
for name, ours, theirs in [("action", expected.get("actions"), action), ("scaled", expected.get("scaled_actions"), scaled)]:
    if ours is not None:
        print(f"{name}: differs by at most {np.abs(np.asarray(ours) - theirs).max():.1e}")
