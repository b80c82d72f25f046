"""Instructions by source line, function and object, from callgrind's output."""

import collections
import os.path
import pathlib
import subprocess
import sys


class Profile:
    """Of one run: instructions by (file, line), those of functions, those of objects, and how often functions were called. Code that
    the compiler inlined counts at its own file and line."""

    def __init__(self, text, evaluations):
        self.evaluations = evaluations
        self.lines, self.functions, self.objects, self.calls = (collections.Counter() for _ in range(4))
        self.total = 0
        file = function = library = ""
        called, is_call = None, False
        for line in text.splitlines():
            key, equals, value = line.partition("=")
            if equals and key in ("fl", "fi", "fe"):
                file = os.path.normpath(value)  # a compiler cache makes it relative to the build's folder
            elif equals and key == "fn":
                function = value
            elif equals and key == "ob":
                library = value
            elif equals and key == "cfn":
                called = value
            elif equals and key == "calls":
                self.calls[called] += int(value.split()[0])
                is_call = True
                continue
            elif line[:1].isdigit():
                if not is_call:  # the line after calls= is what the callee took, which has lines of its own
                    at, count = line.split()[:2]
                    self.lines[file, int(at)] += int(count)
                    self.functions[function] += int(count)
                    self.objects[library] += int(count)
                    self.total += int(count)
            is_call = False

    def per_evaluation(self, count):
        return round(count / self.evaluations)

    @property
    def instructions(self):
        return self.per_evaluation(self.total)

    def own(self, code):
        """Instructions of an evaluation in these lines and functions."""
        count = sum(n for (file, line), n in self.lines.items() if line in code.lines.get(file, ()))
        count += sum(n for name, n in self.functions.items() if any(p.search(name) for p in code.functions))
        count += sum(n for name, n in self.objects.items() if any(p.search(name) for p in code.objects))
        return self.per_evaluation(count)

    def calls_of(self, pattern):
        """By evaluation, and a fraction for calls before counting began, which callgrind counts too."""
        return sum(n for name, n in self.calls.items() if pattern.search(name)) / self.evaluations


def measure(command, output, evaluations, only="genuCountedEvaluations"):
    """Runs a program under callgrind and counts what happens within a function."""
    output = pathlib.Path(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.unlink(missing_ok=True)
    run = subprocess.run(["valgrind", "--tool=callgrind", "--collect-atstart=no", f"--toggle-collect={only}", "--compress-strings=no",
                          "--compress-pos=no", f"--callgrind-out-file={output}", *map(str, command)], capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"error: {' '.join(map(str, command))} failed under valgrind:\n{run.stdout}{run.stderr}")
    profile = Profile(output.read_text(), evaluations)
    if profile.total == 0:
        sys.exit(f"error: valgrind saw no call of {only} in {' '.join(map(str, command))}")
    profile.printed = run.stdout.strip()
    return profile
