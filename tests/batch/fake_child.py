"""A fake child without Blender, which starts fast: the text of an input file says what to do with it.

It loads the module `child_main` alone, without the imports of the package.
"""

import importlib.util
import os
import sys
import time
from pathlib import Path

WORKER_MAIN = Path(__file__).resolve().parents[2] / "wks_segment" / "batch" / "child_main.py"
spec = importlib.util.spec_from_file_location("child_main", WORKER_MAIN)
child_main = importlib.util.module_from_spec(spec)
spec.loader.exec_module(child_main)
calls = []


def run(arguments):
    _, source, *rest = arguments
    calls.append(source)
    print('{"error": "junk on standard output"}', flush=True)
    text = Path(source).read_text()
    if text == "crash" or (text == "crash if not first" and len(calls) > 1):
        print("something is wrong", file=sys.stderr, flush=True)
        os.kill(os.getpid(), 9)
    if text == "leave":
        os._exit(7)
    if text.startswith("sleep"):
        time.sleep(float(text.split()[1]))
    if text == "eat":
        data = bytearray(b"x" * 600_000_000)
        time.sleep(60)
        del data
    if text == "refuse":
        return child_main.Answer(None, f"{source}: there is no mesh in this file")
    if text == "raise":
        raise RuntimeError("unforeseen")
    if text == "fill":
        return child_main.Answer(None, f"{source}: No space left on device", True)
    for argument in rest:
        if argument.startswith("--out"):
            Path(argument.partition("=")[2]).write_text(f"{text} {os.getpid()} {len(calls)}")
        if argument == "--beside":
            beside = next(option.partition("=")[2] for option in rest if option.startswith("--out"))
            Path(beside).with_suffix(".mtl").write_text("beside")
    return child_main.Answer({"segments": 3, "warnings": ["<a> warning"], "other": float("nan")})


print("a greeting", flush=True)
sys.exit(child_main.serve(Path(sys.argv[1]), run))
