"""Runs the program and reads what it writes."""

import json
import math
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
# (name, unit, key of the results, factor to the unit, format)
QUANTITIES = [
    ("contact force", "N", "scalar_force_N", 1, "%.1f"),
    ("contact torque", "N m", "moment_on_moving_about_fixed_origin_Nm", 1, "%.2f"),
    ("peak pressure", "MPa", "peak_pressure_Pa", 1e-6, "%.2f"),
    ("average pressure", "MPa", "mean_pressure_Pa", 1e-6, "%.3f"),
    ("contact area", "mm^2", "area_m2", 1e6, "%.1f"),
]
ERRORS = ["force_N", "moment_Nm", "peak_pressure_Pa", "mean_pressure_Pa", "area_m2"]  # of the same five
SIDES = ("medial", "lateral")


class Failed(Exception):
    """The program's own message."""


class Runner:
    def __init__(self, genu, output, data):
        self.genu, self.output, self.data = genu, output, data

    def call(self, *arguments):
        """The program's standard output. Exit code 3, a computation without a result, is Failed; others end this program."""
        line = [str(self.genu), *map(str, arguments), "--quiet"] + (["--data", str(self.data)] if self.data else [])
        done = subprocess.run(line, capture_output=True, text=True)
        if done.returncode == 3:
            raise Failed(" ".join(done.stderr.split()))
        if done.returncode != 0:
            sys.exit("compare_with_paper: " + " ".join(line) + " ended with " + str(done.returncode) + ": " + done.stderr.strip())
        return done.stdout

    def analyse(self, command, input_path, target, *options):
        folder = self.output / target
        self.call(command, input_path, "--output", folder, "--no-maps", "--no-plots", *options)
        return folder

    def shipped(self, scene):
        return ROOT / "models" / scene

    def contact(self, scene, pose, grid):
        return json.loads(self.call("contact", scene, "--pose", pose, "--grid", grid, "--error", "--json"))


def read_summary(folder):
    return json.loads((folder / "summary.json").read_text())


def at_pose(summary):
    """Pose and contact of a static analysis, or at maximum load."""
    return summary.get("at_maximum_load", summary.get("at_static_pose"))


def values(load):
    """The five quantities of a compartment, or of the total, in their units."""
    numbers = []
    for _, _, key, factor, _ in QUANTITIES:
        number = load[key]
        numbers.append(factor * (math.hypot(*number) if isinstance(number, list) else number))
    return numbers


def errors(load):
    """Estimates of the grid's error, in the same units."""
    return [factor * load["error_estimate"][key] for (_, _, _, factor, _), key in zip(QUANTITIES, ERRORS)]


def sides(contact):
    """Loads of the medial and of the lateral compartment."""
    return [next(load for name, load in contact["compartments"].items() if name.startswith(side)) for side in SIDES]


def by_side(contact):
    """[(medial, lateral)], a row per quantity."""
    return list(zip(*(values(load) for load in sides(contact))))


def read_table(file):
    """A .sto table: columns by name."""
    lines = file.read_text().splitlines()
    start = lines.index("endheader") + 1
    rows = [[float(x) for x in line.split("\t")] for line in lines[start + 1:] if line]
    return dict(zip(lines[start].split("\t"), zip(*rows)))


def read_scene(scene):
    """A shipped scene whose files are found from any folder."""
    file = ROOT / "models" / scene

    def absolute(match):
        path = match.group(2)
        return match.group(1) + (path if path.startswith("data:") else str((file.parent / path).resolve()))

    return re.sub(r"((?:nurbs|urdf|table): \"?)([^\s\"},]+)", absolute, file.read_text())


def with_rule(text, rule):
    """A shipped scene with this way to count its elements; `centre` is the paper's."""
    return re.sub(r"\n( +)(material: \w+)\n", rf"\n\1\2\n\1rule: {rule}\n", text, count=1)


def write_scene(folder, name, text):
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / (name + ".yaml")
    file.write_text(text)
    return file
