"""Gymnasium environments: one option, a whole problem, and many of either side by side.

An episode of `OptionEnv` begins where the leg may be entered and ends where it is done. An episode of `ProblemEnv` is the whole
way from start to goal, over the guides of the plan. Actions are two numbers from -1 to 1. With `observation="guide"` they
correct a follower's speed and direction, and the observation is what the plan's own networks see. With "absolute" they are the
paper's: a displacement in the world, seen from the configuration and the vector to the nearest guide point.

Contact ends an episode as a failure (`terminated`), a used-up horizon cuts it (`truncated`), and `info["is_success"]` says
whether the end was reached. The reward is "progress" along the guide, or the "paper" pseudo-reward.
"""

from __future__ import annotations

import operator
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from . import Plan, SharpError, _core, _Options

_TERMINATED, _TRUNCATED, _SUCCESS = 1, 2, 4
#: Observations of the guide are about one in size; those of a configuration are metres.
_BOUND = {"guide": 10.0, "absolute": 1e6}


def _tasks(plan: Plan, leg: int | None, count: int, settings: dict[str, Any]) -> _core.Tasks:
    if leg is not None and leg < 0:
        raise SharpError("USAGE", f"leg is {leg}, expected 0 to {len(plan.legs) - 1}")
    return _core.Tasks(plan._core, _Options(leg=leg, count=count, **settings))


def _spaces(tasks: _core.Tasks, observation: str) -> tuple[Any, Any]:
    bound = _BOUND[observation]
    seen = gymnasium.spaces.Box(-bound, bound, (tasks.observation_len,), np.float32)
    return seen, gymnasium.spaces.Box(-1.0, 1.0, (tasks.action_len,), np.float32)


class _Env(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    metadata = {"render_modes": []}

    def __init__(self, plan: Plan, leg: int | None, settings: dict[str, Any]) -> None:
        self.plan = plan
        self._core = _tasks(plan, leg, 1, settings)
        self._bound = _BOUND[settings["observation"]]
        self.observation_space, self.action_space = _spaces(self._core, settings["observation"])
        self._seed: int | None = None

    def _seen(self, content: bytes) -> NDArray[np.float32]:
        return np.clip(np.frombuffer(content, np.float32), -self._bound, self._bound)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode; with a seed, the episodes from here on repeat those after the same seed."""
        # Gymnasium takes Python's whole numbers only.
        seed = None if seed is None else operator.index(seed)
        super().reset(seed=seed)
        # Without any seed a fresh environment is random, as Gymnasium's are.
        if seed is None and self._seed is None:
            seed = int(self.np_random.integers(2**63))
        self._seed = seed if seed is not None else self._seed
        return self._seen(self._core.reset(0, seed)), {}

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Carries out one action, half a second of driving."""
        given = np.ascontiguousarray(action, dtype=np.float32)
        seen, rewards, flags = self._core.step(given.tobytes(), b"\0")
        reward, flag = float(np.frombuffer(rewards, np.float32)[0]), flags[0]
        info = {"is_success": bool(flag & _SUCCESS)}
        return self._seen(seen), reward, bool(flag & _TERMINATED), bool(flag & _TRUNCATED), info


def _settings(observation: str, reward: str, noise: str | None, simulator: str) -> dict[str, Any]:
    if observation not in _BOUND:
        raise SharpError("USAGE", f"observation is {observation!r}, expected guide or absolute")
    return {"observation": observation, "reward": reward, "noise": noise, "simulator": simulator}


class OptionEnv(_Env):
    """One leg of a plan, again and again."""

    def __init__(
        self,
        plan: Plan,
        leg: int = 0,
        *,
        observation: str = "guide",
        reward: str = "progress",
        noise: str | None = None,
        simulator: str = "kinematic",
    ) -> None:
        super().__init__(plan, leg, _settings(observation, reward, noise, simulator))


class ProblemEnv(_Env):
    """A whole problem, from start to goal."""

    def __init__(
        self,
        plan: Plan,
        *,
        observation: str = "guide",
        reward: str = "progress",
        noise: str | None = None,
        simulator: str = "kinematic",
    ) -> None:
        super().__init__(plan, None, _settings(observation, reward, noise, simulator))


class VectorEnv(gymnasium.vector.VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """Many of them side by side, on all threads: a leg of a plan, or with `leg=None` the whole problem.

    After the end of an episode the next action of its slot is ignored and begins another (`AutoresetMode.NEXT_STEP`).
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        plan: Plan,
        num_envs: int,
        leg: int | None = None,
        *,
        observation: str = "guide",
        reward: str = "progress",
        noise: str | None = None,
        simulator: str = "kinematic",
    ) -> None:
        if num_envs < 1:
            raise SharpError("USAGE", f"num_envs is {num_envs}, expected 1 or more")
        settings = _settings(observation, reward, noise, simulator)
        self.plan, self.num_envs = plan, num_envs
        self._core = _tasks(plan, leg, num_envs, settings)
        self._bound = _BOUND[observation]
        self.single_observation_space, self.single_action_space = _spaces(self._core, observation)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._is_over = np.zeros(num_envs, np.uint8)
        self._is_seeded = False

    def _seen(self, content: bytes) -> NDArray[np.float32]:
        seen = np.clip(np.frombuffer(content, np.float32), -self._bound, self._bound)
        return seen.reshape(self.num_envs, -1)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode in each slot; one seed stands for itself and those after it."""
        if isinstance(seed, np.integer):
            seed = operator.index(seed)
        super().reset(seed=seed if isinstance(seed, int) else None)
        if seed is None and not self._is_seeded:
            seed = int(self.np_random.integers(2**62))
        if isinstance(seed, int):
            seed = [seed + slot for slot in range(self.num_envs)]
        seeds = seed if seed is not None else [None] * self.num_envs
        if len(seeds) != self.num_envs:
            raise SharpError("USAGE", f"seed has {len(seeds)} numbers, expected one, or one for each of {self.num_envs} slots")
        self._is_seeded = True
        self._is_over[:] = 0
        rows = [self._core.reset(slot, number) for slot, number in enumerate(seeds)]
        return self._seen(b"".join(rows)), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Carries out one action in each slot."""
        given = np.ascontiguousarray(actions, dtype=np.float32)
        if given.shape != self.action_space.shape:
            raise SharpError("USAGE", f"actions have shape {given.shape}, expected {self.action_space.shape}")
        seen, rewards, flags = self._core.step(given.tobytes(), self._is_over.tobytes())
        flag = np.frombuffer(flags, np.uint8)
        terminated, truncated = (flag & _TERMINATED) != 0, (flag & _TRUNCATED) != 0
        self._is_over = (terminated | truncated).astype(np.uint8)
        everywhere = np.ones(self.num_envs, np.bool_)
        info = {"is_success": (flag & _SUCCESS) != 0, "_is_success": everywhere}
        return self._seen(seen), np.frombuffer(rewards, np.float32).astype(np.float64), terminated, truncated, info
