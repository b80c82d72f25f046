"""python -m peers.contact GENU LIBRARY MODELS OUTPUT: one contact evaluation, a settle and the gait cycle with Genu, Drake and OpenSim.
Writes OUTPUT/contact.md and contact.png; with --write also the section of docs/verification.md."""
import argparse
import json
import os
import pathlib
import platform
import shutil

from . import page, picture
from .case import KneeCase
from .report import Comparison, Row

ROOT = pathlib.Path(__file__).resolve().parents[3]
PAGE, PICTURE = ROOT / "docs" / "verification.md", ROOT / "docs" / "images" / "peers.png"
PEERS = ("Drake", "OpenSim")
PARTS = ("contact", "settle", "gait")
KNEES = ("artificial_knee", "tka_dm")


def processor():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines() if pathlib.Path("/proc/cpuinfo").exists() else []
    return next((l.split(":", 1)[1].strip() for l in lines if l.startswith("model name")), platform.processor() or "unknown processor")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("genu", "library", "models", "output"):
        parser.add_argument(name, type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("--part", choices=PARTS, action="append", help="measure only this again; may be repeated. The others are as last measured")
    parser.add_argument("--knee", choices=KNEES, action="append", help="only this; may be repeated")
    parser.add_argument("--peer", choices=PEERS, action="append", help="run only this; rows of the other are those measured last")
    parser.add_argument("--write", action="store_true", help="replace the section of docs/verification.md, and its picture")
    parser.add_argument("--measured", action="store_true", help="measure nothing: the page and picture of what was measured last")
    given = parser.parse_args()
    data = os.environ.get("GENU_DATA_DIR")
    data = pathlib.Path(data).resolve() if data else None
    kept = given.output / "work" / "contact"
    for name in [] if given.measured else given.knee or KNEES:
        knee = given.models / name / "gait.yaml"
        try:
            if name == "tka_dm" and data is None:
                raise FileNotFoundError("GENU_DATA_DIR is not set")
            case = KneeCase(knee)
        except FileNotFoundError as reason:
            print(f"{name} is left out, see models/{name}/README.md: {reason}")
            continue
        peers = given.peer or PEERS
        comparison = Comparison(given.genu, given.library, kept / name, data, peers)
        for part in given.part or PARTS:
            print(f"{name}: {part}", flush=True)
            got = {part: getattr(comparison, part)(knee)}
            if part == "contact" and name == KNEES[0]:
                got["sphere"], got["sphere_forces"] = comparison.sphere()
            if part == "settle":
                got["local_mm"] = comparison.local_mm
            got["versions"], got["thickness_mm"] = comparison.versions, 1e3 * case.h_m
            kept.mkdir(parents=True, exist_ok=True)
            _keep_others(got, kept / f"{name}_{part}.json", [p for p in PEERS if p not in peers])
            (kept / f"{name}_{part}.json").write_text(json.dumps(got, default=plain, indent=1))
    measured = {}
    for name in KNEES:
        for part in PARTS:
            if (kept / f"{name}_{part}.json").exists():
                got = json.loads((kept / f"{name}_{part}.json").read_text())
                for key in ("sphere", *PARTS):
                    if key in got:
                        got[key] = [Row.from_json(r) for r in got[key]]
                versions = measured.get(name, {}).get("versions", {}) | got["versions"]
                measured.setdefault(name, {}).update(got, versions=versions)
    text = page.write(measured, processor())
    (given.output / "contact.md").write_text(text)
    picture.draw(measured[KNEES[0]], given.output / "contact.png", kept)
    print(text)
    if given.write:
        missing = [p for p in PARTS if p not in measured[KNEES[0]]]
        if missing:
            parser.error(f"--write needs all parts; not measured yet: {', '.join(missing)}")
        PAGE.write_text(page.replace(PAGE.read_text(), text))
        if (given.output / "contact.png").exists():
            shutil.copy(given.output / "contact.png", PICTURE)


def _keep_others(got, file, others):
    """Adds the rows of the peers that did not run now, from the last time; one that never ran gets a row that says so."""
    last = json.loads(file.read_text()) if file.exists() else {}
    for key in ("sphere", *PARTS):
        for peer in others if key in got else ():
            rows = [Row.from_json(r) for r in last.get(key, []) if r["program"].split()[0] == peer]
            got[key] += rows or [Row(peer, "–", note="not run")]
    got["versions"] = last.get("versions", {}) | got["versions"]


def plain(value):
    """For json: rows, and NumPy's numbers."""
    return value.to_json() if isinstance(value, Row) else float(value)


if __name__ == "__main__":
    main()
