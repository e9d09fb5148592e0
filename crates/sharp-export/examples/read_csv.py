"""Reads what `sharp export PLAN --format csv` wrote: python read_csv.py FILE.csv"""

import sys

import numpy as np

path = np.genfromtxt(sys.argv[1], delimiter=",", names=True, dtype=None, encoding="utf-8")
steps_m = np.hypot(np.diff(path["x_m"]), np.diff(path["y_m"]))
assert np.allclose(np.diff(path["arc_m"]), steps_m, atol=1e-4), "arc length is the length of the way"
assert (np.diff(path["time_s"]) > 0).all() and (path["speed_mps"] > 0).all(), "the robot moves on"
legs = list(dict.fromkeys(path["option"]))
print(f"{len(path)} poses, {path['arc_m'][-1]:.2f} m, {path['time_s'][-1]:.2f} s, legs {' '.join(legs)}")
print(f"fastest {path['speed_mps'].max():.2f} m/s, slowest {path['speed_mps'].min():.2f} m/s")
