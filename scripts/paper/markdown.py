"""Tables, and the places of a page where they stand."""

import math
import re
import sys


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def pair(form, numbers):
    return " / ".join(form % number for number in numbers)


def digits(number, count):
    """That many significant digits, without an exponent."""
    rounded = float(f"{number:.{count - 1}e}")
    places = count - 1 - math.floor(math.log10(abs(rounded))) if rounded else 0
    return f"{rounded:.{max(0, places)}f}"


def begin(name, script="scripts/compare_with_paper"):
    return f"<!-- {name}: {script} --write -->"


def replace(page, sections, script="scripts/compare_with_paper"):
    """The page with the text of each section between its marker and the next end."""
    for name, text in sections.items():
        pattern = re.compile("(" + re.escape(begin(name, script)) + ").*?(<!-- end -->)", re.DOTALL)
        page, count = pattern.subn(lambda m: m.group(1) + "\n\n" + text + "\n\n" + m.group(2), page)
        if count != 1:
            sys.exit(f"{script}: the page needs one {begin(name, script)} with <!-- end --> after it, and has {count}")
    return page
