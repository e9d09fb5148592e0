"""The package `sharp`, from a map to a driven plan. Prints "all checks passed" at the end."""

import pathlib
import pickle
import tempfile
import threading
import time

import numpy as np

import sharp


def raises(code, call):
    try:
        call()
    except sharp.SharpError as error:
        assert error.code == code, (error.code, str(error))
        assert str(pickle.loads(pickle.dumps(error))) == str(error)
        return error
    raise AssertionError(f"expected {code}")


# Two rooms and a door of 1.4 m.
cells = np.zeros((62, 122), np.int8)
cells[[0, -1], :] = cells[:, [0, -1]] = 100
cells[:, 60:62] = 100
cells[24:38, 60:62] = 0

rooms = sharp.Map(cells, resolution=0.1, name="rooms")
assert (rooms.cells == cells).all() and rooms.resolution == 0.1 and rooms.origin == (0.0, 0.0, 0.0)
assert sharp.Map("a").cells.shape == (300, 300) and len(sharp.Map("a").problems) == 5
raises("MAP_INVALID", lambda: sharp.Map(cells))
raises("MAP_INVALID", lambda: sharp.Map(cells + 7, resolution=0.1))
raises("MAP_INVALID", lambda: sharp.Map(cells.astype(float), resolution=0.1))
assert sharp.Map("missing.yaml") if False else raises("MAP_UNREADABLE", lambda: sharp.Map("missing.yaml")) or True

limo = sharp.Robot("limo")
assert limo.name == "limo" and 0.3 < limo.outline[0] < 0.35 and limo.turning_radius > 0.3
assert sharp.Robot("husky").turning_radius == 0.0
raises("FILE_UNREADABLE", lambda: sharp.Robot("tank"))

across = {"start": (2.0, 3.0, 0.0), "goal": (10.0, 3.5), "regions": "geometric"}
error = raises("GOAL_OCCUPIED", lambda: sharp.solve(rooms, limo, start=(2, 3, 0), goal=(6.05, 1)))
assert error.nav2 == 206
raises("POSE_INVALID", lambda: sharp.solve(rooms, limo, start=(2, 3), goal=(10, 3)))
raises("USAGE", lambda: sharp.solve(rooms, limo))
raises("USAGE", lambda: sharp.solve(rooms, limo, **across, learning="slow"))

# Solving tells of its progress, and other threads go on meanwhile.
phases, ticks, done = [], [0], threading.Event()


def tick():
    while not done.is_set():
        ticks[0] += 1
        time.sleep(0.005)


thread = threading.Thread(target=tick)
thread.start()
plan = sharp.solve(rooms, limo, **across, progress=lambda phase, _: phases.append(phase))
done.set()
thread.join()
assert ticks[0] > 5, f"the lock was released: {ticks[0]} ticks"
assert {"regions", "abstraction", "search", "verify"} <= set(phases), phases
assert plan.report["status"] == "solved" and plan.predicted["success"] > 0.9, plan.report


def stop(phase, _):
    raise KeyError(phase)


try:
    sharp.solve(rooms, limo, **across, progress=stop)
    raise AssertionError("what the callback raises ends the solve")
except KeyError:
    pass

# A heading at the goal, a slow zone in the second room, and what is wrong with either.
headed = {**across, "goal": (10.0, 3.0, 1.57)}
turned = sharp.solve(rooms, limo, **headed, goal_heading_tolerance=0.4)
ends = [drive.samples[-1][3] for drive in turned.run(episodes=20).drives]
assert np.mean([abs(np.remainder(yaw - 1.57 + np.pi, 2 * np.pi) - np.pi) < 0.4 for yaw in ends]) > 0.8, ends
raises("USAGE", lambda: sharp.solve(rooms, limo, **across, goal_heading_tolerance=0.4))
raises("USAGE", lambda: sharp.solve(rooms, limo, **headed, goal_heading_tolerance=9))
with tempfile.TemporaryDirectory() as folder:
    zone = np.zeros((62, 122), np.uint8)
    zone[:, 62:] = 70
    (pathlib.Path(folder) / "zone.pgm").write_bytes(b"P5\n122 62\n255\n" + zone.tobytes())
    mask = pathlib.Path(folder) / "zone.yaml"
    mask.write_text(
        "image: zone.pgm\nmode: raw\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    slow = sharp.solve(rooms, limo, **across, speed_mask=mask)
    assert slow.predicted["sim_time_s"] > 1.3 * plan.predicted["sim_time_s"], (slow.predicted, plan.predicted)
    raises("MAP_FIELD", lambda: sharp.solve(rooms, limo, **across, speed_mask=mask, speed_base=50))
    raises("FILE_INVALID", lambda: sharp.solve(rooms, limo, **across, prior=mask))

# Where there is no way, the exception says why.
closed = cells.copy()
closed[:, 60:62] = 100
error = raises("NO_VALID_PATH", lambda: sharp.solve(sharp.Map(closed, resolution=0.1), limo, **across))
assert isinstance(error, sharp.NoPlanError) and error.report["status"] == "no_plan" and str(error)

path = plan.path()
assert path.shape[1] == 7 and (np.diff(path[:, 4]) > 0).all(), "time goes on"
assert abs(path[-1, 4] - plan.predicted["sim_time_s"]) < 1e-6
assert len(plan.message()["poses"]) == len(path)

run = plan.run(episodes=10, seed=3)
assert len(run.drives) == 10 and run.success_rate == np.mean([drive.success for drive in run.drives])
again = plan.run(episodes=10, seed=3)
assert all((a.samples == b.samples).all() for a, b in zip(run.drives, again.drives)), "equal seeds, equal drives"
assert run.success_rate >= 0.9, run.report

with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    plan.save(folder / "plan")
    read = sharp.Plan.load(folder / "plan")
    assert read.predicted == plan.predicted and (read.path() == path).all()
    assert (read.run(episodes=2).drives[0].samples == plan.run(episodes=2).drives[0].samples).all()
    for format in ("csv", "json", "mcap", "geojson", "onnx", "safetensors"):
        for file in plan.export(format, folder / f"plan.{format}"):
            assert pathlib.Path(file).stat().st_size > 100, file
    plan.run(episodes=1, record=folder / "drive.mcap")
    assert (folder / "drive.mcap").read_bytes().startswith(b"\x89MCAP")
    raises("USAGE", lambda: plan.export("parquet", folder / "x"))

# A policy is a function of arrays; a driver is asked pose by pose.
legs = [leg for leg, told in enumerate(plan.legs) if told["policy"] == "learnt"]
policy = plan.policy(legs[0])
many = np.random.default_rng(1).uniform(-1, 1, (5, policy.observation_len))
assert policy.act(many).shape == (5, 2) and np.allclose(policy.act(many)[3], policy.act(many[3]))
assert np.abs(policy.act(many)).max() <= 1.0
raises("USAGE", lambda: policy.act(many[:, 1:]))
raises("USAGE", lambda: plan.policy(99))
driver = plan.driver()
waypoint = driver.act(plan.start)
assert waypoint.status == "running" and waypoint.speed > 0 and len(waypoint.position) == 2
assert plan.driver().act((*plan.goal[:2], 0.0)).option
# In a wall or off the map it is lost, as for `sharp serve`, and what is known of the robot stays.
for nowhere in ((6.1, 1.0, 0.0), (-50.0, 0.0, 0.0)):
    for asked in (driver, plan.driver()):
        assert asked.act(nowhere) == sharp.Waypoint(None, 0.0, "", "lost"), nowhere
assert driver.act(plan.start).status in ("running", "recovering")
raises("POSE_INVALID", lambda: driver.act(plan.start, speed=float("nan")))
raises("POSE_INVALID", lambda: driver.act(plan.start, yaw_rate=float("inf")))

print(plan)
print("all checks passed")
