"""Lengths, rates and forces of ligaments and muscles: Genu's, in the poses of its own runs, against OpenSim's in the same poses."""
import pathlib
import re

import numpy as np
import opensim
import yaml

from .opensim_model import OpenSimModel
from .rotation import Pose
from .scene import PathPoint


class Difference:
    """Of one element over all poses: largest differences and where they come from."""

    def __init__(self, element, frames):
        self.element = element
        self.length, self.rate, self.force, self.law, self.own = (np.zeros(frames) for _ in range(5))
        self.has_rate = False

    def largest_force(self):
        return float(np.max(np.abs(self.own)))


def _read_force(force, state):
    muscle = opensim.Muscle.safeDownCast(force)
    if muscle is None:
        return force.getTotalForce(state)
    return muscle.getTendonForce(state)


def path_rate(run, element, i):
    """dL/dt of a muscle with a rigid tendon follows from its fibre [m/s]."""
    name = element.name
    return run.elements[f"{name}.fibre_velocity_m_per_s"][i] / np.cos(run.elements[f"{name}.pennation_rad"][i])


class StraightLine:
    """Every element of a scene as a straight line of a length and rate that are given: its law without its path."""

    def __init__(self, scene, **options):
        def straighten(element):
            copy = type(element).__new__(type(element))
            copy.__dict__ = dict(element.__dict__)
            copy.points = [PathPoint({"body": "ground", "at": "0 mm, 0 mm, 0 mm"}), PathPoint({"body": "end", "at": "0 mm, 0 mm, 0 mm"})]
            copy.wraps = [None]
            return copy

        line = _Line()
        line.gravity, line.wraps, line.elements, line.urdf = [0, 0, 0], {}, [straighten(e) for e in scene.elements], _LineUrdf()
        self.built = OpenSimModel(line, **options)
        self.built.start()
        self.slider = self.built.coordinates["line_x"]

    def force(self, name, length, rate, activation=None):
        built = self.built
        self.slider.setValue(built.state, float(length), False)
        self.slider.setSpeedValue(built.state, float(rate))
        force = built.forces[name]
        if activation is not None:
            force.setActivation(built.state, float(activation))
            built.model.realizeDynamics(built.state)
        else:
            built.model.realizeVelocity(built.state)
        return _read_force(force, built.state)


class _Line:
    """What OpenSimModel takes of a scene."""


class _LineUrdf:
    """Ground and a body that floats."""

    def __init__(self):
        class Link:
            name, mass, centre, inertia = "end", 1.0, [0, 0, 0], np.eye(3)

        class Joint:
            name, type, parent, child, X_PF = "line", "floating", "ground", "end", Pose()

            @staticmethod
            def coordinates():
                return [f"line.{n}" for n in ("rx", "ry", "rz", "x", "y", "z")]

        self.root, self.joints, self.links = "ground", [Joint()], {"end": Link()}

    @staticmethod
    def moving_link(link):
        return link, Pose()


def compare(scene, run, muscle="de-groote", kinds=("ligaments", "muscles"), probes=None):
    """Differences of every element, OpenSim minus Genu, in every row of a run. probes: a run of the same scene with a column of the rate of
    every ligament, see add_probes()."""
    built = OpenSimModel(scene, muscle=muscle, kinds=kinds)
    built.start()
    line = StraightLine(scene, muscle=muscle, kinds=kinds)
    elements = [e for e in scene.elements if e.kind in kinds]
    differences = {e.name: Difference(e, len(run.motion)) for e in elements}
    for source, only_rates in ((run, False), (probes, True)):
        if source is None:
            continue
        values = {c.replace(".", "_"): source.coordinate(c) for c in built.coordinate_names}
        rates = {c.replace(".", "_"): source.rate(c) for c in built.coordinate_names}
        for i in range(len(source.motion)):
            built.place({k: v[i] for k, v in values.items()}, {k: v[i] for k, v in rates.items()})
            for e in elements:
                if e.kind == "muscles":
                    built.forces[e.name].setActivation(built.state, float(source.elements[f"{e.name}.activation"][i]))
            built.model.realizeDynamics(built.state)
            for e in elements:
                d, force = differences[e.name], built.forces[e.name]
                if only_rates:
                    if e.kind == "ligaments":
                        d.rate[i] = force.getLengtheningSpeed(built.state) - source.elements[f"probe_{e.name}.fibre_velocity_m_per_s"][i]
                        d.has_rate = True
                    continue
                own_length, own_force = source.elements[f"{e.name}.length_m"][i], source.elements[f"{e.name}.force_N"][i]
                rate, activation = 0.0, None
                if e.kind == "muscles":
                    rate, activation = path_rate(source, e, i), source.elements[f"{e.name}.activation"][i]
                    d.rate[i] = force.getLengtheningSpeed(built.state) - rate
                    d.has_rate = True
                d.length[i] = force.getLength(built.state) - own_length
                d.force[i] = _read_force(force, built.state) - own_force
                d.law[i] = line.force(e.name, own_length, rate, activation) - own_force
                d.own[i] = own_force
    return list(differences.values())


def own_rate_errors(scene, run, step_s=1e-5):
    """How far OpenSim's rate of every wrapped path is from the derivative of its own length, largest over a run: name -> [m/s]."""
    built = OpenSimModel(scene)
    built.start()
    errors = {e.name: 0.0 for e in scene.elements if e.is_wrapped() and e.name in built.forces}
    for i in range(len(run.motion)):
        q = {c.replace(".", "_"): run.coordinate(c)[i] for c in built.coordinate_names}
        u = {c.replace(".", "_"): run.rate(c)[i] for c in built.coordinate_names}

        def read(shift_s, what):
            built.place({c: q[c] + shift_s * u[c] for c in q}, u)
            built.model.realizeVelocity(built.state)
            return {n: getattr(built.forces[n], what)(built.state) for n in errors}

        rate, after, before = read(0, "getLengtheningSpeed"), read(step_s, "getLength"), read(-step_s, "getLength")
        for n in errors:
            errors[n] = max(errors[n], abs((after[n] - before[n]) / (2 * step_s) - rate[n]))
    return errors


def add_probes(scene, folder):
    """Writes the scene with, beside every ligament, a muscle of 1 nN on the same path whose fibre is the whole path: its fibre velocity is
    the path's rate, which elements.sto does not hold for ligaments. Returns the file."""
    given = dict(scene.yaml)
    muscles = dict(given.get("muscles", {}))
    for e in scene.of("ligaments"):
        muscles[f"probe_{e.name}"] = {
            "max_force": "1e-9 N", "fibre_length": e.given["slack"]["length"], "tendon_length": "1e-6 mm", "excitation": 0, "path": e.given["path"],
        }
    given["muscles"] = muscles
    return write_scene(given, scene, pathlib.Path(folder) / f"{scene.file.stem}_probes.yaml")


def write_scene(given, scene, file):
    """Writes YAML with the paths of `scene` made absolute."""
    base = scene.file.parent

    def absolute(value):
        if isinstance(value, dict):
            return {k: str((base / v).resolve()) if k in ("urdf", "nurbs", "table") and isinstance(v, str) else absolute(v) for k, v in value.items()}
        return [absolute(v) for v in value] if isinstance(value, list) else value

    file = pathlib.Path(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(yaml.safe_dump(absolute(given), sort_keys=False, width=1000))
    return file


def bundle(name):
    return re.sub(r"\d+$", "", name)


def summarise(differences):
    """Rows by bundle and kind of path: name, fibres, path, largest force, and the largest differences."""
    groups = {}
    for d in differences:
        e = d.element
        if e.is_wrapped():
            path = " ".join(sorted({w for w in e.wraps if w}))
        else:
            path = "via" if len(e.points) > 2 else "straight"
        groups.setdefault((bundle(e.name) if e.kind == "ligaments" else e.name, path), []).append(d)
    return [(name, path, members) for (name, path), members in groups.items()]


def largest(members, what):
    return max(float(np.max(np.abs(getattr(d, what)))) for d in members)


def largest_share(members, what):
    """Percent of each element's own largest force; 0 where it never pulls."""
    return max(100 * float(np.max(np.abs(getattr(d, what)))) / d.largest_force() if d.largest_force() > 0 else 0.0 for d in members)


def compare_at_rest(scene, run):
    """Muscles with compliant tendons, settled in one pose: rows (name, Genu's force, OpenSim's, Genu's fibre length, OpenSim's)."""
    built = OpenSimModel(scene, kinds=("muscles",), tendon="compliant")
    built.start()
    values = {c.replace(".", "_"): run.coordinate(c)[-1] for c in built.coordinate_names}
    built.place(values, {k: 0.0 for k in values})
    for name, force in built.forces.items():
        force.setActivation(built.state, float(run.elements[f"{name}.activation"][-1]))
    built.model.equilibrateMuscles(built.state)
    built.model.realizeDynamics(built.state)
    return [
        (n, run.elements[f"{n}.force_N"][-1], f.getTendonForce(built.state), run.elements[f"{n}.fibre_length_m"][-1], f.getFiberLength(built.state))
        for n, f in built.forces.items()
    ]


def curve_differences():
    """OpenSim's two muscles: rows (curve, range, largest difference, where)."""
    a, b = opensim.DeGrooteFregly2016Muscle(), opensim.Millard2012EquilibriumMuscle()
    b.finalizeFromProperties()
    a.finalizeFromProperties()
    curves = [
        ("active, f_l", np.linspace(0.5, 1.5, 201), a.calcActiveForceLengthMultiplier, b.get_ActiveForceLengthCurve().calcValue),
        ("passive, f_p", np.linspace(0.5, 1.5, 201), a.calcPassiveForceMultiplier, b.get_FiberForceLengthCurve().calcValue),
        ("velocity, f_v", np.linspace(-1, 1, 201), a.calcForceVelocityMultiplier, b.get_ForceVelocityCurve().calcValue),
        ("tendon, f_t", np.linspace(1, 1.05, 201), a.calcTendonForceMultiplier, b.get_TendonForceLengthCurve().calcValue),
    ]
    rows = []
    for name, x, f, g in curves:
        d = np.array([f(float(v)) - g(float(v)) for v in x])
        k = int(np.argmax(np.abs(d)))
        rows.append((name, x[0], x[-1], d[k], x[k]))
    return rows


def ligament_damping():
    """OpenSim's damping at c = 0.003 s, k = 1000 N, de/dt = 0.1 /s: rows (strain, force)."""
    model = opensim.Model()
    body = opensim.Body("end", 1.0, opensim.Vec3(0), opensim.Inertia(1, 1, 1))
    joint = opensim.SliderJoint("slide", model.getGround(), body)
    model.addBody(body)
    model.addJoint(joint)
    ligament = opensim.Blankevoort1991Ligament("ligament", model.getGround(), opensim.Vec3(0), body, opensim.Vec3(0), 1000.0, 1.0)
    model.addForce(ligament)
    state = model.initSystem()
    rows = []
    for strain in (0.001, 0.005, 0.01, 0.05):
        joint.getCoordinate().setValue(state, 1 + strain)
        joint.getCoordinate().setSpeedValue(state, 0.1)
        model.realizeVelocity(state)
        rows.append((strain, ligament.getDampingForce(state)))
    return rows


def activation_rates():
    """Of two 'de-groote' muscles with 15, 60 ms and 10, 40 ms in one model, activation 0.2 and excitation 0.7: rates [1/s]."""
    model = opensim.Model()
    body = opensim.Body("end", 1.0, opensim.Vec3(0), opensim.Inertia(1, 1, 1))
    model.addBody(body)
    model.addJoint(opensim.SliderJoint("slide", model.getGround(), body))
    muscles = []
    for name, rise, fall in (("first", 0.015, 0.060), ("second", 0.010, 0.040)):
        muscle = opensim.DeGrooteFregly2016Muscle()
        muscle.setName(name)
        muscle.set_ignore_tendon_compliance(True)
        muscle.set_activation_time_constant(rise)
        muscle.set_deactivation_time_constant(fall)
        muscle.addNewPathPoint("a", model.getGround(), opensim.Vec3(0))
        muscle.addNewPathPoint("b", body, opensim.Vec3(0.3, 0, 0))
        model.addForce(muscle)
        muscles.append(muscle)
    state = model.initSystem()
    for muscle in muscles:
        muscle.setActivation(state, 0.2)
    model.realizeVelocity(state)
    model.setControls(state, opensim.Vector(2, 0.7))
    model.realizeAcceleration(state)
    return [m.getStateVariableDerivativeValue(state, "activation") for m in muscles]
