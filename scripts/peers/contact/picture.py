"""Error over processor time of the three comparisons, a row for each knee; gnuplot draws it."""
import pathlib
import shutil
import subprocess

from . import equal_error
from .page import ERRORS, PARTS, SHORT
from .tables import ratio

COLOURS = {"Genu": ("#0060ad", 7), "Drake": ("#dd181f", 5), "OpenSim": ("#2e8b57", 9)}
UNITS = {"contact": (1e3, "ms"), "settle": (1.0, "s"), "gait": (1.0, "s")}


def _panel(rows, part, title, work, name):
    error, quantity, unit, levels = ERRORS[part]
    scale, time = UNITS[part]
    lines, plots, everything = [], [], []
    fronts = {p: equal_error.front(rows, p, error) for p in COLOURS}
    for program, (colour, point) in COLOURS.items():
        shown = [(scale * r.time_s, r.errors[error]) for r in rows if r.program == program and r.time_s and r.errors.get(error) and not r.fell()]
        if not shown:
            continue
        everything += shown
        data = work / f"{name}_{part}_{program}"
        for what, points in (("all", shown), ("front", [(scale * t, e) for t, e in fronts[program]])):
            pathlib.Path(f"{data}_{what}.txt").write_text("".join(f"{t} {e}\n" for t, e in points))
        plots += [f"'{data}_front.txt' with lines linewidth 1.5 linecolor rgb '{colour}' notitle",
                  f"'{data}_all.txt' with points pointtype {point} pointsize 1.1 linecolor rgb '{colour}' title '{program}'"]
        found = equal_error.ratios(rows, program, error, levels) if program != "Genu" else []
        if found:
            level, r = found[-1]
            a, b = (scale * equal_error.time_at(fronts[p], level).s for p in ("Genu", program))
            lines += [f"set arrow from {a},{level} to {b},{level} heads size screen 0.004,20 linewidth 1.2 linecolor rgb '{colour}' front",
                      f"set label '{ratio(r)} times' at {(a * b) ** 0.5},{level} center offset 0,{0.6 if program == 'OpenSim' else -0.7} textcolor rgb '{colour}' front"]
    if not plots:
        return []
    # A little room around the points: gnuplot's own goes to whole decades.
    ranges = [(min(v) / 1.6, 1.6 * max(v)) for v in zip(*everything)]
    lines += [f"set {axis}range [{a}:{b}]" for axis, (a, b) in zip("xy", ranges)]
    lines += [f"set title '{title}' offset 0,0.5", f"set xlabel 'processor time [{time}]'", f"set ylabel 'error of the {quantity} [{unit}]'"]
    return ["unset arrow", "unset label", *lines, "plot " + ", ".join(plots)]


def draw(measured, file, work):
    """Whether a picture was drawn."""
    panels = {name: [p for p in PARTS if p in m] for name, m in measured.items()}
    if shutil.which("gnuplot") is None:
        print("no picture: there is no gnuplot")
        return False
    work.mkdir(parents=True, exist_ok=True)
    script = [f"set terminal pngcairo size 1440,{440 * len(panels)} font 'sans,10'", f"set output '{file}'", f"set multiplot layout {len(panels)},3",
              "set logscale xy", "set grid", "set format '%g'", "set key tmargin center horizontal"]
    for name, parts in panels.items():
        for part in PARTS:
            drawn = _panel(measured[name][part]["rows"], part, f"{PARTS[part].capitalize()}, {SHORT[name]}", work, name) if part in parts else []
            script += drawn or ["set multiplot next"]
    (work / "picture.gp").write_text("\n".join(script) + "\n")
    subprocess.run(["gnuplot", str(work / "picture.gp")], check=True)
    return True
