"""One second of a leg whose knee is a hinge, driven by its muscles: integrated in Genu and in OpenSim."""
import csv
import math
import time

import numpy as np
import opensim
import yaml

from . import compare_elements
from .genu import Run
from .opensim_model import OpenSimModel
from .rotation import Pose, from_body_xyz, to_body_xyz
from .scene import Scene, quantity

_JOINT = "knee.angle"
_STEP_S = 0.01


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
    rpy = " ".join(repr(float(v)) for v in _to_rpy(X.R))
    tags = " ".join(f'{k}="{v!r}"' for k, v in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), link.inertia))
    return f'<link name="{name}"><inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{link.mass!r}"/><inertia {tags}/></inertial></link>\n'


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

    # The scene's table of excitation, stretched to a second.
    table = next(e.given["excitation"]["table"] for e in source.of("muscles") if isinstance(e.given["excitation"], dict))
    with open(source.file.parent / table) as stream:
        rows = [r for r in csv.reader(line for line in stream if not line.startswith("#"))]
    last = float(rows[-1][0])
    with open(folder / "excitation.csv", "w") as stream:
        csv.writer(stream).writerows([rows[0]] + [[float(r[0]) / last] + r[1:] for r in rows[1:]])
    return start


def _about(axis, angle):
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def write_scene(source, folder, tendon, accuracy, start, fibre_damping=None):
    damping = source.yaml["model"]["joints"]["tibiofemoral"]["rz"]["free"]["damping"]
    muscles = {}
    for e in source.of("muscles"):
        given = dict(e.given, tendon=tendon)
        if fibre_damping is not None:
            given["fibre_damping"] = fibre_damping
        if isinstance(given["excitation"], dict):
            given["excitation"] = dict(given["excitation"], table="excitation.csv")
        muscles[e.name] = given
    used = {w for e in source.of("muscles") for w in e.wraps if w}
    scene = {
        "genu": 1, "name": f"a second of a hinge, {tendon} tendons",
        "model": {"urdf": "hinge.urdf", "gravity": source.yaml["model"]["gravity"],
                  "joints": {"knee": {"angle": {"free": {"start": f"{start!r} rad", "damping": damping}}}}},
        "wraps": {k: v for k, v in source.yaml["wraps"].items() if k in used}, "muscles": muscles,
        "analysis": {"gait": {"duration": "1 s", "output_interval": f"{_STEP_S} s", "accuracy": accuracy, "settle_first": False}},
        "output": {"plots": False, "maps": False},
    }
    file = folder / f"hinge_{tendon}_{accuracy:g}{'' if fibre_damping is None else f'_beta{fibre_damping:g}'}.yaml"
    file.write_text(yaml.safe_dump(scene, sort_keys=False, width=1000))
    return file


class OpenSimSecond:
    """Integrated with Manager. excitations: muscle -> (times, values), the curve that Genu used."""

    def __init__(self, scene, muscle, tendon, excitations, damping, rotational_damping):
        self.built = OpenSimModel(scene, muscle=muscle, tendon=tendon, damping=damping)
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

    def run(self, start_angle, accuracy, method=None, step_s=None):
        """Angles at the outputs, or only the last; processor time of the integration; steps taken."""
        state = self.built.start()
        self.built.place({"knee_angle": start_angle}, {"knee_angle": 0.0})
        for name, force in self.built.forces.items():
            force.setActivation(state, float(self.excitations[name][1][0]))
        self.built.model.equilibrateMuscles(state)
        manager = opensim.Manager(self.built.model)
        if method is not None:
            manager.setIntegratorMethod(method)
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


def genu_second(program, file, folder):
    run = Run(program, "gait", file, folder / f"results_{file.stem}")
    return run, run.motion[_JOINT]
