"""The section of docs/verification.md."""
from .report import equal_error, number, table

BEGIN, END = "<!-- peers: scripts/compare_peers --write -->", "<!-- end of peers -->"
TITLES = {"artificial_knee": "artificial knee (`models/artificial_knee/gait.yaml`)", "tka_dm": "measured implant (`models/tka_dm/gait.yaml`)"}
DIFFERENCES = [
    ("pressure", "K d/h, d along the midsurface normal [BF2004 eq. 2]", "K d/h, d the distance to the layer's surface, interpolated linearly in tetrahedra",
     "K d/h, d the distance to the nearest point of the other mesh; the mean of springs on both meshes"),
    ("thickness h", "constant here; local in the shipped scene", "constant: the field is the distance over one depth", "constant: one stiffness K/h"),
    ("surfaces", "NURBS, sphere and plane as they are", "triangles and tetrahedra through points of them; layer meshed over the compartments' rectangles, as deep "
     "as h, or as half, a quarter or an eighth of it (with so much less modulus) where a curved surface turns tetrahedra inside out", "triangles through the same points, closed by copies 8 mm inside"),
    ("elements", "grid on the layer, integrated over the part in contact", "polygons where the rigid mesh cuts the tetrahedra", "whole triangles, by their centre"),
    ("force acts", "on the layer's surface A, along the midsurface normal", "on the contact surface, which is the rigid surface, along its normal",
     "along the connection of a spring and the nearest point"),
    ("damping, friction", "none", "none (dissipation 0, friction 0); discrete steps damp numerically", "none"),
    ("mass", "URDF", "URDF; bodies between joints massless, 1 mg each in continuous time", "URDF"),
    ("prescribed coordinates", "eliminated", "stiff controllers, implicit; error in the column \"follows\"", "constraints"),
    ("load", "at a point of the body, cubic spline over time", "the same, held over a discrete step", "the same, spline through 1 ms samples"),
    ("equilibrium", "Newton on statics", "discrete steps with joints damped by 300/s times the mass, until below 1 um/s in three steps",
     "Runge-Kutta-Merson with the same damping, until below 1 um/s"),
]


def _rows(rows, errors, extra, unit, scale):
    """errors: (key, heading); extra: (key of more, heading)."""
    header = ["Program", "Setting", f"Time [{unit}]"] + [h for _, h in errors] + [h for _, h in extra] + [""]
    show = lambda v: "–" if v is None else v if isinstance(v, str) else str(v) if isinstance(v, int) else number(v)
    return table(header, [[r.program, r.setting, "–" if r.time_s is None else number(scale * r.time_s, 3)] + [number(r.errors.get(k)) for k, _ in errors] +
                          [show(r.more.get(k)) for k, _ in extra] + [_note(r)] for r in rows])


def _note(row):
    if row.errors.get("pose", 0) > 10:
        return "falls through the layer"
    return row.note.replace("|", "\\|")


def _details(summary, lines):
    return [f"<details><summary>{summary}</summary>", "", *lines, "</details>", ""]


def write(measured, processor):
    versions = {k: v for m in measured.values() for k, v in m["versions"].items()}
    first = measured["artificial_knee"]
    lines = ["", "## Beside Drake and OpenSim", "",
             "    scripts/compare_peers --part contact --part settle --part gait --write", "",
             "runs one contact evaluation, a settle and the gait cycle on the same surfaces, material and loads with Genu, with Drake's hydroelastic contact "
             "(Elandt et al. 2019, IROS; Masterjohn et al. 2022, RA-L 7:11577) and with OpenSim's elastic foundation. "
             f"Genu {versions.get('genu', '')}, Drake {versions.get('drake', '–')}, OpenSim {versions.get('opensim', '–')}, one core of {processor}; processor time without "
             "building the model. Others computed on the machine too: ratios are safer than times. A run of a peer is stopped after 200 s, or where the table says so.", "",
             "![Error against time, artificial knee](images/peers.png)", "",
             f"The layer's thickness is constant in all programs, {first['thickness_mm']:.3g} mm, that of the insert's thinnest place" +
             (f" (tka_dm {measured['tka_dm']['thickness_mm']:.3g} mm)" if "tka_dm" in measured else "") +
             ": neither peer has a local one. Where a surface does not cover a compartment's rectangle, all programs take the largest smaller one that it covers (tka_dm). Differences of model that remain:", ""]
    lines += table(["", "Genu", "Drake", "OpenSim"], DIFFERENCES)
    if "local_mm" in first:
        lines += [f"The constant thickness itself moves Genu's equilibrium at the largest load by {number(1e3 * first['local_mm']['y'])} um in y, "
                  f"{number(1e3 * first['local_mm']['z'])} um in z. OpenSim's package has neither the thickness nor the contact of Smith et al. 2018 (`Smith2018ArticularContactForce`). "
                  "Times of Drake and OpenSim hold what Python adds, about 0.02 ms an evaluation.", ""]
    lines += _contact({n: m for n, m in measured.items() if "contact" in m})
    if any("settle" in m for m in measured.values()):
        lines += ["### Settle", "", "From 1 mm above the equilibrium at the largest load, y, z and rx free, the others held. Pose error: largest of y, z and 25 mm times rx against "
                  "Genu on 240 x 240 elements; it holds the differences of model. Genu's time: mean of ten runs.", ""]
        for name, got in ((n, m) for n, m in measured.items() if "settle" in m):
            lines += [f"At equal error, {TITLES[name]}:", ""] + equal_error(got["settle"], "pose", (0.05, 0.02, 0.01, 0.005, 0.002, 0.001), "mm", 1e3)
            lines += _details("all settings", _rows(got["settle"], [("pose", "Pose error [mm]"), ("y", "y"), ("z", "z"), ("rx", "rx")],
                                                    [("steps", "Work"), ("residual_N", "Residual [N]")], "ms", 1e3))
    if any("gait" in m for m in measured.values()):
        lines += ["### Gait cycle", "", "One second; each program starts from its own equilibrium, with Genu's rates. Errors: largest over 100 output times, against Genu with accuracy 1e-6 on "
                  "120 x 120 elements; they hold the differences of model. Force: vertical, of a compartment. Genu's time: mean of three runs.", ""]
        for name, got in ((n, m) for n, m in measured.items() if "gait" in m):
            lines += [f"At equal error, {TITLES[name]}:", ""] + equal_error(got["gait"], "pose", (1, 0.1, 0.05, 0.02, 0.01, 0.007, 0.005), "mm", 1e3)
            lines += _details("all settings", _rows(got["gait"], [("pose", "Pose error [mm]"), ("y", "y"), ("z", "z"), ("rx", "rx"), ("force", "Force error [N]")],
                                                    [("steps", "Steps"), ("follow_mm", "Follows within [mm]")], "ms", 1e3))
        lines += ["Much of a mesh's error cancels over a motion: some percent of the force are some micrometres of height. Drake's steps are few, implicit and stable; they are of first order "
                  "and damp the vibrations in z that Genu and OpenSim follow, and that OpenSim's facets excite.", ""]
    lines += ["### What the ratios say, and what not", "",
              "- Meshes err by their chords. An edge of 1 mm on radii of 30 to 60 mm lies 2 to 4 um off the surface, against a penetration of 30 to 130 um; the error falls with the square of "
              "the edge, the time rises with its inverse square. Genu takes the surfaces as they are, and its smooth rule errs by a higher order. Most of the ratio of an evaluation is this. Vertices "
              "placed off the surface by half a chord's error would make the meshes better than the same ones here.",
              "- Drake and OpenSim take any closed meshes, friction and many bodies; Genu's engine is made for thin layers on smooth surfaces and one pair of bodies.",
              "- OpenSim's integrators are explicit here or build their Jacobian by differences of whole evaluations; its time over a motion is mostly the number of evaluations.",
              "- Not compared: the peers' moments beyond the one evaluation, power-law and large-strain material, layers on both bodies, several threads.", ""]
    return "\n".join(lines)


def _contact(measured):
    if not measured:
        return []
    columns = [("force", "Force [%]"), ("moment", "Moment [%]"), ("area", "Area [%]"), ("peak", "Peak [%]"), ("own", "Force, own limit [%]")]
    extra = [("size", "Elements"), ("build_s", "Build [s]")]
    lines = ["### One contact evaluation", "",
             "Median time of evaluations at poses that move by about 0.01 mm each. Errors: root mean square over ten poses, of the force vector, of the moment about the fixed origin "
             "(over the force times 25 mm), of area and peak pressure. \"Own limit\": against what the program itself converges to, so that a difference of model is no error; "
             "Drake's and OpenSim's edge lengths are of both meshes.", ""]
    got = measured.get("artificial_knee", {})
    if "sphere" in got:
        f = got["sphere_forces"]
        lines += ["Sphere of 30 mm pressed 0.2 mm into a flat layer of 6 mm, UHMWPE. Each model has a closed form: "
                  f"{f['Genu']:.2f} N (midsurface), {f['Drake']:.2f} N (Drake), {f['OpenSim']:.2f} N (OpenSim). Time at equal error of the force against the program's own:", ""]
        lines += equal_error(got["sphere"], "own", (20, 10, 5, 2, 1, 0.1), "%", 1e3)
        lines += _details("all settings, errors against the midsurface's closed form", _rows(got["sphere"], columns, extra, "ms", 1e3))
    for name, m in measured.items():
        lines += [f"Ten poses of the gait cycle, one at its largest load, {TITLES[name]}; reference: Genu on 240 x 240 elements; own limits of the peers: extrapolated from their two "
                  "finest meshes. Time at equal error of the force against the own limit:", ""]
        lines += equal_error(m["contact"], "own", (20, 10, 5, 2, 1, 0.1), "%", 1e3)
        lines += ["And against Genu's converged force:", ""] + equal_error(m["contact"], "force", (20, 10, 5, 2, 1, 0.1), "%", 1e3)
        lines += _details("all settings", _rows(m["contact"], columns, extra, "ms", 1e3))
    return lines


def replace(page, text):
    """The page with its section between the marks replaced, or put at its end."""
    section = f"{BEGIN}\n{text.rstrip()}\n\n{END}\n"
    if BEGIN in page:
        return page[: page.index(BEGIN)] + section + page[page.index(END) + len(END) + 1 :]
    return page.rstrip("\n") + "\n\n" + section
