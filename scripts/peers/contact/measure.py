"""One contact evaluation: the load at given poses, and its time as the pose moves."""
import time

import numpy as np

from .case import KneeCase, SphereCase


def make_case(given):
    return SphereCase() if given == "sphere" else KneeCase(given)


def wander(pose, i):
    """Poses that move by about 0.01 mm an evaluation, as an integrator's do, so that no stored result serves twice."""
    t = 0.01 * i
    return np.asarray(pose) + [2e-4 * np.sin(1.3 * t), 1e-3 * np.sin(0.7 * t), 0.01 * np.sin(t), 5e-4 * np.sin(1.1 * t), 2e-6 * np.sin(t), 5e-4 * np.sin(0.9 * t)]


def _time(place_and_evaluate, pose, batches=7, least_s=0.15):
    """Smallest of batches [s an evaluation], processor time, whose clock may tick as coarsely as 4 ms: a batch lasts many ticks. The smallest,
    because whatever else the machine computes only adds."""
    times, i, size = [], 0, 1
    while len(times) < batches:
        poses = [wander(pose, i + k) for k in range(size)]
        start = time.process_time()
        for p in poses:
            place_and_evaluate(p)
        used = time.process_time() - start
        i += size
        if used < least_s:
            size *= 2
            continue
        times.append(used / size)
    return float(min(times))


def genu(case, library, grids, poses):
    """The last of the grids is the reference, whose time nobody asks for."""
    from .genu_engine import Engine

    case, rows = make_case(case), []
    for n in grids:
        start = time.process_time()
        engine = Engine(library, case, n)
        build = time.process_time() - start
        loads = []
        for p in poses:
            engine.evaluate(p)
            loads.append(engine.load())
        rows.append({"setting": f"{n} x {n}", "size": n * n * len(case.layers), "build_s": build, "loads": loads,
                     "time_s": _time(engine.evaluate, poses[0]) if n != grids[-1] else None})
    return {"version": engine.version, "rows": rows}


def drake(case, folder, edge_m, poses, layer_edge_m=None, half_space=False, representation="polygon"):
    from .drake_model import DrakeModel, version

    case = make_case(case)
    start = time.process_time()
    model = DrakeModel(case, edge_m, folder, layer_edge_m=layer_edge_m, half_space=half_space, representation=representation)
    model.start()
    build, loads = time.process_time() - start, []
    for p in poses:
        model.place(p)
        loads.append(model.load())

    def evaluate(p):
        model.place(p)
        model.evaluate()

    return {"version": version(), "size": model.tetrahedra + model.triangles, "build_s": build, "loads": loads, "time_s": _time(evaluate, poses[0])}


def opensim(case, folder, edge_m, poses):
    import opensim as program

    from .opensim_knee import OpenSimKnee

    case = make_case(case)
    start = time.process_time()
    model = OpenSimKnee(case, edge_m, folder)
    model.start()
    build, loads = time.process_time() - start, []
    for p in poses:
        model.place(p)
        model.evaluate()
        loads.append(model.load())

    def evaluate(p):
        model.place(p)
        model.evaluate()

    return {"version": program.GetVersion(), "size": model.triangles, "build_s": build, "loads": loads, "time_s": _time(evaluate, poses[0])}
