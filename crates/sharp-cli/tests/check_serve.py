"""Talks to `sharp serve` and holds every line against the schema: SHARP PLAN SCHEMA."""

import json
import subprocess
import sys

import jsonschema

sharp, plan, schema = sys.argv[1:]
schema = json.load(open(schema))


def is_sound(kind, line):
    jsonschema.Draft202012Validator({"$ref": f"#/$defs/{kind}", "$defs": schema["$defs"]}).validate(line)


def refused(kind, line):
    try:
        is_sound(kind, line)
    except jsonschema.ValidationError:
        return True
    return False


server = subprocess.Popen([sharp, "serve", plan], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)


def ask(text):
    print(text, file=server.stdin)
    return json.loads(server.stdout.readline())


start = {"pose": [14.0, 14.0, -1.57]}
for line in [start, {**start, "speed": 0.1, "yaw_rate": 0.0}, {**start, "speed": None}]:
    is_sound("poseLine", line)
    answer = ask(json.dumps(line))
    is_sound("answerLine", answer)
    assert answer["status"] == "running" and answer["waypoint"] is not None, answer
nowhere = ask('{"pose": [-50, 0, 0]}')
is_sound("answerLine", nowhere)
assert nowhere == {"waypoint": None, "speed": 0.0, "option": "", "status": "lost"}, nowhere
for number, broken in enumerate(["{}", "go", '{"pose": [1, 2]}', '{"pose": [1, 2, 3], "sped": 1}'], 5):
    is_sound("errorLine", ask(broken))
for broken in [{}, {"pose": [1, 2]}, {"pose": [1, 2, 3], "sped": 1}]:
    assert refused("poseLine", broken), broken
assert ask(json.dumps(start))["status"] in ("running", "recovering"), "it goes on after lines that were lost"
server.stdin.close()
assert server.wait() == 0
print("all lines are sound")
