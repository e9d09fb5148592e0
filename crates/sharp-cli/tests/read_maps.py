"""Reads ROS maps by Nav2's rules, sharing no code with the program, and compares them cell by cell with what it saves.

usage: read_maps.py PROGRAM FOLDER...     (every .yaml below FOLDER that names an image; Python's own library only)

Each map is read in the three modes and with `negate` on and off. What the program saves is read again in trinary mode, and
saved once more: both must be the same grid.
"""

import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import zlib


def pgm(data):
    """Rows of grey values of 0 to 255, the top one first."""
    fields, at = [], 2
    while len(fields) < 3:
        match = re.compile(rb"\s*(?:#[^\n]*\n\s*)*(\d+)").match(data, at)
        fields.append(int(match.group(1)))
        at = match.end()
    width, height, most = fields
    if data[:2] == b"P5":
        body = data[at + 1 : at + 1 + width * height]
    else:
        body = [int(word) for word in data[at:].split()][: width * height]
    return [[round(value * 255 / most) for value in body[row * width : (row + 1) * width]] for row in range(height)]


def png(data):
    """The same; None for a pixel that is not opaque."""
    at, body, palette = 8, b"", None
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        chunk = data[at + 8 : at + 8 + length]
        at += 12 + length
        if kind == b"IHDR":
            width, height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", chunk)
            assert (depth, interlaced) == (8, 0), "only what the maps here are"
        elif kind == b"PLTE":
            palette = [chunk[i : i + 3] for i in range(0, length, 3)]
        elif kind == b"IDAT":
            body += chunk
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    raw, stride, rows, before = zlib.decompress(body), width * channels, [], bytes(width * channels)
    for row in range(height):
        kind, line = raw[row * (stride + 1)], bytearray(raw[row * (stride + 1) + 1 : (row + 1) * (stride + 1)])
        for i in range(stride):
            a = line[i - channels] if i >= channels else 0
            b, c = before[i], before[i - channels] if i >= channels else 0
            nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            line[i] = (line[i] + [0, a, b, (a + b) // 2, nearest][kind]) & 255
        before = bytes(line)
        pixels = [line[i : i + channels] for i in range(0, stride, channels)]
        if palette:
            pixels = [palette[pixel[0]] for pixel in pixels]
        colors = {1: 1, 2: 1, 3: 3, 4: 3}[len(pixels[0])]
        clear = lambda pixel: len(pixel) > colors and pixel[colors] < 255
        rows.append([None if clear(pixel) else sum(pixel[:colors]) / colors for pixel in pixels])
    return rows


def description(path):
    text = path.read_text()
    value = lambda key, default: (re.search(rf"^\s*{key}\s*:\s*(.+?)\s*(?:#.*)?$", text, re.M) or [None, default])[1]
    return {key: value(key, default) for key, default in [
        ("image", None), ("mode", "trinary"), ("negate", "0"), ("occupied_thresh", "0.65"), ("free_thresh", "0.25"),
        ("resolution", None), ("origin", "[0, 0, 0]")]}


def read(path, changes=()):
    """'.', '#' or '?' for each cell, by what map_server publishes: 0, 100, or anything else."""
    about = {**description(path), **dict(changes)}
    data = (path.parent / about["image"].strip("\"'")).read_bytes()
    rows = png(data) if data[:4] == b"\x89PNG" else pgm(data)
    negate = about["negate"].lower() in ("1", "true")
    occupied, free, mode = float(about["occupied_thresh"]), float(about["free_thresh"]), about["mode"].strip("\"'")

    def cell(grey):
        if grey is None:
            return "?"
        shade = grey / 255
        darkness = shade if negate else 1 - shade
        if mode == "raw":
            value = round(grey)
        elif darkness <= free:
            value = 0
        elif darkness >= occupied:
            value = 100
        elif mode == "trinary":
            value = -1
        else:
            value = round((darkness - free) / (occupied - free) * 100)
        return {0: ".", 100: "#"}.get(value, "?")

    known = {}
    return ["".join(known.setdefault(grey, cell(grey)) for grey in row) for row in rows]


def save(program, source, target):
    subprocess.run([program, "map", "save", str(source), "--out", str(target)], check=True, capture_output=True)


def main(program, folders):
    count = 0
    for folder in folders:
        for path in sorted(pathlib.Path(folder).rglob("*.yaml")):
            about = description(path)
            if not (about["image"] and about["resolution"]):
                continue
            if not (path.parent / about["image"].strip("\"'")).exists():
                continue
            for mode in ("trinary", "scale", "raw"):
                for negate in ("0", "1"):
                    with tempfile.TemporaryDirectory() as here:
                        here = pathlib.Path(here)
                        image = (path.parent / about["image"].strip("\"'")).resolve()
                        (here / image.name).write_bytes(image.read_bytes())
                        changes = {**about, "mode": mode, "negate": negate, "image": image.name}
                        text = "".join(f"{key}: {value}\n" for key, value in changes.items())
                        (here / "changed.yaml").write_text(text)
                        save(program, here / "changed.yaml", here / "saved.yaml")
                        save(program, here / "saved.yaml", here / "again.yaml")
                        expected, saved = read(here / "changed.yaml"), read(here / "saved.yaml")
                        assert saved == expected, f"{path}, {mode}, negate {negate}: other cells"
                        assert read(here / "again.yaml") == saved, f"{path}: saved twice"
                        count += 1
    print(f"{count} readings agree")


main(sys.argv[1], sys.argv[2:])
