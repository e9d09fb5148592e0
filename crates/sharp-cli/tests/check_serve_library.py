"""Learns two rooms, talks to `sharp serve --library` and holds every line against the schema: SHARP FOLDER SCHEMA."""

import json
import pathlib
import subprocess
import sys

import jsonschema

sharp, folder, schema = sys.argv[1:]
schema = json.load(open(schema))

folder = pathlib.Path(folder)
width, height = 122, 62
pixels = bytearray([254] * (width * height))
for row in range(height):
    for column in range(width):
        wall = column in (60, 61) and not 24 <= row < 38
        if row in (0, height - 1) or column in (0, width - 1) or wall:
            pixels[row * width + column] = 0
(folder / "rooms.pgm").write_bytes(b"P5\n%d %d\n255\n" % (width, height) + pixels)
(folder / "rooms.yaml").write_text(
    "image: rooms.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
building = ["rooms.yaml", "--options", "centroid", "--regions", "geometric", "--library", "lib"]
subprocess.run([sharp, "learn", *building], check=True, cwd=folder, stdout=subprocess.DEVNULL)


def is_sound(kind, line):
    jsonschema.Draft202012Validator({"$ref": f"#/$defs/{kind}", "$defs": schema["$defs"]}).validate(line)


def refused(kind, line):
    try:
        is_sound(kind, line)
    except jsonschema.ValidationError:
        return True
    return False


server = subprocess.Popen(
    [sharp, "serve", *building], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1, cwd=folder
)


def ask(line, sent, *answers):
    """Sends `line` of the kind `sent` and returns the lines that answer, which must be of these kinds."""
    if sent:
        is_sound(sent, line)
    print(line if isinstance(line, str) else json.dumps(line), file=server.stdin)
    said = [json.loads(server.stdout.readline()) for _ in answers]
    for kind, answer in zip(answers, said):
        is_sound(kind, answer)
    return said


here = {"pose": [2.0, 3.0, 0.0]}
ask({"goal": [10.0, 3.5]}, "goalLine", "waitingLine")
plan, waypoint = ask(here, "poseLine", "planLine", "waypointLine")
assert plan["plan"]["status"] == "solved" and waypoint["odds"]["success"] > 0.8, (plan, waypoint)
assert all(leg["time_s"] is not None for leg in plan["plan"]["plan"]), plan
ask({"pose": [2.3, 3.0, 0.0], "speed": 0.6, "yaw_rate": None}, "poseLine", "waypointLine")
ask({"route": [[4.0, 5.0], [10.0, 5.0, 1.0]]}, "routeLine", "planLine", "planLine")
(refusal,) = ask({"goal": [6.1, 0.5, 0.0]}, "goalLine", "planLine")
assert refusal["plan"]["status"] == "no_plan" and "goal" in refusal["plan"]["reason"], refusal
(lost,) = ask({"pose": [-3.0, 0.0, 0.0]}, "poseLine", "waypointLine")
assert lost == {"waypoint": None, "speed": 0.0, "option": "", "status": "lost"}, lost
ask({"cancel": True}, "cancelLine", "cancelledLine")
(idle,) = ask(here, "poseLine", "waypointLine")
assert idle["status"] == "no_plan", idle
for broken in ["{}", "go", '{"goal": [1]}', '{"goal": [1, 2], "pose": [1, 2, 3]}', '{"route": []}', '{"cancel": false}']:
    ask(broken, None, "errorLine")
long = {"route": [[4.0, 5.0]] * 1001}
ask(long, None, "errorLine")
for kind, broken in [("goalLine", {"goal": [1]}), ("routeLine", {"route": []}), ("cancelLine", {"cancel": False})]:
    assert refused(kind, broken), broken
assert refused("routeLine", long), "a route is too long"
# A plan that was run, which an answer is where the composed odds are poor.
odds = plan["plan"]["predicted"]
is_sound("planLine", {"plan": {**plan["plan"], "predicted": {**odds, "basis": "runs"}}})
assert refused("planLine", {"plan": {**plan["plan"], "predicted": {**odds, "basis": "guessed"}}}), "a basis is known"
assert refused("planLine", {"plan": {**plan["plan"], "predicted": None}}), "a plan has odds"
server.stdin.close()
assert server.wait() == 0
print("all lines are sound")
