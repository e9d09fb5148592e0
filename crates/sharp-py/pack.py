"""Packs the wheel from a library that cargo has built already: python pack.py LIBRARY FOLDER

`maturin build --release` makes the same wheel and builds the library itself. The workspace has built it when it is tested,
and would build everything below it once more for another set of features."""

import base64
import hashlib
import pathlib
import re
import sys
import sysconfig
import tomllib
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
CARGO = tomllib.loads((HERE / "../../Cargo.toml").read_text())
PROJECT = tomllib.loads((HERE / "pyproject.toml").read_text())["project"]
STEM = re.sub(r"[-.]+", "_", PROJECT["name"]) + "-" + CARGO["workspace"]["package"]["version"]
TAG = "cp310-abi3-" + re.sub(r"[-.]", "_", sysconfig.get_platform())


def metadata():
    lines = ["Metadata-Version: 2.4", f"Name: {PROJECT['name']}", f"Version: {STEM.split('-')[1]}"]
    lines += [f"Summary: {PROJECT['description']}", f"License-Expression: {PROJECT['license']}"]
    lines += [f"Requires-Python: {PROJECT['requires-python']}"]
    lines += [f"Requires-Dist: {needed}" for needed in PROJECT["dependencies"]]
    for extra, needs in PROJECT["optional-dependencies"].items():
        lines += [f"Provides-Extra: {extra}"]
        lines += [f"Requires-Dist: {needed}; extra == '{extra}'" for needed in needs]
    return "\n".join(lines) + "\nDescription-Content-Type: text/markdown\n\n" + (HERE / PROJECT["readme"]).read_text()


def contents(library):
    package = HERE / "python/sharp"
    for path in sorted(package.glob("*.py*")) + [package / "py.typed"]:
        if path.is_file():
            yield f"sharp/{path.name}", path.read_bytes()
    yield "sharp/_core.abi3.so", library.read_bytes()
    yield f"{STEM}.dist-info/METADATA", metadata().encode()
    wheel = f"Wheel-Version: 1.0\nGenerator: sharp\nRoot-Is-Purelib: false\nTag: {TAG}\n"
    yield f"{STEM}.dist-info/WHEEL", wheel.encode()


def main():
    library, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    target, record = folder / f"{STEM}-{TAG}.whl", ""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, content in contents(library):
            entry = zipfile.ZipInfo(name)
            entry.external_attr, entry.compress_type = 0o644 << 16, zipfile.ZIP_DEFLATED
            wheel.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record += f"{name},sha256={digest},{len(content)}\n"
        name = f"{STEM}.dist-info/RECORD"
        wheel.writestr(zipfile.ZipInfo(name), record + f"{name},,\n")
    print(target)


main()
