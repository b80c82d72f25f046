"""What is measured: the settings of each program in each part, with what each is expected to cost."""
import re

PARTS = ("contact", "settle", "gait")
PEERS = ("Drake", "OpenSim")

EDGES_MM = (4, 2.8, 2, 1.4, 1, 0.7, 0.5, 0.35, 0.28, 0.2)
GRIDS = (4, 6, 8, 12, 16, 20, 30, 45, 60, 90, 120)
REFERENCE_GRID = 240


class Job:
    """A program with one setting. role: "row" of a table, or what rows need. task: module:function of this package, None for runs of the program
    genu; options: its arguments; cost_s: expected processor time, building the model included; limit_s: a smaller one than the others'."""

    def __init__(self, part, program, setting, task, cost_s, role="row", edge_mm=None, limit_s=None, **options):
        self.part, self.program, self.setting, self.task, self.role = part, program, setting, task, role
        self.cost_s, self.edge_mm, self.limit_s, self.options = cost_s, edge_mm, limit_s, options
        if edge_mm:
            self.options["edge_m"] = 1e-3 * edge_mm

    @property
    def name(self):
        """Of its files."""
        role = "" if self.role == "row" else self.role
        return re.sub(r"[^A-Za-z0-9.-]+", "_", " ".join(x for x in (self.part, role, self.program, self.setting) if x))

    def peer(self):
        """Drake or OpenSim, or Genu."""
        return self.program.split()[0]


def _faces(edge_mm):
    """Number of faces goes with this, and time with them."""
    return 1 / edge_mm**2


def _evaluations(part, edges, share, half_space):
    """share: of the knee's faces."""
    jobs = [Job(part, "Genu", "all grids", "measure:genu", 25, grids=list(GRIDS) + [REFERENCE_GRID])]
    jobs += [Job(part, "Drake", f"{e:g} mm", "measure:drake", 4 + 2.2 * share * _faces(e), edge_mm=e) for e in edges]
    if half_space:
        jobs += [Job(part, "Drake half space", f"{e:g} mm", "measure:drake", 4, edge_mm=e, half_space=True) for e in edges]
    return jobs + [Job(part, "OpenSim", f"{e:g} mm", "measure:opensim", 4 + 1.5 * share * _faces(e), edge_mm=e) for e in edges]


def sphere():
    return _evaluations("sphere", EDGES_MM, 0.1, half_space=True)


def contact():
    return _evaluations("contact", EDGES_MM[1:], 1, half_space=False)


def settle():
    jobs = [Job("settle", "Genu", f"{REFERENCE_GRID} x {REFERENCE_GRID}", None, 2, role="reference", grid=REFERENCE_GRID),
            Job("settle", "Genu", f"{REFERENCE_GRID} x {REFERENCE_GRID}", None, 2, role="local", grid=REFERENCE_GRID),
            Job("settle", "Genu", f"{REFERENCE_GRID} x {REFERENCE_GRID}", None, 2, role="uncorrected", grid=REFERENCE_GRID)]
    jobs += [Job("settle", "Genu", f"{g} x {g}", None, 1.5, grid=g, repeats=10) for g in (4, 6, 8, 12, 16, 30, 60)]
    for edge in EDGES_MM[1:]:
        # The step does not move the equilibrium; where both are cheap, the faster of the two is found.
        for step_ms in (1, 2) if edge > 0.4 else (2,):
            jobs.append(Job("settle", "Drake", f"{edge:g} mm, {step_ms} ms", "motion:drake_settle", 3 + 3 * _faces(edge), edge_mm=edge, step_s=1e-3 * step_ms))
    for edge, accuracy in ((2.8, 1e-4), (2, 1e-3), (2, 1e-4), (1.4, 1e-4), (1, 1e-4), (0.7, 1e-4), (0.5, 1e-4)):
        jobs.append(Job("settle", "OpenSim", f"{edge:g} mm, {accuracy:g}", "motion:opensim_settle", 3 + 75 * _faces(edge), edge_mm=edge, accuracy=accuracy))
    return sorted(jobs, key=lambda j: j.cost_s if j.program != "Genu" else 0)


def gait():
    jobs, groups = [], []  # a group: what starts from one equilibrium
    for integrator, key, value, grids in (("cpodes", "accuracy", 1e-4, (8, 12, 16, 30)), ("cpodes", "accuracy", 1e-5, (30, 60)), ("cpodes", "accuracy", 1e-3, (12,)),
                                          *(("generalized-alpha", "step", f"{s:g} ms", (8, 15, 30, 60)) for s in (0.5, 1, 2, 5))):
        jobs += [Job("gait", "Genu", f"{integrator} {value}, {g} x {g}", None, 1.5, grid=g, repeats=3, analysis={"integrator": integrator, key: value})
                 for g in grids]
    for edge, steps_ms in ((2.8, (5,)), (2, (10, 5, 2)), (1.4, (5, 2)), (1, (5, 2, 1, 0.5)), (0.7, (2, 1, 0.5)), (0.5, (1, 0.5)), (0.35, (1,)), (0.2, (1,))):
        # Each mesh starts from the program's own equilibrium on it: the start makes no vibration.
        group = [Job("gait", "Drake", f"{edge:g} mm", "motion:drake_settle", 3 + 3 * _faces(edge), role="start", edge_mm=edge, step_s=1e-3)]
        group += [Job("gait", "Drake", f"{edge:g} mm, {s:g} ms", "motion:drake_gait", 2 + (2 + 16 / s) * _faces(edge), edge_mm=edge, step_s=1e-3 * s)
                  for s in steps_ms]
        if edge == 2:
            group.append(Job("gait", "Drake", "2 mm, cenic 0.001", "motion:drake_gait", 20, edge_mm=2, scheme="cenic", accuracy=1e-3, longest_step_s=0.001))
        if edge == 2.8:
            groups.append([Job("gait", "Drake", "2.8 mm, implicit_euler 0.001", "motion:drake_gait", 60, edge_mm=2.8, limit_s=60, scheme="implicit_euler",
                               accuracy=1e-3, longest_step_s=0.01)])
        groups.append(group)
    for edge, accuracies in ((4, (1e-3,)), (2.8, (1e-3,)), (2, (1e-3, 1e-4)), (1.4, (1e-3,)), (1, (1e-3,)), (0.7, (1e-3,))):
        group = [Job("gait", "OpenSim", f"{edge:g} mm", "motion:opensim_settle", 3 + 75 * _faces(edge), role="start", edge_mm=edge, accuracy=1e-4)]
        group += [Job("gait", "OpenSim", f"{edge:g} mm, RKM {a:g}", "motion:opensim_gait", 25 + 200 * _faces(edge), edge_mm=edge, accuracy=a) for a in accuracies]
        if edge == 4:
            groups.append([Job("gait", "OpenSim", "4 mm, CPodes 0.0001", "motion:opensim_gait", 60, edge_mm=4, limit_s=60, accuracy=1e-4, method="CPodes")])
        groups.append(group)
    # What takes long comes last: a run that is broken off has most of the curves.
    return jobs + [j for g in sorted(groups, key=lambda g: sum(j.cost_s for j in g)) for j in g]


def reference():
    """The gait cycle that poses and errors are taken from."""
    return Job("", "Genu", "accuracy 1e-6, 120 x 120", None, 10, role="reference gait", grid=120, analysis={"accuracy": 1e-6})


def jobs(part):
    return {"sphere": sphere, "contact": contact, "settle": settle, "gait": gait}[part]()
