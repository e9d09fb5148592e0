"""SHARP: from an occupancy map to a policy that crosses the building under noise and predicts its own success.

    import sharp

    plan = sharp.solve(sharp.Map("a"), "limo", problem=2)
    print(plan.predicted)
    print(plan.run(episodes=100).success_rate)

Lengths are metres, angles radians, times seconds, in the frame of the map. Poses are (x, y, yaw). Errors are
`SharpError` with a `code`; where no plan exists it is a `NoPlanError`. Solving and driving release the interpreter's lock.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import __version__
from ._errors import NoPlanError, SharpError

if TYPE_CHECKING:
    from .environments import OptionEnv, ProblemEnv, VectorEnv

Pose = tuple[float, float, float]
PathLike = str | os.PathLike[str]

__all__ = [
    "Drive",
    "Driver",
    "Map",
    "NoPlanError",
    "OptionEnv",
    "Plan",
    "Policy",
    "ProblemEnv",
    "Robot",
    "Run",
    "SharpError",
    "VectorEnv",
    "Waypoint",
    "__version__",
    "solve",
]


def __getattr__(name: str) -> Any:
    # Only these need Gymnasium.
    if name in ("OptionEnv", "ProblemEnv", "VectorEnv"):
        from . import environments

        return getattr(environments, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _pose(name: str, value: Sequence[float], needs_yaw: bool) -> Pose:
    numbers = [float(number) for number in value]
    expected = (3,) if needs_yaw else (2, 3)
    if len(numbers) not in expected or not np.isfinite(numbers).all():
        shape = "(x, y, yaw)" if needs_yaw else "(x, y) or (x, y, yaw)"
        raise SharpError("POSE_INVALID", f"{name} is {tuple(numbers)}, expected finite numbers {shape}")
    return (numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0)


class Map:
    """An occupancy map.

    `source` is a file (ROS map YAML, MovingAI .map, PNG, PGM, BMP), the name of one of the project's own environments
    ("a" to "g"), or an array of cells, row 0 at the bottom: 0 free, 100 occupied, -1 unknown, as in ROS. Arrays and
    pictures need a `resolution`, metres a cell. `unknown` is "blocked" or "free".
    """

    def __init__(
        self,
        source: PathLike | ArrayLike,
        *,
        resolution: float | None = None,
        origin: Pose = (0.0, 0.0, 0.0),
        name: str = "map",
        unknown: str = "blocked",
        allow_outside: bool = False,
    ) -> None:
        if unknown not in ("blocked", "free"):
            raise SharpError("USAGE", f"unknown is {unknown!r}, expected blocked or free")
        if isinstance(source, (str, os.PathLike)):
            self._core = _core.Map.load(os.fspath(source), resolution, unknown == "free", allow_outside)
            return
        cells = np.asarray(source)
        if cells.ndim != 2 or cells.dtype.kind not in "iub":
            raise SharpError("MAP_INVALID", f"cells are {cells.dtype} of shape {cells.shape}, expected whole numbers in rows and columns")
        if resolution is None:
            raise SharpError("MAP_INVALID", "resolution is missing, expected metres a cell")
        if cells.dtype.kind == "b":
            cells = cells * 100
        if unknown == "free":
            cells = np.where(cells == -1, 0, cells)
        if not np.isin(cells, (0, 100, -1)).all():
            wrong = cells[~np.isin(cells, (0, 100, -1))][0]
            raise SharpError("MAP_INVALID", f"a cell is {wrong}, expected 0 (free), 100 (occupied) or -1 (unknown)")
        height, width = cells.shape
        content = np.ascontiguousarray(cells, dtype=np.int8).tobytes()
        self._core = _core.Map.from_cells(content, (width, height), float(resolution), _pose("origin", origin, True), name)

    @property
    def name(self) -> str:
        """Its name."""
        return self._core.name

    @property
    def cells(self) -> NDArray[np.int8]:
        """The cells, row 0 at the bottom: 0 free, 100 occupied, -1 unknown."""
        width, height = self._core.size
        return np.frombuffer(self._core.cells(), np.int8).reshape(height, width)

    @property
    def resolution(self) -> float:
        """Metres a cell."""
        return self._core.resolution

    @property
    def origin(self) -> Pose:
        """The pose of the lower left corner."""
        return self._core.origin

    @property
    def problems(self) -> list[tuple[Pose, Pose]]:
        """Starts and goals that belong to one of the project's own environments."""
        return self._core.problems

    @property
    def warnings(self) -> list[str]:
        """What was accepted but is probably a mistake."""
        return self._core.warnings

    def __repr__(self) -> str:
        height, width = self.cells.shape
        return f"sharp.Map({self.name!r}, {width} x {height} cells of {self.resolution} m)"


class Robot:
    """A robot: `source` is "husky", "limo" or a robot file (.ron); or its text, as `Robot(ron=TEXT)`."""

    def __init__(self, source: PathLike = "husky", *, ron: str | None = None) -> None:
        self._core = _core.Robot.load(os.fspath(source)) if ron is None else _core.Robot.from_ron(ron)

    @classmethod
    def _of(cls, core: _core.Robot) -> Robot:
        robot = cls.__new__(cls)
        robot._core = core
        return robot

    @property
    def name(self) -> str:
        """Its name."""
        return self._core.name

    @property
    def outline(self) -> tuple[float, float]:
        """Length and width, metres."""
        return self._core.outline

    @property
    def max_speed(self) -> float:
        """Metres per second."""
        return self._core.max_speed

    @property
    def goal_tolerance(self) -> float:
        """Distance within which a goal is reached, metres."""
        return self._core.goal_tolerance

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest bend, metres; 0 for a robot that turns in place."""
        return self._core.turning_radius

    def __repr__(self) -> str:
        return f"sharp.Robot({self.name!r})"


@dataclass(frozen=True)
class Drive:
    """One driven episode."""

    #: reached, collided, timed out or lost.
    outcome: str
    #: Rows of time, x, y, yaw, speed ahead, yaw rate.
    samples: NDArray[np.float64]

    @property
    def success(self) -> bool:
        """Whether it reached the goal."""
        return self.outcome == "reached"

    @property
    def poses(self) -> NDArray[np.float64]:
        """Rows of x, y, yaw."""
        return self.samples[:, 1:4]


@dataclass(frozen=True)
class Run:
    """What came of driving a plan. `report` has the keys of `sharp run --json`."""

    report: dict[str, Any]
    drives: list[Drive]

    @property
    def success_rate(self) -> float:
        """Share of the episodes that reached the goal."""
        return float(self.report["success_rate"])


@dataclass(frozen=True)
class Waypoint:
    """What a robot does next. `status` is running, recovering, reached or lost; without a waypoint it stops."""

    position: tuple[float, float] | None
    speed: float
    option: str
    status: str


class Driver:
    """Drives a robot outside along a plan: poses in, waypoints out. One driver is one run."""

    def __init__(self, core: _core.Driver) -> None:
        self._core = core

    def act(self, pose: Sequence[float], speed: float | None = None, yaw_rate: float | None = None) -> Waypoint:
        """The waypoint for a robot at `pose`; to be asked every half second. Off the map or in an obstacle it is lost."""
        return Waypoint(*self._core.act(_pose("pose", pose, True), speed, yaw_rate))


class Policy:
    """The network that drives a leg of a plan."""

    def __init__(self, core: _core.Policy) -> None:
        self._core = core

    @property
    def option(self) -> str:
        """The leg that it drives."""
        return self._core.option

    @property
    def observation_len(self) -> int:
        """Numbers that it sees."""
        return self._core.observation_len

    def act(self, observation: ArrayLike) -> NDArray[np.float32]:
        """The action, from -1 to 1, for one observation, or one a row for many."""
        seen = np.ascontiguousarray(observation, dtype=np.float32)
        if seen.ndim not in (1, 2) or seen.shape[-1] != self.observation_len:
            expected = f"({self.observation_len},) or (N, {self.observation_len})"
            raise SharpError("USAGE", f"observation has shape {seen.shape}, expected {expected}")
        actions = np.frombuffer(self._core.act(seen.tobytes()), np.float32).copy()
        return actions.reshape(*seen.shape[:-1], self._core.action_len)


class Plan:
    """A solved problem: policies one after the other, with their measured probability of success."""

    def __init__(self, core: _core.Plan, report: dict[str, Any] | None = None) -> None:
        self._core = core
        self._message: dict[str, Any] = json.loads(core.path_json())
        #: What `sharp solve --json` prints; empty for a plan that was read from its folder.
        self.report = report or {}

    @classmethod
    def load(cls, folder: PathLike) -> Plan:
        """Reads the plan in a folder that `sharp solve` or `save` wrote."""
        return cls(_core.Plan.load(os.fspath(folder)))

    def save(self, folder: PathLike) -> None:
        """Writes plan, map, pictures and report into `folder`, as `sharp solve` does."""
        self._core.save(os.fspath(folder))

    @property
    def robot(self) -> Robot:
        """The robot that it is for."""
        return Robot._of(self._core.robot)

    @property
    def start(self) -> Pose:
        """Where it begins."""
        return self._core.start

    @property
    def goal(self) -> Pose:
        """Where it leads; any heading will do."""
        return self._core.goal

    @property
    def predicted(self) -> dict[str, float]:
        """`success`, the lower end of its 95 % interval as `lower95`, and `sim_time_s`."""
        return dict(self._message["predicted"])

    @property
    def legs(self) -> list[dict[str, Any]]:
        """`option`, `role`, `policy`, `length_m`, `time_s` and `success` on arrival of each leg."""
        return list(self._message["legs"])

    def path(self) -> NDArray[np.float64]:
        """Rows of x, y, yaw, arc length, time, speed and leg."""
        return np.frombuffer(self._core.path(), np.float64).reshape(-1, 7)

    def message(self) -> dict[str, Any]:
        """The path, shaped like a nav_msgs/Path message."""
        return self._message

    def picture(self) -> str:
        """The plan as SVG."""
        return self._core.picture()

    def run(
        self,
        episodes: int = 20,
        *,
        noise: str | None = None,
        simulator: str = "rapier2d",
        recovery: bool = True,
        contact_ends: bool = True,
        seed: int = 1,
        record: PathLike | None = None,
    ) -> Run:
        """Drives it in a simulator, under its own noise unless another is named; `record` is an MCAP file to write."""
        options = _Options(
            episodes=int(episodes),
            noise=noise,
            simulator=simulator,
            recovery=recovery,
            contact_ends=contact_ends,
            seed=int(seed),
            record=None if record is None else os.fspath(record),
        )
        report, drives = self._core.run(options)
        samples = [Drive(end, np.frombuffer(rows, np.float64).reshape(-1, 6)) for end, rows in drives]
        return Run(json.loads(report), samples)

    def policy(self, leg: int) -> Policy:
        """The network that drives leg number `leg`, from 0; an error for a leg that a follower drives."""
        return Policy(self._core.policy(leg))

    def driver(self, *, recovery: bool = True) -> Driver:
        """What drives a robot outside."""
        return Driver(self._core.driver(recovery))

    def export(self, format: str, out: PathLike) -> list[str]:
        """Writes it as csv, json, mcap, geojson, onnx or safetensors; returns the names of the files."""
        stem, ending = os.path.splitext(os.fspath(out))
        names = []
        for number, content in enumerate(self._core.export(format), start=1):
            name = f"{stem}{ending}" if number == 1 else f"{stem}-{number}{ending}"
            with open(name, "wb") as file:
                file.write(content)
            names.append(name)
        return names

    def __repr__(self) -> str:
        return f"sharp.Plan({len(self.legs)} legs, success {self.predicted['success']:.3f})"


class _Options:
    """Named values for the native half."""

    def __init__(self, **values: Any) -> None:
        self.__dict__.update(values)


def solve(
    map: Map,
    robot: Robot | str = "husky",
    *,
    start: Sequence[float] | None = None,
    goal: Sequence[float] | None = None,
    problem: int | None = None,
    options: str = "interface",
    learning: str = "fast",
    noise: str = "nominal",
    regions: str = "net",
    simulator: str | None = None,
    library: PathLike | None = None,
    seed: int = 1,
    time_limit: float | None = None,
    failure_cost: float | None = None,
    goal_heading_tolerance: float | None = None,
    speed_mask: PathLike | None = None,
    speed_base: float = 100.0,
    speed_multiplier: float = -1.0,
    speed_absolute: bool = False,
    prior: PathLike | None = None,
    progress: Callable[[str, str], Any] | None = None,
) -> Plan:
    """Solves a problem: from `start` (x, y, yaw) to `goal` (x, y), or `problem` 1 to 5 of a named map.

    `options` is "interface" or "centroid", `learning` "fast", "prior", "paper" or "paper-tuned", `noise` "none", "nominal", "harsh",
    "biased", one of them with a factor ("nominal*2") or a file. `library` is a folder that keeps what is learnt. `progress` is
    called with a phase and a message, from any thread; what it raises ends the solve. `time_limit` is in seconds.
    Equal seeds give equal plans, from equal libraries and without a time limit.

    With `goal_heading_tolerance`, radians, the robot has to arrive in the yaw of `goal`, at most so far off. `speed_mask` is a
    ROS map whose values limit the speed as the speed filter of Nav2 does: base + multiplier x value, in percent of the top
    speed, or in metres per second if `speed_absolute`. `prior` is a file of `sharp prior train`.
    """
    if problem is not None:
        if start is not None or goal is not None:
            raise SharpError("USAGE", "problem stands for start and goal: leave one or the others out")
        if not 1 <= problem <= len(map.problems):
            raise SharpError("PROBLEM_UNKNOWN", f"problem is {problem}, {map.name} has {len(map.problems)}")
        start, goal = map.problems[problem - 1]
    if start is None or goal is None:
        raise SharpError("USAGE", "either start and goal or problem is needed")
    settings = _Options(
        options=options,
        learning=learning,
        noise=noise,
        regions=regions,
        simulator=simulator,
        library=None if library is None else os.fspath(library),
        seed=int(seed),
        time_limit=None if time_limit is None else float(time_limit),
        failure_cost=None if failure_cost is None else float(failure_cost),
        goal_heading_tolerance=None if goal_heading_tolerance is None else float(goal_heading_tolerance),
        speed_mask=None if speed_mask is None else os.fspath(speed_mask),
        speed_rule=(float(speed_base), float(speed_multiplier), bool(speed_absolute)),
        prior=None if prior is None else os.fspath(prior),
    )
    if goal_heading_tolerance is not None and len(goal) != 3:
        raise SharpError("USAGE", "goal_heading_tolerance needs a goal with a yaw: (x, y, yaw)")
    robot = robot if isinstance(robot, Robot) else Robot(robot)
    ends = (_pose("start", start, True), _pose("goal", goal, False))
    text, plan = _core.solve(map._core, robot._core, *ends, settings, progress)
    report = json.loads(text)
    if plan is None:
        code = "TIMEOUT" if report["status"] == "timeout" else "NO_VALID_PATH"
        raise NoPlanError(code, report.get("reason") or "there is no plan", report)
    return Plan(plan, report)
