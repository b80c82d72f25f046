"""python -m peers.contact GENU LIBRARY MODELS OUTPUT: one contact evaluation, a settle and the gait cycle with Genu, Drake and OpenSim.
Writes OUTPUT/contact.md and contact.png; with --write also the section of docs/verification.md. Ctrl-C ends the measuring: what is complete is
kept and shown. Exit code: 0 done, 1 nothing to show, 2 wrong options, 130 broken off."""
import argparse
import os
import pathlib
import platform
import shutil
import signal
import sys

from . import page, picture, plan
from .kept import SHORT_S, Kept, NotMeasured, Progress
from .limited import NotFinished
from .report import Comparison

ROOT = pathlib.Path(__file__).resolve().parents[3]
PAGE, PICTURE = ROOT / "docs" / "verification.md", ROOT / "docs" / "images" / "peers.png"
KNEES = ("artificial_knee", "tka_dm")


def processor():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines() if pathlib.Path("/proc/cpuinfo").exists() else []
    return next((l.split(":", 1)[1].strip() for l in lines if l.startswith("model name")), platform.processor() or "unknown processor")


def arguments():
    parser = argparse.ArgumentParser(prog="compare_peers", description=__doc__)
    for name in ("genu", "library", "models", "output"):
        parser.add_argument(name, type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("--part", choices=plan.PARTS, action="append", help="measure only this; may be repeated. The others are as last measured")
    parser.add_argument("--knee", choices=KNEES, action="append", help="measure only this; may be repeated. The other is as last measured")
    parser.add_argument("--peer", choices=plan.PEERS, action="append", help="measure only this; the other is as last measured")
    parser.add_argument("--limit", type=float, default=600, help="of processor time for one case [s]")
    modes = parser.add_mutually_exclusive_group()
    for name, help in (("continue", "measure only what has no result yet"), ("short", f"measure again Genu's cases and what took at most {SHORT_S} s the last time"),
                       ("measured", "measure nothing")):
        modes.add_argument(f"--{name}", dest="mode", action="store_const", const={"measured": "none"}.get(name, name), help=help)
    parser.add_argument("--write", action="store_true", help="replace the section of docs/verification.md, and its picture")
    given = parser.parse_args()
    if not given.limit >= 1:
        parser.error(f"--limit {given.limit:g}: a case may take 1 s or more")
    return parser, given


def compare(given, knees, peers):
    """What is measured, by knee, and whether all that was asked for was: not if it was broken off."""
    data = os.environ.get("GENU_DATA_DIR")
    data = pathlib.Path(data).resolve() if data else None
    mode, work, progress = given.mode or "all", given.output / "work" / "contact", Progress({}, sys.stdout)
    comparisons = {}
    for name in KNEES:
        try:
            if name == "tka_dm" and data is None:
                raise FileNotFoundError("GENU_DATA_DIR is not set")
            comparisons[name] = Comparison(given.models / name / "gait.yaml", given.genu, given.library, work / name, data,
                                           Kept(work / name / "cases", mode, peers, progress), given.limit)
        except FileNotFoundError as reason:
            print(f"{name} is left out, see models/{name}/README.md: {reason}", flush=True)
    # Evaluations of all knees first: what takes long comes last.
    parts = [(name, part) for part in ("sphere", *plan.PARTS) if part in (given.part or plan.PARTS) or (part == "sphere" and "contact" in (given.part or plan.PARTS))
             for name in comparisons if name in knees and (part != "sphere" or name == KNEES[0])]
    for name, part in parts:
        kept = comparisons[name].kept
        for job in plan.jobs(part) + ([plan.reference()] if part in ("contact", "gait") else []):
            if kept.will_measure(job, given.limit):
                last = kept.last(job)
                progress.costs[progress.key(_title(name, part), job)] = min(last["cpu_s"] if last else job.cost_s, job.limit_s or given.limit)
    progress.total = len(progress.costs)
    measured, complete = {name: {"case": c.case} for name, c in comparisons.items()}, True
    try:
        for name, part in parts:
            progress.title = _title(name, part)
            _part(measured[name], comparisons[name], part)
    except KeyboardInterrupt:
        print("\nbroken off; what is complete is kept, --continue measures the rest", flush=True)
        complete = False
    # What was not asked for, or not reached, is as it was measured last.
    for name, c in comparisons.items():
        c.kept.mode = "none"
        for part in ("sphere", *plan.PARTS):
            if part not in measured[name] and (part != "sphere" or name == KNEES[0]):
                _part(measured[name], c, part)
        measured[name].update(versions=c.versions, loads=c.loads, dates=c.dates)
    return {n: m for n, m in measured.items() if any(p in m for p in ("sphere", *plan.PARTS))}, complete


def _title(knee, part):
    return f"{knee} {part}" if part != "sphere" else "sphere on a layer"


def _part(measured, comparison, part):
    """A part without its reference is left out."""
    try:
        got = getattr(comparison, part)()
    except NotMeasured:
        return
    except NotFinished as reason:
        print(f"{part} is left out, Genu's own reference is missing: {reason}", flush=True)
        return
    if got["rows"]:
        measured[part] = got


def main():
    parser, given = arguments()
    # A plain kill ends a running case too.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    measured, complete = compare(given, given.knee or KNEES, given.peer or plan.PEERS)
    if not measured:
        print("nothing is measured yet")
        return 1 if complete else 130
    text = page.write(measured, processor())
    (given.output / "contact.md").write_text(text)
    drawn = picture.draw(measured, given.output / "contact.png", given.output / "work" / "contact")
    print(f"written: {given.output / 'contact.md'}" + (f", {given.output / 'contact.png'}" if drawn else ""))
    if given.write and complete:
        missing = [f"{name}: {part}" for name in KNEES for part in plan.PARTS if part not in measured.get(name, {})]
        if missing:
            parser.error(f"--write would lose what docs/verification.md shows; not measured yet: {', '.join(missing)}")
        PAGE.write_text(page.replace(PAGE.read_text(), text))
        if drawn:
            shutil.copy(given.output / "contact.png", PICTURE)
        print("written: docs/verification.md" + (", docs/images/peers.png" if drawn else ""))
    else:
        print("\n".join(page.summary(measured)))
    return 0 if complete else 130


if __name__ == "__main__":
    sys.exit(main())
