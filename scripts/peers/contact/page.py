"""The section of docs/verification.md."""
import os

from . import equal_error
from .limited import MEMORY_GB
from .tables import at_equal_error, number, ratio, settings, table

BEGIN, END = "<!-- peers: scripts/compare_peers --write -->", "<!-- end of peers -->"
TITLES = {"artificial_knee": "artificial knee (`models/artificial_knee/gait.yaml`)", "tka_dm": "measured implant (`models/tka_dm/gait.yaml`)"}
SHORT = {"artificial_knee": "artificial knee", "tka_dm": "measured implant"}
# (error of a row, its name, unit, levels of the tables)
ERRORS = {"sphere": ("own", "force", "%", (20, 10, 5, 2, 1, 0.5, 0.2, 0.1)),
          "contact": ("own", "force", "%", (20, 10, 5, 2, 1, 0.5, 0.2, 0.1)),
          "settle": ("own", "pose", "mm", (0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4)),
          "gait": ("pose", "pose", "mm", (1, 0.5, 0.1, 0.05, 0.02, 0.01, 0.007, 0.005, 0.003, 0.002))}
PARTS = {"contact": "one contact evaluation", "settle": "settle", "gait": "gait cycle, 1 s"}
DIFFERENCES = [
    ("pressure", "K d/h, d along the midsurface normal [BF2004 eq. 2]", "K d/h, d the distance to the layer's surface, interpolated linearly in tetrahedra",
     "K d/h, d the distance to the nearest point of the other mesh; the mean of springs on both meshes"),
    ("thickness h", "constant here; local in the shipped scenes", "constant: the field is the distance over one depth", "constant: one stiffness K/h"),
    ("surfaces", "NURBS, sphere and plane as they are", "triangles and tetrahedra through points of them; layer meshed over the compartments' rectangles, as deep "
     "as h, or as half, a quarter or an eighth of it (with so much less modulus) where a curved surface turns tetrahedra inside out", "triangles through the same points, closed by copies 8 mm inside"),
    ("border of the rectangle, under load in the implant", "elements end there", "the mesh goes on 0.15 mm lower, so that nothing touches it; pressure is up to 2.5 % low within 1.3 mm of it", "the mesh ends there"),
    ("elements", "grid on the layer, integrated over the part in contact", "polygons where the rigid mesh cuts the tetrahedra", "whole triangles, by their centre"),
    ("force acts", "on the layer's surface A, along the midsurface normal", "on the contact surface, which is the rigid surface, along its normal",
     "along the connection of a spring and the nearest point"),
    ("which surfaces meet", "each compartment's own two", "every layer and every moving surface", "each layer and the moving surface beside it"),
    ("damping, friction of the contact", "none", "none (dissipation 0, friction 0); discrete steps damp numerically", "none"),
    ("mass", "URDF", "URDF; bodies between joints massless, 1 mg each in continuous time", "URDF"),
    ("prescribed coordinates", "eliminated", "stiff controllers, implicit; error in the column \"Follows\"", "constraints"),
    ("load", "at a point of the body, cubic spline over time", "the same, held over a discrete step", "the same, spline through 1 ms samples"),
    ("equilibrium", "Newton on statics", "discrete steps, z damped by 300/s times the mass, y and rx so that the load moves them 0.5 mm a step at most; until below 1 um/s in three steps",
     "Runge-Kutta-Merson, all damped by 300/s times the mass, until below 1 um/s"),
    ("called from", "evaluation: Python, C interface; runs: its program", "Python", "Python"),
]


def _details(summary, lines):
    return [f"<details><summary>{summary}</summary>", "", *lines, "</details>", ""]


def summary(measured):
    """Ratios of processor time at equal error, from the largest to the smallest level that both programs' curves reach."""

    def cell(rows, part, program):
        error, _, unit, levels = ERRORS[part]
        found = equal_error.ratios(rows, program, error, levels)
        if found:
            (first, a), (last, b) = found[0], found[-1]
            return f"**{ratio(b)}** at {last:g} {unit}" + (f" ({ratio(a)} at {first:g} {unit})" if first != last else "")
        ends = [equal_error.front(rows, p, error) for p in ("Genu", program)]
        if not all(ends):
            return "–"
        return "no common error: " + ", ".join(f"{p} {number(c[-1][1])} {unit} in {number(c[-1][0])} s" for p, c in zip(("Genu", program), ends))

    rows = []
    for sphere in (m["sphere"]["rows"] for m in measured.values() if "sphere" in m):
        rows.append(["one contact evaluation, sphere on a flat layer"] + [cell(sphere, "sphere", p) for p in ("Drake", "OpenSim")])
        rows.append(["the same, layer as Drake's half space", cell(sphere, "sphere", "Drake half space"), "–"])
    rows += [[f"{PARTS[part]}, {SHORT[name]}"] + [cell(m[part]["rows"], part, p) for p in ("Drake", "OpenSim")]
             for part in PARTS for name, m in measured.items() if part in m]
    return table(["Processor time over Genu's at the same error", "Drake", "OpenSim"], rows)


def _machine(measured, processor):
    loads = [x for m in measured.values() for x in m["loads"]]
    dates = sorted({d for m in measured.values() for d in m["dates"]})
    text = f"one core of {processor} ({os.cpu_count()} cores), {dates[0]}" + (f" to {dates[-1]}" if len(dates) > 1 else "")
    if max(loads) > 1.3:  # the case itself is 1
        text += (f". Other programs ran on the machine too, load average {number(min(loads))} to {number(max(loads))}: processor times are longer than on an idle machine, "
                 "ratios are safer")
    return text


def _thickness(measured):
    """What the constant thickness and the smaller rectangles change."""
    said = []
    for name, m in measured.items():
        case = m["case"]
        text = f"{SHORT[name]}: h = {1e3 * case.h_m:.3g} mm"
        if "settle" in m:
            moved = m["settle"]["local_mm"]
            text += f", which moves Genu's equilibrium at the largest load by {number(1e3 * moved['y'])} um in y and {number(1e3 * moved['z'])} um in z"
        if case.shrunk_mm:
            text += f"; its rectangles are smaller than the scene's by up to {case.shrunk_mm:g} mm a side, because the patches do not cover them"
        said.append(text)
    return ". ".join(s[0].upper() + s[1:] for s in said) + "."


def write(measured, processor):
    versions = {k: v for m in measured.values() for k, v in m["versions"].items()}
    lines = ["", "## Beside Drake and OpenSim", "",
             "    scripts/compare_peers --part contact --part settle --part gait --write", "",
             "runs one contact evaluation, a settle and the gait cycle on the same surfaces, material and loads with Genu, with Drake's hydroelastic contact "
             "(Elandt et al. 2019, IROS; Masterjohn et al. 2022, RA-L 7:11577) and with OpenSim's elastic foundation, and reads off the curves of error over processor time what each "
             "takes at the same error:", ""]
    lines += summary(measured)
    lines += [f"Read: the finest error that both reach, in brackets the coarsest. Genu {versions.get('Genu', '–')}, Drake {versions.get('Drake', '–')}, OpenSim {versions.get('OpenSim', '–')}, "
              f"{_machine(measured, processor)}. Processor time without building the model, shortest of repeats (peers' settles and gaits: one run). A case of a peer is stopped where the table says so, at the "
              f"latest after ten minutes or at {MEMORY_GB} GB.", "",
              f"![Error over processor time of Genu, Drake and OpenSim: {', '.join(SHORT[n] for n in measured)}](images/peers.png)", "",
              "Lines join the settings that no other of the same program beats in both error and time; one that happens to be nearer than a finer grid or mesh counts as that. Between two of them the time at an error is that of the straight line in logarithms; beyond the "
              "nearest one nothing is extrapolated. \"≤\": the fastest setting is nearer than asked; \"≥\": so is Genu's fastest.", "",
              "The implant is that of subject DM of the Grand Challenge Competition to Predict In Vivo Knee Loads (Fregly et al. 2012, J Orthop Res 30:503; `models/tka_dm/README.md`). "
              "Neither its meshes nor the patches fitted to them are in the repository.", "",
              "The layer's thickness is constant in all programs, that of the insert's thinnest place: neither peer has a local one. " + _thickness(measured) +
              " Differences of model that remain:", ""]
    lines += table(["", "Genu", "Drake", "OpenSim"], DIFFERENCES)
    lines += ["OpenSim's package has neither the thickness nor the contact of Smith et al. 2018 (`Smith2018ArticularContactForce`). "
              "Times of Drake and OpenSim hold what Python adds, about 0.02 ms an evaluation.", ""]
    lines += _contact({n: m for n, m in measured.items() if "contact" in m or "sphere" in m})
    memory = ("memory_MB", "Memory [MB]")
    if any("settle" in m for m in measured.values()):
        lines += ["### Settle", "", "From 1 mm above the equilibrium at the largest load, y, z and rx free, the others held. Pose error: largest of y, z and 25 mm times rx. Own limit: extrapolated from the "
                  "program's two finest meshes; Genu's: 240 x 240 elements, against which the other errors are, which hold the differences of model. The largest is the force's direction: with `correction: none` "
                  "Genu's force, too, is along the moving surface's normal (row \"limit, correction: none\").", ""]
        lines += _motion("settle", measured, [("work", "Work"), ("residual_N", "Residual [N]"), memory], [])
    if any("gait" in m for m in measured.values()):
        lines += ["### Gait cycle", "", "One second; each program starts from its own equilibrium, with Genu's rates. Errors: largest over 100 output times, against Genu with accuracy 1e-6 on 120 x 120 elements; "
                  "they hold the differences of model, for Drake on the implant the direction of the force (see Settle). Force: vertical, of a compartment.", ""]
        for name, m in measured.items():
            if "gait" in m and m["case"].gait_damping():
                lines += [f"{SHORT[name].capitalize()}: z is damped in all programs by {m['case'].gait_damping()['damping_z']:.3g} N s/m, 300/s times the mass of the loaded body; the shipped scene is "
                          "not. Undamped, its soft motion in z amplifies every difference (Genu's own runs with accuracy 1e-5 on 30 x 30 and 1e-6 on 120 x 120 elements part by 2.2 mm), and errors say nothing of the contact.", ""]
        lines += _motion("gait", measured, [("steps", "Steps"), ("follow_mm", "Follows within [mm]"), memory], [("force", "Force error [N]")])
        lines += ["Much of a mesh's error cancels over a motion: some percent of the force are some micrometres of height. Drake's steps are few, implicit and stable; they are of first order "
                  "and damp the vibrations in z that Genu and OpenSim follow, and that OpenSim's facets excite.", ""]
    lines += ["### What the ratios say, and what not", "",
              "- Meshes err by their chords. An edge of 1 mm on radii of 30 to 60 mm lies 2 to 4 um off the surface, against a penetration of 30 to 130 um; the error falls with the square of "
              "the edge, the time rises with its inverse square. Genu takes the surfaces as they are, and its smooth rule errs by a higher order. Most of the ratio of an evaluation is this, and it grows "
              "as the error asked for falls. Vertices placed off the surface by half a chord's error would make the meshes better than the same ones here.",
              "- Drake and OpenSim take any closed meshes, friction and many bodies; Genu's engine is made for thin layers on smooth surfaces and one pair of bodies.",
              "- OpenSim's integrators are explicit here or build their Jacobian by differences of whole evaluations; its time over a motion is mostly the number of evaluations. Its settle is such a motion, "
              "Genu's is Newton's method.",
              "- Not compared: the peers' moments beyond the one evaluation, power-law and large-strain material, layers on both bodies, several threads.", ""]
    return "\n".join(lines)


def _motion(part, measured, extra, more_errors):
    lines = []
    own = [("own", "Pose, own limit [mm]")] if part == "settle" else []
    columns = [*own, ("pose", "Pose error [mm]"), ("y", "y [mm]"), ("z", "z [mm]"), ("rx", "rx [mm]"), *more_errors]
    for name, got in ((n, m) for n, m in measured.items() if part in m):
        rows = got[part]["rows"]
        for error, against in [("own", "the own limit")] * len(own) + [("pose", "Genu's converged one")]:
            lines += [f"Time at equal error of the pose against {against}, {TITLES[name]}:", ""] + at_equal_error(rows, error, ERRORS[part][3], "mm")
        lines += _details("all settings", settings(rows, columns, extra))
    return lines


def _contact(measured):
    if not measured:
        return []
    columns = [("force", "Force [%]"), ("moment", "Moment [%]"), ("area", "Area [%]"), ("peak", "Peak [%]"), ("own", "Force, own limit [%]")]
    extra = [("size", "Elements"), ("build_s", "Build [s]"), ("memory_MB", "Memory [MB]")]
    levels = ERRORS["contact"][3]
    lines = ["### One contact evaluation", "",
             "Evaluations at poses that move by about 0.01 mm each. Errors: root mean square over ten poses, of the force vector, of the moment about the fixed origin "
             "(over the force times 25 mm), of area and peak pressure. \"Own limit\": against what the program itself converges to, so that a difference of model is no error; "
             "Drake's and OpenSim's edge lengths are of both meshes.", ""]
    for got in (m["sphere"] for m in measured.values() if "sphere" in m):
        f = got["forces"]
        lines += ["Sphere of 30 mm pressed 0.2 mm into a flat layer of 6 mm, UHMWPE. Each model has a closed form: "
                  f"{f['Genu']:.2f} N (midsurface), {f['Drake']:.2f} N (Drake), {f['OpenSim']:.2f} N (OpenSim). Time at equal error of the force against the program's own:", ""]
        lines += at_equal_error(got["rows"], "own", ERRORS["sphere"][3], "%")
        lines += _details("all settings, errors against the midsurface's closed form", settings(got["rows"], columns, extra))
    for name, m in ((n, m) for n, m in measured.items() if "contact" in m):
        rows = m["contact"]["rows"]
        lines += [f"Ten poses of the gait cycle, one at its largest load, {TITLES[name]}; reference: Genu on 240 x 240 elements; own limits of the peers: extrapolated from their two "
                  "finest meshes. Time at equal error of the force against the own limit:", ""]
        lines += at_equal_error(rows, "own", levels, "%")
        lines += ["And against Genu's converged force:", ""] + at_equal_error(rows, "force", levels, "%")
        lines += _details("all settings", settings(rows, columns, extra))
    return lines


def replace(page, text):
    """The page with its section between the marks replaced, or put at its end."""
    section = f"{BEGIN}\n{text.rstrip()}\n\n{END}\n"
    if BEGIN in page:
        return page[: page.index(BEGIN)] + section + page[page.index(END) + len(END) + 1 :]
    return page.rstrip("\n") + "\n\n" + section
