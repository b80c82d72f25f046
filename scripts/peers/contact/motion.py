"""A knee that settles under a load, and its gait, in Drake and OpenSim. Genu's own runs: own_runs.py."""
import pathlib
import time

import numpy as np

from . import curve
from .case import KneeCase
from .limited import reach
from ..scene import quantities

FREE = ("rx", "y", "z")


class Scene:
    """Curves of a knee's scene: prescribed coordinates and the force on the moving body, at its point."""

    def __init__(self, case, data):
        given, folder = case.yaml, case.file.parent
        self.cycle_s = curve.quantity(given.get("analysis", {}).get("cycle", "1 s"))
        read = lambda v: curve.read(v, folder, pathlib.Path(data) if data else None, self.cycle_s)
        self.prescribed = {n: read(c["prescribed"]) for n, c in given["model"]["coordinates"].items() if isinstance(c, dict) and "prescribed" in c}
        (load,) = given["loads"].values()
        force = load["force"] if isinstance(load["force"], list) else load["force"].split(",")
        self._force = [read(f) for f in force]
        self.point = np.array(quantities(load["point"]["at"]))
        self.link = case.scene.urdf.links[load["body"]]

    def force(self, t):
        return np.array([float(f(t)) for f in self._force])

    def time_of_largest_force(self):
        t = np.linspace(0, self.cycle_s, 101)
        return float(t[np.argmax([np.linalg.norm(self.force(x)) for x in t])])

    def at(self, t, derivative=0):
        return {n: float(c(t, derivative)) for n, c in self.prescribed.items()}


def _damping(mass):
    """For settling only: about critical for the stiffest mode would be too slow for the softest, so between them [N s/m, N m s/rad]."""
    return {"y": 300 * mass, "z": 300 * mass, "rx": 300 * mass * 0.025**2}


def _start(start, case, scene, t):
    """Pose in Genu's order: prescribed coordinates at t, free ones as given."""
    fixed = scene.at(t)
    return [fixed[n] if n in fixed else start[n] for n in ("rx", "ry", "rz", "x", "y", "z")]


def _residual(pose, load, scene, t):
    """Force and moment along the free coordinates that contact and load leave [N]; moments over 25 mm."""
    from ..rotation import from_body_xyz

    F, arm = scene.force(t), from_body_xyz(pose[:3]) @ scene.point
    force = np.array(load["force"]) + F
    moment = np.array(load["moment"]) - np.cross(pose[3:], load["force"]) + np.cross(arm, F)
    return [float(force[1]), float(force[2]), float(moment[0] / 0.025)]


def drake_settle(file, data, folder, edge_m, t, start, step_s, still=1e-6, longest_s=1.0, longest_way_m=0.5e-3):
    """Discrete steps with damped joints until the speed is below `still` [m/s]. A step sees the contact where it starts: y and rx, which the load
    drives, are damped so that it moves them by longest_way_m a step at most, or the body would pass through the layer before it is seen."""
    from pydrake.systems.analysis import Simulator

    from .drake_model import DrakeModel, inertia_of, version

    case = KneeCase(file)
    scene = Scene(case, data)
    force = scene.force(t)
    damping = _damping(scene.link.mass)
    damping["y"] = max(damping["y"], np.linalg.norm(force) * step_s / longest_way_m)
    damping["rx"] = damping["y"] * 0.025**2
    model = DrakeModel(case, edge_m, folder, time_step=step_s, welded=scene.at(t), inertia=inertia_of(scene.link), damping=damping)
    model.add_load(scene.point, lambda _: force)
    model.start()
    simulator = Simulator(model.diagram)
    model.use(simulator.get_mutable_context())
    model.place(_start(start, case, scene, t))
    simulator.Initialize()
    begin, n, rest = time.process_time(), 0, 0
    while rest < 3:
        n += 1
        simulator.AdvanceTo(n * step_s)
        rest = rest + 1 if n > 5 and model.speed() < still else 0
        if n * step_s > longest_s:
            raise RuntimeError(f"not at rest after {longest_s:g} s of simulated time: speed {model.speed():.2g} m/s")
    used = time.process_time() - begin
    pose, load = model.read(), model.load()
    return {"version": version(), "time_s": used, "steps": n, "pose": pose, "load": load, "residual_N": _residual(pose, load, scene, t)}


def _vertical(load, case):
    """Vertical force of each compartment; a contact belongs to the layer whose middle is nearest [N]."""
    forces = [0.0] * len(case.layers)
    for z, f in load["pairs"]:
        forces[min(range(len(forces)), key=lambda k: abs(sum(case.layers[k].rectangle[2:]) / 2 - z))] += f
    return forces


def drake_gait(file, data, folder, edge_m, start, rates, step_s=0.0, accuracy=None, scheme=None, longest_step_s=None, damping_z=0.0, outputs=100):
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

    from .drake_model import DrakeModel, inertia_of, version

    case = KneeCase(file)
    scene = Scene(case, data)
    model = DrakeModel(case, edge_m, folder, time_step=step_s, driven=scene.prescribed, inertia=inertia_of(scene.link), damping={"z": damping_z})
    model.add_load(scene.point, scene.force)
    model.start(scene.cycle_s, lead_s=step_s)
    simulator = Simulator(model.diagram)
    if scheme:
        config = SimulatorConfig()
        config.integration_scheme, config.accuracy, config.max_step_size, config.use_error_control = scheme, accuracy, longest_step_s, True
        ApplySimulatorConfig(config, simulator)
    model.use(simulator.get_mutable_context())
    model.place(_start(start, case, scene, 0.0))
    fixed = scene.at(0.0, 1)
    model.set_rates([fixed[n] if n in fixed else rates[n] for n in ("rx", "ry", "rz", "x", "y", "z")])
    simulator.Initialize()
    begin, poses, forces, follow = time.process_time(), [model.read()], [_vertical(model.load(), case)], 0.0
    reading = 0.0
    for k in range(1, outputs + 1):
        t = scene.cycle_s * k / outputs
        simulator.AdvanceTo(t)
        pause = time.process_time()
        reach(f"at {t:.2f} s of {scene.cycle_s:g} s")
        poses.append(model.read())
        forces.append(_vertical(model.load(), case))
        want = scene.at(t)
        got = dict(zip(("rx", "ry", "rz", "x", "y", "z"), poses[-1]))
        follow = max([follow] + [abs(got[n] - want[n]) * (1 if n == "x" else case.length_m) for n in want])
        reading += time.process_time() - pause
    used = time.process_time() - begin - reading
    steps = round(scene.cycle_s / step_s) if step_s else simulator.get_integrator().get_num_steps_taken()
    return {"version": version(), "time_s": used, "steps": int(steps), "poses": poses, "forces": forces, "follow_m": follow}


def _opensim_load(model, program, scene, constant_at=None):
    force = program.PrescribedForce("load", model.body)
    force.setPointIsInGlobalFrame(False)
    force.setForceIsInGlobalFrame(True)
    times = np.linspace(-0.01, scene.cycle_s + 0.01, int(round(1000 * scene.cycle_s)) + 21) if constant_at is None else [0.0]
    functions = []
    for axis in range(3):
        if constant_at is not None:
            functions.append(program.Constant(float(scene.force(constant_at)[axis])))
            continue
        f = program.SimmSpline()
        for t in times:
            f.addPoint(float(t), float(scene.force(t)[axis]))
        functions.append(f)
    force.setForceFunctions(*functions)
    force.setPointFunctions(*(program.Constant(float(p)) for p in scene.point))
    model.model.addForce(force)


def opensim_settle(file, data, folder, edge_m, t, start, accuracy=1e-4, method="RungeKuttaMerson", still=1e-6, longest_s=2.0):
    """Runge-Kutta-Merson with damped coordinates until the speed is below `still`. Prescribed coordinates are held."""
    import opensim as program

    from .opensim_knee import OpenSimKnee

    case = KneeCase(file)
    scene = Scene(case, data)
    held = scene.at(t)
    model = OpenSimKnee(case, edge_m, folder, link=scene.link, held=held, damping=_damping(scene.link.mass))
    _opensim_load(model, program, scene, constant_at=t)
    model.start()
    model.place(_start(start, case, scene, t))
    manager = program.Manager(model.model)
    manager.setIntegratorMethod(getattr(program.Manager, f"IntegratorMethod_{method}"))
    manager.setIntegratorAccuracy(accuracy)
    manager.setWriteToStorage(False)
    begin = time.process_time()
    manager.initialize(model.state)
    now = 0.0
    while True:
        now += 0.01
        model.state = manager.integrate(now)
        reach(f"at {now:.2f} simulated s, {model.speed():.1g} m/s")
        if now > 0.02 and model.speed() < still:
            break
        if now > longest_s:
            raise RuntimeError(f"not at rest after {longest_s:g} s of simulated time: speed {model.speed():.2g} m/s")
    used = time.process_time() - begin
    model.evaluate()
    pose, load = model.read(), model.load()
    return {"version": program.GetVersion(), "time_s": used, "pose": pose, "load": load, "residual_N": _residual(pose, load, scene, t), "simulated_s": now}


def opensim_gait(file, data, folder, edge_m, start, rates, accuracy, method="RungeKuttaMerson", damping_z=0.0, outputs=100):
    import opensim as program

    from .opensim_knee import OpenSimKnee

    case = KneeCase(file)
    scene = Scene(case, data)
    model = OpenSimKnee(case, edge_m, folder, link=scene.link, prescribed=scene, damping={"z": damping_z} if damping_z else None)
    _opensim_load(model, program, scene)
    model.start()
    model.place(_start(start, case, scene, 0.0))
    fixed = scene.at(0.0, 1)
    model.set_rates([fixed[n] if n in fixed else rates[n] for n in ("rx", "ry", "rz", "x", "y", "z")])
    manager = program.Manager(model.model)
    manager.setIntegratorMethod(getattr(program.Manager, f"IntegratorMethod_{method}"))
    manager.setIntegratorAccuracy(accuracy)
    manager.setWriteToStorage(False)
    begin, reading = time.process_time(), 0.0
    manager.initialize(model.state)
    poses, forces, follow = [], [], 0.0
    for k in range(outputs + 1):
        t = scene.cycle_s * k / outputs
        if k:
            model.state = manager.integrate(t)
        pause = time.process_time()
        reach(f"at {t:.2f} s of {scene.cycle_s:g} s")
        model.evaluate()
        poses.append(model.read())
        forces.append(model.load()["vertical"])
        want, got = scene.at(t), dict(zip(("rx", "ry", "rz", "x", "y", "z"), poses[-1]))
        follow = max([follow] + [abs(got[n] - want[n]) * (1 if n == "x" else case.length_m) for n in want])
        reading += time.process_time() - pause
    return {"version": program.GetVersion(), "time_s": time.process_time() - begin - reading, "poses": poses, "forces": forces, "follow_m": follow}
