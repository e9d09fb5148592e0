"""Reads what `sharp export PLAN --format json` wrote, as a nav_msgs/Path: python read_json.py FILE.json"""

import json
import math
import sys

with open(sys.argv[1]) as file:
    path = json.load(file)
assert path["schema"] == "sharp.path/1" and path["header"]["frame_id"] == "map"
for stamped in path["poses"]:
    position, orientation = stamped["pose"]["position"], stamped["pose"]["orientation"]
    yaw = 2.0 * math.atan2(orientation["z"], orientation["w"])
    assert set(position) == {"x", "y", "z"} and set(orientation) == {"x", "y", "z", "w"}
    assert abs(math.remainder(yaw - stamped["yaw_rad"], math.tau)) < 1e-9
    stamp = stamped["header"]["stamp"]
    assert abs(stamp["sec"] + 1e-9 * stamp["nanosec"] - stamped["time_s"]) < 1e-8
predicted, last = path["predicted"], path["poses"][-1]
print(f"{len(path['poses'])} poses, {last['arc_m']:.2f} m, {last['time_s']:.2f} s, {len(path['legs'])} legs")
print(f"success {predicted['success']:.3f}, at least {predicted['lower95']:.3f}")
