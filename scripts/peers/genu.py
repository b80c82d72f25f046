"""Runs the program genu and reads its tables."""
import json
import math
import pathlib
import resource
import subprocess

import numpy as np


class Table:
    """A .sto table: column by name."""

    def __init__(self, file):
        lines = pathlib.Path(file).read_text().splitlines()
        start = next(i for i, line in enumerate(lines) if line.strip() == "endheader")
        self.names = lines[start + 1].split("\t")
        self.values = np.array([[float(v) for v in line.split()] for line in lines[start + 2 :] if line.strip()])

    def __getitem__(self, name):
        return self.values[:, self.names.index(name)]

    def __contains__(self, name):
        return name in self.names

    def __len__(self):
        return len(self.values)


class Run:
    """One run of `genu COMMAND SCENE -o OUTPUT`. cpu_s: processor time of the process, which reads the scene and writes results too;
    statistics: of summary.json, with the time of the analysis alone."""

    def __init__(self, program, command, scene, output, *options):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([program, command, str(scene), "-o", str(output), "--no-maps", "--no-plots", *options], capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode != 0:
            raise RuntimeError(f"genu {command} {scene} failed:\n{done.stdout}{done.stderr}")
        self.cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        self.text = done.stdout + done.stderr
        self.motion = Table(pathlib.Path(output) / "motion.sto")
        self.elements = Table(pathlib.Path(output) / "elements.sto")
        self.statistics = json.loads((pathlib.Path(output) / "summary.json").read_text())

    def coordinate(self, name):
        """[rad] or [m]"""
        return self.motion[name] * _to_si(name)

    def rate(self, name):
        """Per second; a series has none."""
        rate = name + "_rate"
        return self.motion[rate] * _to_si(name) if rate in self.motion else np.zeros(len(self.motion))


def _to_si(coordinate):
    """motion.sto holds angles in degrees."""
    return math.pi / 180 if coordinate.split(".")[-1] in ("rx", "ry", "rz", "angle") else 1.0
