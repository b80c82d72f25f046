"""python -m peers.contact GENU LIBRARY MODELS OUTPUT: one contact evaluation, a settle and the gait cycle with Genu, Drake and OpenSim.
Writes OUTPUT/contact.md and contact.png; with --write also the section of docs/verification.md."""
import argparse
import os
import pathlib
import platform
import shutil

from . import page, picture
from .case import KneeCase
from .report import Comparison

ROOT = pathlib.Path(__file__).resolve().parents[3]
PAGE, PICTURE = ROOT / "docs" / "verification.md", ROOT / "docs" / "images" / "peers.png"
PARTS = ("contact", "settle", "gait")


def processor():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines() if pathlib.Path("/proc/cpuinfo").exists() else []
    return next((l.split(":", 1)[1].strip() for l in lines if l.startswith("model name")), platform.processor() or "unknown processor")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("genu", "library", "models", "output"):
        parser.add_argument(name, type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("--part", choices=PARTS, action="append", help="only this; may be repeated")
    parser.add_argument("--write", action="store_true", help="replace the section of docs/verification.md, and its picture; needs all parts")
    given = parser.parse_args()
    parts = given.part or PARTS
    data = os.environ.get("GENU_DATA_DIR")
    knees = [given.models / "artificial_knee/gait.yaml"]
    measured, reasons = {}, []
    try:
        if not data:
            raise FileNotFoundError("GENU_DATA_DIR is not set")
        KneeCase(given.models / "tka_dm/gait.yaml")
        knees.append(given.models / "tka_dm/gait.yaml")
    except (FileNotFoundError, ValueError) as reason:
        reasons.append(f"tka_dm is left out, see models/tka_dm/README.md: {reason}")
        print(reasons[-1])
    work = given.output / "work" / "contact"
    for knee in knees:
        name = knee.parent.name
        comparison = Comparison(given.genu, given.library, work / name, pathlib.Path(data).resolve() if data else None)
        got = measured[name] = {"versions": comparison.versions, "thickness_mm": 1e3 * KneeCase(knee).h_m}
        for part in parts:
            print(f"{name}: {part}", flush=True)
            if part == "contact":
                if name == "artificial_knee":
                    got["sphere"], got["sphere_forces"] = comparison.sphere()
                got["contact"] = comparison.knee(knee)
            elif part == "settle":
                got["settle"] = comparison.settle(knee)
                got["local_mm"] = comparison.local_mm
            else:
                got["gait"] = comparison.gait(knee)
    text = page.write(measured, parts, processor(), reasons)
    (given.output / "contact.md").write_text(text)
    picture.draw(measured, given.output / "contact.png", work)
    print(text)
    if given.write:
        if set(parts) != set(PARTS):
            parser.error("--write needs all parts")
        PAGE.write_text(page.replace(PAGE.read_text(), text))
        if (given.output / "contact.png").exists():
            shutil.copy(given.output / "contact.png", PICTURE)


if __name__ == "__main__":
    main()
