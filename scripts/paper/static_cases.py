"""Section 4: an implant under 750 to 3000 N at 0 to 90 degrees of flexion, linear material and power law."""

from . import markdown, plots
from .published import STATIC_FLEXIONS_DEG, STATIC_LOADS_N
from .results import Failed, at_pose, read_scene, read_summary, sides, values, write_scene

LAWS = (("linear", "gait.yaml"), ("power law", "gait_power_law.yaml"))
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
    """{(model, law, flexion, load): (pose, total, [medial, lateral], largest estimated error of peak and area [%]) or the program's message}"""
    results = {}
    for model in models:
        for law, file in LAWS:
            for flexion in STATIC_FLEXIONS_DEG:
                for load in STATIC_LOADS_N:
                    name, scene = make_scene(run, model, law, file, flexion, load)
                    try:
                        folder = run.analyse("static", scene, name, "--grid", "50x50")
                    except Failed as failure:
                        results[model, law, flexion, load] = str(failure)
                        continue
                    replayed = run.analyse("replay", folder, name + "_errors", "--grid", "50x50")
                    found = at_pose(read_summary(replayed))
                    results[model, law, flexion, load] = found
    return results


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
        poses = [" / ".join("%.1f" % mine[model, "linear", f, STATIC_LOADS_N[-1]]["pose"]["x_mm"] for f in STATIC_FLEXIONS_DEG
                            if (model, "linear", f, STATIC_LOADS_N[-1]) in mine)]
        turned = max((abs(r["pose"]["ry_deg"]) for r in mine.values()), default=0)
        tilted = max((abs(r["pose"]["rx_deg"]) for r in mine.values()), default=0)
        apart = max((abs(a / b - 1) for a, b in ([values(load)[PEAK] for load in sides(r["contact"])] for r in mine.values())), default=0)
        strain = max(r["contact"]["total"]["max_strain"] for r in mine.values())
        loads = [load for r in mine.values() for load in r["contact"]["compartments"].values()]
        estimated = [max(100 * l["error_estimate"][key] / l[key] for l in loads) for key in ("peak_pressure_Pa", "mean_pressure_Pa", "area_m2")]
        rows.append([model, poses[0], "%.2f / %.2f" % (turned, tilted), "%.0f" % (100 * apart), "%.1f" % (100 * strain), " / ".join("%.1g" % e for e in estimated)])
    return markdown.table(["", "x of the femoral origin at 0 / 30 / 60 / 90 degrees [mm]", "largest ry / rx [deg]", "medial and lateral peaks differ by at most [%]",
                           "largest d/h [%]", "estimated errors of the grid, peak / mean / area, at most [%]"], rows)


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
    return markdown.table(["3000 N over 750 N", "peak", "mean", "area", "peak over mean, all loads"], rows)


def draw(results, models, picture):
    panels = []
    style = {law: f"with linespoints lw 2 {dash} pt {point} ps 1" for (law, _), dash, point in zip(LAWS, ("dt 1", "dt 2"), (7, 5))}
    for q, label in ((PEAK, "peak pressure (MPa)"), (MEAN, "average pressure (MPa)"), (AREA, "contact area (mm^2)")):
        row = []
        for model in models:
            curves = []
            for law, _ in LAWS:
                for color, flexion in zip(plots.COLORS, STATIC_FLEXIONS_DEG):
                    points = [(load, values(results[model, law, flexion, load]["contact"]["total"])[q]) for load in STATIC_LOADS_N
                              if not isinstance(results[model, law, flexion, load], str)]
                    if points:
                        curves.append(plots.Curve(points, f"{style[law]} lc rgb '{color}'"))
            row.append(plots.Panel(curves, title=model if q == PEAK else "", ylabel=label, xlabel="load (N)" if q == AREA else "",
                                   settings="set xrange [600:3150]; set yrange [0:*]; set xtics 750,750,3000"))
        panels.append(row)
    key = [(f"{flexion} degrees", f"with lines lw 3 lc rgb '{color}'") for color, flexion in zip(plots.COLORS, STATIC_FLEXIONS_DEG)]
    key += [(law, f"{style[law]} lc rgb '#404040'") for law, _ in LAWS]
    plots.draw(picture, panels, key)
