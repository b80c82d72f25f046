"""Section 4: an implant under 750 to 3000 N at 0 to 90 degrees of flexion, linear material and power law."""

import csv

from . import markdown, plots
from .published import STATIC_FLEXIONS_DEG, STATIC_LOADS_N
from .results import Failed, at_pose, read_scene, read_summary, sides, values, write_scene
from .sensitivity import pose_text

LAWS = (("linear", "gait.yaml"), ("power law", "gait_power_law.yaml"))
COARSE, FINE = "50x50", "100x100"  # elements for the pose, and for the pressures in it
PEAK, MEAN, AREA = 2, 3, 4  # of results.QUANTITIES

POSE_AND_LOAD = """  coordinates:
    rz: {{prescribed: {flexion} deg}}
    ry: free
    x: free
    y: free
    z: free
    rx: free

loads:
  axial:
    body: femoral_component
    frame: insert
    force: "0 N, {force} N, 0 N"
"""


def make_scene(run, model, law, file, flexion, load):
    """The gait scene's knee, with flexion prescribed, the rest free, and the load through the femoral origin."""
    head = read_scene(f"{model}/{file}").split("  coordinates:\n", 1)[0]
    name = f"static_{model}_{law.replace(' ', '_')}_{flexion}_{load}"
    return name, write_scene(run.output / "scenes", name, head + POSE_AND_LOAD.format(flexion=-flexion, force=-load))


def run_cases(run, models):
    """{(model, law, flexion, load): pose and contact on FINE, with estimated errors; or the program's message}"""
    results = {}
    for model in models:
        for law, file in LAWS:
            for flexion in STATIC_FLEXIONS_DEG:
                for load in STATIC_LOADS_N:
                    name, scene = make_scene(run, model, law, file, flexion, load)
                    try:
                        folder = run.analyse("static", scene, name, "--grid", COARSE)
                    except Failed as failure:
                        results[model, law, flexion, load] = str(failure).replace(str(scene), name + ".yaml")
                        continue
                    result = at_pose(read_summary(run.analyse("replay", folder, name + "_fine", "--grid", FINE)))
                    result["border_MPa"] = find_border_pressure(run, scene, result["pose"])
                    results[model, law, flexion, load] = result
    return results


def find_border_pressure(run, scene, pose):
    """Largest pressure [MPa] in the outermost elements: contact that goes on where the grid ends."""
    file = run.output / "field.csv"
    run.call("contact", scene, "--pose", pose_text(pose), "--grid", FINE, "--field", file)
    last = tuple(int(n) - 1 for n in FINE.split("x"))
    with open(file, newline="") as stream:
        return max((1e-6 * float(row["pressure_Pa"]) for row in csv.DictReader(stream)
                    if int(row["ix"]) in (0, last[0]) or int(row["iz"]) in (0, last[1])), default=0)


def write(run, models, picture):
    results = run_cases(run, models)
    columns = [(model, law) for model in models for law, _ in LAWS]
    rows, messages = [], []
    for flexion in STATIC_FLEXIONS_DEG:
        for load in STATIC_LOADS_N:
            row = [str(flexion), str(load)]
            for model, law in columns:
                result = results[model, law, flexion, load]
                if isinstance(result, str):
                    row.append("none")
                    messages.append(f"{model}, {law}, {flexion} degrees, {load} N: {result}")
                    continue
                v = values(result["contact"]["total"])
                row.append("%.1f / %.2f / %.0f" % (v[PEAK], v[MEAN], v[AREA]))
            rows.append(row)
    text = markdown.table(["Flexion [deg]", "Load [N]"] + [f"{model}, {law}" for model, law in columns], rows)
    if messages:
        text += "\n\n" + "\n".join("- " + message for message in messages)
    text += "\n\n" + write_facts(results, models) + "\n\n" + write_ratios(results, columns)
    draw(results, models, picture)
    return text


def found(results, model, law=None):
    return {key: result for key, result in results.items() if key[0] == model and law in (None, key[1]) and not isinstance(result, str)}


def write_facts(results, models):
    """What is behind the table: poses, shares, errors of the grid."""
    rows = []
    for model in models:
        mine = found(results, model)
        if not mine:
            continue
        largest = [mine.get((model, "linear", f, STATIC_LOADS_N[-1])) for f in STATIC_FLEXIONS_DEG]
        poses = " / ".join("%.1f" % r["pose"]["x_mm"] if r else "-" for r in largest)
        turned = max(abs(r["pose"]["ry_deg"]) for r in mine.values())
        tilted = max(abs(r["pose"]["rx_deg"]) for r in mine.values())
        off = max(1e3 * abs(load["center_of_pressure_m"][0]) for r in mine.values() for load in sides(r["contact"]))
        peaks = [[values(load)[PEAK] for load in sides(r["contact"])] for r in mine.values()]
        apart = max(abs(medial / lateral - 1) for medial, lateral in peaks)
        strain = max(r["contact"]["total"]["max_strain"] for r in mine.values())
        loads = [load for r in mine.values() for load in r["contact"]["compartments"].values()]
        estimated = [max(100 * l["error_estimate"][key] / l[key] for l in loads) for key in ("peak_pressure_Pa", "mean_pressure_Pa", "area_m2")]
        rows.append([model, poses, "%.2f / %.2f" % (turned, tilted), "%.1f" % off, "%.0f" % (100 * apart), "%.1f" % (100 * strain),
                     " / ".join(markdown.digits(e, 1) for e in estimated), "%.1f" % max(r["border_MPa"] for r in mine.values())])
    header = ["", "x of the femoral origin at 0 / 30 / 60 / 90 degrees [mm]", "largest ry / rx [deg]",
              "centers of pressure from the middle of the insert, along x, at most [mm]", "medial and lateral peaks differ by at most [%]",
              "largest d/h [%]", "estimated errors of the grid, peak / average / area, at most [%]", "largest pressure in the outermost elements [MPa]"]
    return markdown.table(header, rows)


def write_ratios(results, columns):
    """From the smallest to the largest load, which is four times as large."""
    rows = []
    for model, law in columns:
        row = [f"{model}, {law}"]
        for q in (PEAK, MEAN, AREA):
            ratios = []
            for flexion in STATIC_FLEXIONS_DEG:
                ends = [results[model, law, flexion, load] for load in (STATIC_LOADS_N[0], STATIC_LOADS_N[-1])]
                if not any(isinstance(end, str) for end in ends):
                    low, high = (values(end["contact"]["total"])[q] for end in ends)
                    ratios.append(high / low)
            row.append("%.2f .. %.2f" % (min(ratios), max(ratios)) if ratios else "-")
        mine = found(results, model, law)
        over = [values(r["contact"]["total"])[PEAK] / values(r["contact"]["total"])[MEAN] for r in mine.values()]
        row.append("%.2f .. %.2f" % (min(over), max(over)) if over else "-")
        rows.append(row)
    rows.append(["paraboloid, linear", "2", "2", "2", "2"])
    limits = (4 ** 0.25, 4 ** 0.25, 4 ** 0.75, 4 / 3)
    rows.append(["paraboloid, p ~ d^(1/3): the power law far beyond p0"] + ["%.2f" % limit for limit in limits])
    text = markdown.table(["3000 N over 750 N", "peak", "average", "area", "peak over average, all loads"], rows)
    laws = []
    for model in dict.fromkeys(model for model, _ in columns):
        for load in STATIC_LOADS_N:
            both = [[values(results[model, law, f, load]["contact"]["total"]) for law, _ in LAWS] for f in STATIC_FLEXIONS_DEG
                    if not any(isinstance(results[model, law, f, load], str) for law, _ in LAWS)]
            ratios = [[b[q] / a[q] for a, b in both] for q in (PEAK, MEAN, AREA)]
            laws.append([model, str(load)] + ["%.2f .. %.2f" % (min(r), max(r)) for r in ratios])
    return text + "\n\n" + markdown.table(["Power law over linear", "Load [N]", "peak", "average", "area"], laws)


def draw(results, models, picture):
    panels = []
    style = {law: f"with linespoints {dash} pt {point} ps 1" for (law, _), dash, point in zip(LAWS, ("dt 1", "dt 2"), (7, 5))}
    for q, label in ((PEAK, "peak pressure (MPa)"), (MEAN, "average pressure (MPa)"), (AREA, "contact area (mm\u00b2)")):
        row = []
        for model in models:
            curves = []
            for law, _ in LAWS:
                # 30 and 60 degrees can give the same pressures: the wide line shows under the other.
                for color, width, flexion in zip(plots.COLORS, (2, 5, 2, 2), STATIC_FLEXIONS_DEG):
                    points = [(load, values(results[model, law, flexion, load]["contact"]["total"])[q]) for load in STATIC_LOADS_N
                              if not isinstance(results[model, law, flexion, load], str)]
                    if points:
                        curves.append(plots.Curve(points, f"{style[law]} lw {width} lc rgb '{color}'"))
            row.append(plots.Panel(curves, title=model if q == PEAK else "", ylabel=label, xlabel="load (N)" if q == AREA else "",
                                   settings="set xrange [600:3150]; set yrange [0:*]; set offsets 0, 0, graph 0.06, 0; set xtics 750,750,3000"))
        panels.append(row)
    key = [(f"{flexion} degrees", f"with lines lw 3 lc rgb '{color}'") for color, flexion in zip(plots.COLORS, STATIC_FLEXIONS_DEG)]
    key += [(law, f"{style[law]} lw 2 lc rgb '#404040'") for law, _ in LAWS]
    plots.draw(picture, panels, key)
