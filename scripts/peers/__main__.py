"""python -m peers GENU ELEMENT_BENCHMARK MODELS OUTPUT: compares force elements with OpenSim's and writes OUTPUT/elements.md."""
import argparse
import multiprocessing
import pathlib
import platform

import opensim

from . import compare_elements, second, timing
from .genu import Run
from .scene import Scene


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(c) for c in row) + " |" for row in rows]) + "\n"


def tiny(value):
    """Of rounding and of more, both readable."""
    return "0" if value == 0 else f"{value:.1e}" if abs(value) < 1e-3 else f"{value:.3g}"


def write_elements(program, models, work):
    """Both runs: sections of the report."""
    text = ""
    for command, file in (("series", models / "knee_with_ligaments/natural.yaml"), ("gait", models / "musculoskeletal_knee/leg_extension.yaml")):
        scene = Scene(file)
        run = Run(program, command, file, work / file.stem)
        probes = None
        if command == "gait":
            probes = Run(program, command, compare_elements.add_probes(scene, work), work / f"{file.stem}_probes")
        differences = compare_elements.compare(scene, run, probes=probes)
        title = f"{file.parent.name}/{file.name}, genu {command}, {len(run.motion)} poses"
        text += f"\n## {title}\n\n"
        header = ["element", "number", "path", "largest force [N]", "length [mm]", "rate [mm/s]", "force [N]", "force [%]", "law alone [N]"]
        rows = []
        for name, path, members in compare_elements.summarise(differences):
            rate = tiny(1e3 * compare_elements.largest(members, "rate")) if members[0].has_rate else "–"
            rows.append([name, len(members), path, f"{max(d.largest_force() for d in members):.1f}",
                         tiny(1e3 * compare_elements.largest(members, "length")), rate, tiny(compare_elements.largest(members, "force")),
                         tiny(compare_elements.largest_share(members, "force")), tiny(compare_elements.largest(members, "law"))])
        text += table(header, rows)
        wrapped = [d for d in differences if d.element.is_wrapped()]
        text += "\nLength over wraps, OpenSim minus Genu [mm], smallest and largest:\n\n"
        shapes = {}
        for d in wrapped:
            shapes.setdefault(scene.wraps[next(w for w in d.element.wraps if w)].shape, []).append(d)
        text += table(["shape", "elements", "from", "to"],
                      [[s, len(ds), tiny(1e3 * min(d.length.min() for d in ds)), tiny(1e3 * max(d.length.max() for d in ds))]
                       for s, ds in shapes.items()])
        if command == "gait":
            errors = compare_elements.own_rate_errors(scene, run)
            name = max(errors, key=errors.get)
            text += f"\nOpenSim's rates over wraps against the derivative of its own lengths: {tiny(1e3 * errors[name])} mm/s at most, {name}.\n"
        muscles = [d for d in differences if d.element.kind == "muscles"]
        if not muscles:
            continue
        text += "\nRigid tendon, same length, rate and activation. Where Genu pulls: largest difference. Where it cuts the tension at 0:\n\n"
        rows = []
        for d in muscles:
            cut = d.own == 0
            rows.append([d.element.name, tiny(max(abs(d.law[~cut]), default=0)), int(cut.sum()), tiny(min(d.law[cut], default=0))])
        text += table(["muscle", "pulls [N]", "poses cut", "OpenSim there, down to [N]"], [r for r in rows if r[2] or float(r[1]) > 1e-9])
        millard = compare_elements.compare(scene, run, muscle="millard", kinds=("muscles",))
        text += "\nMillard2012EquilibriumMuscle, rigid tendon, same parameters:\n\n"
        text += table(["muscle", "largest force [N]", "law alone [N]", "law alone [%]"],
                      [[d.element.name, f"{d.largest_force():.1f}", tiny(max(abs(d.law))), tiny(compare_elements.largest_share([d], "law"))]
                       for d in millard])
    return text


def write_compliant(program, models, work):
    scene = Scene(models / "musculoskeletal_knee/isometric.yaml")
    given = dict(scene.yaml)
    given["muscles"] = {n: dict(m, tendon="compliant") for n, m in given["muscles"].items()}
    file = compare_elements.write_scene(given, scene, work / "isometric_compliant.yaml")
    rows = compare_elements.compare_at_rest(scene, Run(program, "static", file, work / "isometric_compliant"))
    text = "\n## Compliant tendons at rest: musculoskeletal_knee/isometric.yaml with `tendon: compliant`, genu static\n\n"
    return text + table(["muscle", "force, Genu [N]", "OpenSim minus Genu [N]", "fibre, OpenSim minus Genu [mm]"],
                        [[n, f"{a:.3f}", tiny(b - a), tiny(1e3 * (d - c))] for n, a, b, c, d in rows])


def write_laws():
    text = "\n## Laws of OpenSim\n\nCurves, DeGrooteFregly2016Muscle minus Millard2012EquilibriumMuscle:\n\n"
    text += table(["curve", "from", "to", "largest difference", "at"],
                  [[n, f"{a:.2f}", f"{b:.2f}", f"{d:.3f}", f"{x:.3f}"] for n, a, b, d, x in compare_elements.curve_differences()])
    text += "\nBlankevoort1991Ligament, k = 1000 N, c = 0.003, de/dt = 0.1 /s: damping force by strain\n\n"
    text += table(["strain", "force [N]"], [[f"{e:g}", f"{f:.3g}"] for e, f in compare_elements.ligament_damping()])
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        rates = pool.apply(compare_elements.activation_rates)
    text += "\nDeGrooteFregly2016Muscle, rates of activation [1/s] of a first muscle with 15 and 60 ms and a second with 10 and 40 ms, "
    return text + f"a = 0.2, u = 0.7: {rates[0]:.3f}, {rates[1]:.3f}; by its own times the second's is 37.561\n"


def write_times(benchmark, work):
    rows = timing.compare(benchmark, work / "element_scenes")
    text = f"\n## Time of one element in one evaluation of the accelerations\n\n{timing.COPIES} copies minus none; shortest repeats.\n\n"
    return text + table(["element", "OpenSim's muscle", "Genu [us]", "OpenSim [us]", "ratio"],
                        [[case, muscle, f"{1e6 * a:.2f}", f"{1e6 * b:.2f}", f"{b / a:.1f}"] for case, muscle, a, b in rows])


def write_second(program, models, work):
    rows = second.compare(program, Scene(models / "musculoskeletal_knee/leg_extension.yaml"), work / "second")
    text = "\n## One second of a leg with a hinge for a knee, 13 muscles\n\n"
    shown = []
    for r in rows:
        if r.failed:
            shown.append([r.case.name, r.program, f"{r.accuracy:g}", r.failed, "", "", ""])
            continue
        shown.append([r.case.name, r.program, f"{r.accuracy:g}", f"{1e3 * r.cpu_s:.0f}", f"{r.last_deg:.4f}",
                      "" if r.own_error_deg is None else tiny(r.own_error_deg), "" if r.difference_deg is None else tiny(r.difference_deg)])
    return text + table(["tendon", "program", "accuracy", "time [ms]", "last angle [deg]", "own error [deg]", "programs differ [deg]"], shown)


PARTS = ("elements", "compliant", "laws", "second", "times")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("genu", "element_benchmark", "models", "output"):
        parser.add_argument(name, type=pathlib.Path)
    parser.add_argument("--part", choices=PARTS, action="append", help="only this; may be repeated")
    given = parser.parse_args()
    work = given.output / "work"
    work.mkdir(parents=True, exist_ok=True)
    parts = given.part or PARTS
    text = "# Force elements: Genu and OpenSim\n\n"
    text += f"OpenSim {opensim.GetVersion()}, Python {platform.python_version()}. Differences are OpenSim minus Genu, largest over all poses.\n"
    make = {
        "elements": lambda: write_elements(given.genu, given.models, work),
        "compliant": lambda: write_compliant(given.genu, given.models, work),
        "laws": write_laws,
        "second": lambda: write_second(given.genu, given.models, work),
        "times": lambda: write_times(given.element_benchmark, work),
    }
    for part in PARTS:
        if part in parts:
            text += make[part]()
    (given.output / "elements.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
