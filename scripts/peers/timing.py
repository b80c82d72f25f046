"""Time of one element in one evaluation of the accelerations: copies of it minus none, over the copies; OpenSim beside Genu."""
import json
import subprocess
import time

from .opensim_model import OpenSimModel
from .scene import Scene

COPIES = 50
EVALUATIONS = 20  # between two readings of the clock
REPEATS = 30

# What of Genu's benchmark OpenSim has.
CASES = [
    "ligament_straight", "ligament_via_points", "ligament_cylinder", "ligament_sphere", "ligament_ellipsoid", "muscle_rigid_straight",
    "muscle_rigid_cylinder", "muscle_rigid_ellipsoid", "muscle_compliant_straight", "muscle_compliant_cylinder", "muscle_compliant_ellipsoid",
]
# About which the poses wander, as in ElementBenchmark.cpp: hip; knee rx, ry, rz, x, y, z.
MIDDLE = {"hip_angle": 0.05, "knee_rx": 0.02, "knee_ry": 0.03, "knee_rz": 0.35, "knee_x": 0.002, "knee_y": 0.001, "knee_z": 0.001}


class _Clocked:
    """A model whose knee turns a little from evaluation to evaluation."""

    def __init__(self, scene, copies, muscle):
        self.built = OpenSimModel(scene, muscle=muscle, copies=copies)
        self.built.start()
        self.built.place(MIDDLE, {k: 0.01 for k in MIDDLE})
        if copies and scene.of("muscles"):
            for force in self.built.forces.values():
                force.setActivation(self.built.state, 0.3)
            self.built.model.equilibrateMuscles(self.built.state)
        self.knee = self.built.coordinates["knee_rz"]
        self.i = 0

    def run(self, evaluate=True):
        """Seconds of processor time an evaluation."""
        model, state, knee = self.built.model, self.built.state, self.knee
        start = time.process_time()
        for _ in range(EVALUATIONS):
            self.i += 1
            knee.setValue(state, 0.35 + 1e-4 * (self.i % 50), False)
            if evaluate:
                model.realizeAcceleration(state)
        return (time.process_time() - start) / EVALUATIONS


def time_opensim(scene, muscle):
    """Smallest times of the two models over repeats in turns: (an element, all with, all without) [s]. What Python does between
    evaluations is the same in both, and falls out of the difference."""
    loaded, bare = _Clocked(scene, COPIES, muscle), _Clocked(scene, 0, muscle)
    for model in (loaded, bare):
        model.run()
    pairs = [(loaded.run(), bare.run()) for _ in range(REPEATS)]
    with_all, without = min(p[0] for p in pairs), min(p[1] for p in pairs)
    return (with_all - without) / COPIES, with_all, without


def time_genu(benchmark):
    """Name -> seconds, from element_benchmark."""
    text = subprocess.run([benchmark, "--benchmark_filter=force/", "--benchmark_format=json"], capture_output=True, text=True, check=True).stdout
    return {b["name"].split("/")[1]: 1e-9 * b["least_ns"] for b in json.loads(text)["benchmarks"]}


def compare(benchmark, folder):
    """Rows: case, OpenSim's muscle or "", Genu's time, OpenSim's time [s]."""
    subprocess.run([benchmark, "--write-scenes", str(folder)], check=True)
    own = time_genu(benchmark)
    rows = []
    for case in CASES:
        scene = Scene(folder / f"{case}.yaml")
        for muscle in ("de-groote", "millard") if scene.of("muscles") else ("de-groote",):
            rows.append((case, muscle if scene.of("muscles") else "", own[case], time_opensim(scene, muscle)[0]))
    return rows
