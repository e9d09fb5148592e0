"""PyBullet's side of `cargo xtask bench peers sim`: its Husky around a square, timed.

usage: pybullet_husky.py WALLS.json mesh|bodies SECONDS RESULT.json

WALLS.json is a list of boxes [centre x, centre y, half length, half width] in metres, as
crates/sharp-sim/examples/peer_sim.rs prints them; waypoints, controller and time step are the same
as there. `bodies` makes each box a body of its own, `mesh` makes all of them one concave mesh.
Writes one JSON object with steps per second at rest, on the way and against a wall, and waypoints
per second; PyBullet itself prints to stdout.
"""

import importlib.metadata
import json
import math
import sys
import time

import pybullet as p
import pybullet_data

DT_S = 1.0 / 240.0
REACHED_M = 0.1
HOP_M = 2.0
WAYPOINTS = [(0, -2), (2, -2), (2, 0), (2, 2), (0, 2), (-2, 2), (-2, 0), (-2, -2)]
HALF_HEIGHT_M = 0.5

# In front of the slab that the maps have for pushing.
PUSH_FROM = (2.7, 0.0)
PUSH_STEPS = 120

# Of the Husky in pybullet_data.
TRACK_M = 0.5708
WHEEL_RADIUS_M = 0.17775
TORQUE_NM = 50.0


def add_bodies(walls):
    for x, y, half_length, half_width in walls:
        shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[half_length, half_width, HALF_HEIGHT_M])
        p.createMultiBody(0, shape, basePosition=[x, y, HALF_HEIGHT_M])


def add_mesh(walls):
    corners = [(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (0, 2)]
    faces = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
    # One call carries at most 128 Ki numbers of each kind, so large maps need several meshes.
    for first in range(0, len(walls), 3000):
        vertices, indices = [], []
        for x, y, half_length, half_width in walls[first : first + 3000]:
            indices += [len(vertices) + index for index in faces]
            vertices += [
                (x + i * half_length, y + j * half_width, k * HALF_HEIGHT_M) for i, j, k in corners
            ]
        shape = p.createCollisionShape(
            p.GEOM_MESH, vertices=vertices, indices=indices, flags=p.GEOM_FORCE_CONCAVE_TRIMESH
        )
        p.createMultiBody(0, shape)


class Husky:
    def __init__(self, x, y):
        self.body = p.loadURDF("husky/husky.urdf", [x, y, 0.13])
        names = [p.getJointInfo(self.body, j)[1].decode() for j in range(p.getNumJoints(self.body))]
        order = ["front_left_wheel", "rear_left_wheel", "front_right_wheel", "rear_right_wheel"]
        self.wheels = [names.index(name) for name in order]
        self.forces = [TORQUE_NM] * 4

    def drive(self, speed, turn):
        left = (speed - turn * TRACK_M / 2) / WHEEL_RADIUS_M
        right = (speed + turn * TRACK_M / 2) / WHEEL_RADIUS_M
        p.setJointMotorControlArray(
            self.body,
            self.wheels,
            p.VELOCITY_CONTROL,
            targetVelocities=[left, left, right, right],
            forces=self.forces,
        )

    def pose(self):
        (x, y, _), (_, _, qz, qw) = p.getBasePositionAndOrientation(self.body)
        # The floor is flat: the quaternion turns about the vertical axis alone.
        return x, y, 2.0 * math.atan2(qz, qw)


class Circuit:
    def __init__(self, husky):
        self.husky = husky
        self.hops = 0
        self.left_m = HOP_M

    def step(self):
        x, y, yaw = self.husky.pose()
        goal_x, goal_y = WAYPOINTS[self.hops % len(WAYPOINTS)]
        dx, dy = goal_x - x, goal_y - y
        distance = math.hypot(dx, dy)
        self.left_m = distance
        if distance < REACHED_M:
            self.hops += 1
            self.left_m = HOP_M
        bearing = math.remainder(math.atan2(dy, dx) - yaw, math.tau)
        speed = min(2.0 * distance, 1.0) * max(math.cos(bearing), 0.0)
        self.husky.drive(speed, max(-1.5, min(1.5, 3.0 * bearing)))
        p.stepSimulation()


def repeat(seconds, step):
    """Calls `step` for about `seconds`; returns how often and how long it took."""
    begun = time.perf_counter()
    count = 0
    while time.perf_counter() - begun < seconds:
        for _ in range(4):
            step()
        count += 4
    return count, time.perf_counter() - begun


def measure_push(husky, plane, seconds):
    """Steps a second while the robot pushes a wall."""
    p.resetBasePositionAndOrientation(husky.body, [*PUSH_FROM, 0.13], [0, 0, 0, 1])
    p.resetBaseVelocity(husky.body, [0, 0, 0], [0, 0, 0])
    husky.drive(1.0, 0.0)
    for _ in range(PUSH_STEPS):
        p.stepSimulation()
    touched = {contact[2] for contact in p.getContactPoints(bodyA=husky.body)} - {plane}
    assert touched, "the robot touches no wall at %s" % (husky.pose(),)
    steps, push_s = repeat(seconds, p.stepSimulation)
    return steps / push_s


def main():
    path, layout, seconds, result_path = sys.argv[1:]
    with open(path) as file:
        walls = json.load(file)
    p.connect(p.DIRECT)
    p.setAdditionalSearchPath(pybullet_data.getDataPath())
    p.setGravity(0, 0, -9.81)
    p.setTimeStep(DT_S)
    plane = p.loadURDF("plane.urdf")
    {"mesh": add_mesh, "bodies": add_bodies}[layout](walls)
    husky = Husky(-2.0, -2.0)
    husky.drive(0.0, 0.0)
    idle_steps, idle_s = repeat(float(seconds) / 4, p.stepSimulation)
    circuit = Circuit(husky)
    steps, drive_s = repeat(float(seconds), circuit.step)
    hops = circuit.hops + min(max(1.0 - circuit.left_m / HOP_M, 0.0), 1.0)
    result = {
        "name": "pybullet " + importlib.metadata.version("pybullet"),
        "idle": idle_steps / idle_s,
        "steps": steps / drive_s,
        "actions": hops / drive_s,
        "push": measure_push(husky, plane, float(seconds) / 4),
    }
    with open(result_path, "w") as file:
        json.dump(result, file)


main()
