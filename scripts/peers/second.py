"""One second of a leg whose knee is a hinge, driven by its muscles: integrated in Genu and in OpenSim."""
import csv
import math
import multiprocessing
import queue as queue_module
import re
import time

import numpy as np
import opensim
import yaml

from .genu import Run
from .opensim_model import OpenSimModel
from .rotation import Pose, from_body_xyz
from .scene import Scene, quantity

_JOINT = "knee.angle"


def _start_pose(scene, joint):
    """Of a floating joint of a scene with `start` of every coordinate."""
    given = scene.yaml["model"]["joints"][joint]
    values = [quantity(given[c]["free"]["start"]) for c in ("rx", "ry", "rz", "x", "y", "z")]
    return Pose(from_body_xyz(values[:3]), values[3:])


def _to_rpy(R):
    return math.atan2(R[2, 1], R[2, 2]), -math.asin(R[2, 0]), math.atan2(R[1, 0], R[0, 0])


def _fixed_joint(name, parent, child, X):
    xyz, rpy = (" ".join(repr(float(v)) for v in values) for values in (X.p, _to_rpy(X.R)))
    return f'<joint name="{name}" type="fixed"><origin xyz="{xyz}" rpy="{rpy}"/><parent link="{parent}"/><child link="{child}"/></joint>\n'


def _link(name, link=None, X=None):
    if link is None or link.mass == 0:
        return f'<link name="{name}"/>\n'
    X = X or Pose()
    xyz = " ".join(repr(float(v)) for v in X.apply(link.centre))
    I = X.R @ link.inertia @ X.R.T
    tags = " ".join(f'{k}="{float(v)!r}"' for k, v in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), [*np.diag(I), I[0, 1], I[0, 2], I[1, 2]]))
    return f'<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{link.mass!r}"/><inertia {tags}/></inertial></link>\n'


def write_hinge(source, folder):
    """The leg of `source` with hip, ankle and patella held as they start, and a hinge through the femur's origin for a knee."""
    urdf = source.urdf
    hip, ankle = (urdf.joint_of[c] for c in ("thigh", "foot"))
    hip_angle = quantity(source.yaml["model"]["joints"]["hip"]["angle"]["prescribed"])
    turn = Pose(_about(hip.axis, hip_angle))
    start = quantity(source.yaml["model"]["joints"]["tibiofemoral"]["rz"]["free"]["start"])
    back = Pose(from_body_xyz([0, 0, -start]))
    tibia, patella = back * _start_pose(source, "tibiofemoral"), back * _start_pose(source, "patellofemoral")
    text = '<robot name="hinge">\n' + "".join(
        [
            _link("pelvis"), _link("thigh"), _link("femur"), _link("shank", urdf.links["tibia"], tibia), _link("tibia"),
            _link("patella", urdf.links["patella"]), _link("foot", urdf.links["foot"]),
            _fixed_joint("hip", "pelvis", "thigh", hip.X_PF * turn), _fixed_joint("distal_femur", "thigh", "femur", urdf.joint_of["femur"].X_PF),
            '<joint name="knee" type="continuous"><parent link="femur"/><child link="shank"/><axis xyz="0 0 1"/></joint>\n',
            _fixed_joint("tibia_in_shank", "shank", "tibia", tibia), _fixed_joint("patella_in_shank", "shank", "patella", patella),
            _fixed_joint("ankle", "tibia", "foot", ankle.X_PF),
        ]
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "hinge.urdf").write_text(text + "</robot>\n")

    # The scene's table of excitation, stretched to a second, with a row every 25 ms: the spline through a few rows would overshoot to 0,
    # where OpenSim's compliant 'de-groote' divides by the activation.
    table = next(e.given["excitation"]["table"] for e in source.of("muscles") if isinstance(e.given["excitation"], dict))
    with open(source.file.parent / table) as stream:
        header, *rows = [r for r in csv.reader(line for line in stream if not line.startswith("#"))]
    rows = np.array(rows, float)
    times = np.linspace(0, 1, 41)
    columns = [np.interp(times, rows[:, 0] / rows[-1, 0], rows[:, k]) for k in range(1, rows.shape[1])]
    with open(folder / "excitation.csv", "w") as stream:
        csv.writer(stream).writerows([header] + [[repr(float(v)) for v in row] for row in zip(times, *columns)])
    return start


def _about(axis, angle):
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


class Case:
    """What of the leg is integrated. fibre_damping: None: as in the scene. wraps: False: straight lines instead. constant_excitation: of all
    muscles, instead of the table. peers: kinds of muscle of OpenSim that are run beside it, and its integrator where it is not the default,
    Runge-Kutta-Merson."""

    def __init__(self, name, tendon, fibre_damping=None, wraps=True, constant_excitation=None, peers=("de-groote",)):
        self.name, self.tendon, self.fibre_damping, self.wraps = name, tendon, fibre_damping, wraps
        self.constant_excitation, self.peers = constant_excitation, peers


CASES = [
    Case("rigid, no fibre damping, straight paths, constant excitation", "rigid", 0, False, 0.05),
    Case("rigid, no fibre damping, straight paths", "rigid", 0, False),
    Case("rigid, no fibre damping", "rigid", 0),
    Case("rigid", "rigid", peers=("de-groote", "de-groote, CPodes", "millard")),
    Case("compliant, fibre damping 0.001", "compliant", 1e-3),
    Case("compliant", "compliant", peers=("de-groote", "millard", "millard, CPodes")),
]


def write_scene(source, folder, case, accuracy, start, step_s):
    damping = source.yaml["model"]["joints"]["tibiofemoral"]["rz"]["free"]["damping"]
    muscles = {}
    for e in source.of("muscles"):
        given = dict(e.given, tendon=case.tendon)
        if case.fibre_damping is not None:
            given["fibre_damping"] = case.fibre_damping
        if not case.wraps:
            given["path"] = [item for item in given["path"] if "wrap" not in item]
        if case.constant_excitation is not None:
            given["excitation"] = case.constant_excitation
        elif isinstance(given["excitation"], dict):
            given["excitation"] = dict(given["excitation"], table="excitation.csv")
        muscles[e.name] = given
    used = {w for e in source.of("muscles") if case.wraps for w in e.wraps if w}
    scene = {
        "genu": 1, "name": f"a second of a hinge, {case.name}",
        "model": {"urdf": "hinge.urdf", "gravity": source.yaml["model"]["gravity"],
                  "joints": {"knee": {"angle": {"free": {"start": f"{start!r} rad", "damping": damping}}}}},
        "wraps": {k: v for k, v in source.yaml["wraps"].items() if k in used}, "muscles": muscles,
        "analysis": {"gait": {"duration": "1 s", "output_interval": f"{step_s} s", "accuracy": accuracy, "settle_first": False}},
        "output": {"plots": False, "maps": False},
    }
    file = folder / f"{re.sub('[^a-z0-9]+', '_', case.name)}_{accuracy:g}.yaml"
    file.write_text(yaml.safe_dump(scene, sort_keys=False, width=1000))
    return file


class OpenSimSecond:
    """Integrated with Manager. excitations: muscle -> (times, values), the curve that Genu used."""

    def __init__(self, scene, muscle, tendon, excitations, rotational_damping):
        self.built = OpenSimModel(scene, muscle=muscle, tendon=tendon)
        model = self.built.model
        damper = opensim.SpringGeneralizedForce("knee_angle")
        damper.setStiffness(0.0)
        damper.setRestLength(0.0)
        damper.setViscosity(rotational_damping)
        model.addForce(damper)
        controller = opensim.PrescribedController()
        controller.setName("excitation")
        for name, force in self.built.forces.items():
            controller.addActuator(force)
        self.functions = []
        for name, (times, values) in excitations.items():
            if np.ptp(values) == 0:
                function = opensim.Constant(float(values[0]))
            else:
                function = opensim.SimmSpline()
                for t, v in zip(times, values):
                    function.addPoint(float(t), float(v))
            controller.prescribeControlForActuator(name, function)
            self.functions.append(function)
        model.addController(controller)
        self.excitations = excitations

    def run(self, start_angle, accuracy, cpodes=False, step_s=None):
        """Angles at the outputs, or only the last; processor time of the integration."""
        state = self.built.start()
        self.built.place({"knee_angle": start_angle}, {"knee_angle": 0.0})
        for name, force in self.built.forces.items():
            force.setActivation(state, float(self.excitations[name][1][0]))
        self.built.model.equilibrateMuscles(state)
        manager = opensim.Manager(self.built.model)
        if cpodes:
            manager.setIntegratorMethod(opensim.Manager.IntegratorMethod_CPodes)
        manager.setIntegratorAccuracy(accuracy)
        manager.setWriteToStorage(False)
        before = time.process_time()
        manager.initialize(state)
        angles = []
        ends = np.arange(1, round(1 / step_s) + 1) * step_s if step_s else [1.0]
        for end in ends:
            state = manager.integrate(float(end))
            angles.append(self.built.coordinates["knee_angle"].getValue(state))
        cpu = time.process_time() - before
        return np.array(angles), cpu


class Row:
    """One integration. own_error_deg: of the last angle, against the same program's tight run; difference_deg: largest of the tight
    trajectories of both programs. failed: why, or None."""

    def __init__(self, case, program, accuracy):
        self.case, self.program, self.accuracy = case, program, accuracy
        self.cpu_s = self.last_deg = self.own_error_deg = self.difference_deg = None
        self.failed = None


_TIGHT_GENU, _TIGHT_OPENSIM = 1e-9, 1e-8
_OUTPUT_S, _LIMIT_S, _REPEATS = 0.01, 60, 3
ACCURACIES = (1e-4, 1e-6)


def _work(queue, arguments, start, accuracy, cpodes, step_s):
    try:
        queue.put(OpenSimSecond(*arguments).run(start, accuracy, cpodes, step_s))
    except Exception as error:  # OpenSim's, as a text
        queue.put(str(error))


def _run_limited(arguments, start, accuracy, cpodes=False, step_s=None):
    """In a process of its own, which is ended after _LIMIT_S: (angles, cpu_s) or a text. OpenSim keeps the activation times of the first
    'de-groote' muscle of a process."""
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=_work, args=(queue, arguments, start, accuracy, cpodes, step_s))
    process.start()
    try:
        result = queue.get(timeout=_LIMIT_S)
    except queue_module.Empty:
        result = f"not done after {_LIMIT_S} s"
    process.terminate()
    process.join()
    if isinstance(result, str) and "Unable to advance" in result:
        result = "stops at " + re.search(r"Unable to advance time past ([0-9.]+?)\.?\s", result).group(1) + " s"
    return result


def compare(program, source, folder):
    start = write_hinge(source, folder)
    damping = quantity(source.yaml["model"]["joints"]["tibiofemoral"]["rz"]["free"]["damping"])
    rows = []
    for case in CASES:
        def genu(accuracy, step_s=_OUTPUT_S):
            file = write_scene(source, folder, case, accuracy, start, step_s)
            return file, Run(program, "gait", file, folder / f"results_{file.stem}")

        file, tight = genu(_TIGHT_GENU, _OUTPUT_S / 5)
        angles = tight.coordinate(_JOINT)
        scene = Scene(file)
        excitations = {e.name: (tight.motion["time"], tight.elements[f"{e.name}.excitation"]) for e in scene.of("muscles")}
        for accuracy in ACCURACIES:
            row = Row(case, "Genu", accuracy)
            runs = [genu(accuracy)[1] for _ in range(_REPEATS)]
            row.cpu_s = min(r.statistics["cpu_time_s"] for r in runs)
            row.last_deg = math.degrees(runs[0].coordinate(_JOINT)[-1])
            row.own_error_deg = abs(row.last_deg - math.degrees(angles[-1]))
            rows.append(row)
        for peer in case.peers:
            muscle, *method = peer.split(", ")
            arguments = (scene, muscle, case.tendon, excitations, damping)
            reference = _run_limited(arguments, start, _TIGHT_OPENSIM, step_s=_OUTPUT_S)
            for accuracy in ACCURACIES:
                row = Row(case, f"OpenSim, {peer}", accuracy)
                results = [_run_limited(arguments, start, accuracy, bool(method)) for _ in range(_REPEATS)]
                if isinstance(results[0], str):
                    row.failed = results[0]
                else:
                    row.cpu_s = min(r[1] for r in results)
                    row.last_deg = math.degrees(results[0][0][-1])
                    if not isinstance(reference, str):
                        row.own_error_deg = abs(row.last_deg - math.degrees(reference[0][-1]))
                        row.difference_deg = math.degrees(np.max(np.abs(reference[0] - angles[5::5])))
                rows.append(row)
    return rows
