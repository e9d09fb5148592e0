# %% [markdown]
# # First steps with SHARP
# From a map to a driven plan, with pictures. Run it as a script, `python first_steps.py FOLDER`, or cell by cell in an
# editor that knows `# %%`. It needs `pip install "sharp-planner[gym]" matplotlib`.

# %%
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import sharp

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "first-steps")
folder.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# ## A map and a problem
# Maps come from files, from arrays, or from the project. This is environment `a`, a flat of 15 x 15 m. The robot is a Husky, 1 m long, that
# turns in place.

# %%
map = sharp.Map("a")
plan = sharp.solve(map, "husky", problem=2, progress=lambda phase, message: print(f"  {phase}: {message}"))
print(f"predicted success {plan.predicted['success']:.3f}, {plan.predicted['sim_time_s']:.1f} s of driving")
for leg in plan.legs:
    print(f"  {leg['option']:<16} {leg['length_m']:5.1f} m  {leg['time_s']:5.1f} s  success {leg['success']:.3f}  {leg['policy']}")


# %%
def draw_map(axes):
    height, width = map.cells.shape
    extent = (0, width * map.resolution, 0, height * map.resolution)
    axes.imshow(map.cells != 0, cmap="Greys", origin="lower", extent=extent, vmin=0, vmax=1.6)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")


path = plan.path()
figure, axes = plt.subplots(figsize=(7, 6))
draw_map(axes)
points = axes.scatter(path[:, 0], path[:, 1], c=path[:, 5], s=12, cmap="viridis", zorder=3)
axes.plot(*plan.start[:2], "o", color="tab:blue", markersize=9, label="start")
axes.plot(*plan.goal[:2], "*", color="tab:red", markersize=14, label="goal")
axes.legend(loc="lower right")
figure.colorbar(points, label="speed (m/s)")
axes.set_title(f"{len(plan.legs)} legs, {path[-1, 3]:.1f} m, {path[-1, 4]:.1f} s")
figure.savefig(folder / "plan.png", dpi=110, bbox_inches="tight")

# %% [markdown]
# ## Driving it
# Forty episodes under the noise that the plan was made for, and under harsh noise. An episode that touches a wall has failed.

# %%
figure, both = plt.subplots(1, 2, figsize=(12, 5.5))
for axes, noise in zip(both, ("nominal", "harsh")):
    run = plan.run(episodes=40, noise=noise, seed=2)
    draw_map(axes)
    for drive in run.drives:
        axes.plot(drive.poses[:, 0], drive.poses[:, 1], color="tab:green" if drive.success else "tab:red", lw=0.7)
    axes.set_title(f"{noise} noise: {run.success_rate:.0%} arrive, {run.report['mean_sim_time_s']:.1f} s")
figure.savefig(folder / "drives.png", dpi=110, bbox_inches="tight")

# %% [markdown]
# ## A policy and its environment
# The plan's networks are functions of arrays. `ProblemEnv` is the whole problem as a Gymnasium environment, `VectorEnv` many of them at once.
# Here one network drives 64 robots with its actions disturbed more and more.

# %%
policy = plan.policy(next(number for number, leg in enumerate(plan.legs) if leg["policy"] == "learnt"))
envs = sharp.VectorEnv(plan, 64)
rng = np.random.default_rng(1)
levels, shares = (0.0, 0.2, 0.4, 0.8), []
for level in levels:
    seen, _ = envs.reset(seed=1)
    over, success = np.zeros(64, bool), np.zeros(64, bool)
    while not over.all():
        actions = policy.act(seen) + level * rng.standard_normal((64, 2))
        seen, _, terminated, truncated, info = envs.step(np.clip(actions, -1, 1))
        success |= info["is_success"] & ~over
        over |= terminated | truncated
    shares.append(success.mean())
figure, axes = plt.subplots(figsize=(6, 4))
axes.plot(levels, shares, "o-")
axes.set(xlabel="standard deviation added to each action", ylabel="share that arrives", ylim=(-0.03, 1.03))
axes.grid(alpha=0.3)
figure.savefig(folder / "odds.png", dpi=110, bbox_inches="tight")
print("pictures in", folder)
