"""Runs a task in a process of its own, within a limit of processor time: one program's memory and failures are not another's."""
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys


class NotFinished(Exception):
    """Why there is no result."""


def run(task, work, limit_s, **arguments):
    """task: 'module:function' of this package; returns what it returns, through JSON. limit_s: processor time, building the model included."""
    work = pathlib.Path(work).resolve()
    work.mkdir(parents=True, exist_ok=True)
    given, got = work / "task.json", work / "result.json"
    given.write_text(json.dumps({"task": task, "arguments": arguments}))
    got.unlink(missing_ok=True)
    # One thread: times are of one core.
    environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    done = subprocess.run([sys.executable, "-m", __name__, str(given), str(got)], capture_output=True, text=True, env=environment,
                          preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(limit_s) + 5)))
    if done.returncode == -signal.SIGXCPU:
        raise NotFinished(f"not finished within {limit_s:.0f} s of processor time")
    if done.returncode != 0:
        lines = [line for line in (done.stderr + done.stdout).strip().splitlines() if line.strip()]
        raise NotFinished(f"failed: {lines[-1] if lines else 'status ' + str(done.returncode)}")
    return json.loads(got.read_text())


def _main():
    import importlib

    given = json.loads(pathlib.Path(sys.argv[1]).read_text())
    module, function = given["task"].split(":")
    result = getattr(importlib.import_module(f"{__package__}.{module}"), function)(**given["arguments"])
    pathlib.Path(sys.argv[2]).write_text(json.dumps(result))


if __name__ == "__main__":
    _main()
