"""Error against time of the three comparisons on the artificial knee; gnuplot draws it."""
import shutil
import subprocess

COLOURS = {"Genu": ("#0060ad", 7), "Drake": ("#dd181f", 5), "OpenSim": ("#2e8b57", 9)}
PANELS = (("contact", "own", "One contact evaluation", "force error, own limit [%]", 1e3, "time [ms]"),
          ("settle", "pose", "Settle", "pose error [mm]", 1.0, "time [s]"),
          ("gait", "pose", "Gait, 1 s", "pose error [mm]", 1.0, "time [s]"))


def draw(got, file, work):
    panels = [p for p in PANELS if p[0] in got]
    if not panels:
        return
    if shutil.which("gnuplot") is None:
        print("no picture: there is no gnuplot")
        return
    script = [f"set terminal pngcairo size {480 * len(panels)},420 font 'sans,10'", f"set output '{file}'", f"set multiplot layout 1,{len(panels)}",
              "set logscale xy", "set grid", "set format '%g'", "set key outside bottom center horizontal"]
    for part, error, title, y, scale, x in panels:
        script += [f"set title '{title}'", f"set xlabel 'processor {x}'", f"set ylabel '{y}'"]
        plots = []
        for program, (colour, point) in COLOURS.items():
            rows = [r for r in got[part] if r.program == program and r.time_s and 0 < (r.errors.get(error) or 0) < 100]
            if not rows:
                continue
            data = work / f"{part}_{program}.txt"
            data.write_text("".join(f"{scale * r.time_s} {r.errors[error]}\n" for r in rows))
            plots.append(f"'{data}' with points pointtype {point} pointsize 1.2 linecolor rgb '{colour}' title '{program}'")
        script.append("plot " + ", ".join(plots))
    (work / "picture.gp").write_text("\n".join(script) + "\n")
    subprocess.run(["gnuplot", str(work / "picture.gp")], check=True)
