"""Retrieval of a shape's class (section 5 of the paper), as by `wks_segment rank`. Part of `benchmarks.quality`."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks import characters
from benchmarks.speed import table_row
from wks_segment.core import PoseSegmentation, PoseSignature, Retrieval, retrieve

LOWER_LIMITS = {"Princeton": 0.97, "characters": 1.0}
"""Smallest share of right answers that the study accepts, for the first choice of learned shapes."""
VERDICTS = ("sure", "unsure", "nothing fits")


def retrieved(
    new_model: Callable[[], PoseSegmentation], shapes: Mapping[str, Sequence[PoseSignature]], learned: Sequence[int]
) -> Retrieval:
    """Learn a model of some shapes of each class, and find the class of all others."""
    models = {name: new_model().fit([each[i] for i in learned]) for name, each in shapes.items()}
    asked = {name: [one for i, one in enumerate(each) if i not in learned] for name, each in shapes.items()}
    return retrieve(models, asked)


def of_characters(folder: Path, output: Path) -> Retrieval:
    """Run the command line: learn five frames of each character, and find the character of three others."""
    posed = output / "posed"
    posed.mkdir(parents=True, exist_ok=True)
    for path in sorted(path for path in folder.iterdir() if path.suffix in characters.FILES):
        source = characters.posed(path, output)
        link = posed / f"{path.stem}{source.suffix}"
        link.unlink(missing_ok=True)
        link.symlink_to(source.resolve())
    command = [sys.executable, "-m", "wks_segment", "rank", "--evaluate", str(posed), "--json"]
    command += ["--learned", str(characters.LEARNED), "--frames", str(characters.LEARNED + characters.UNSEEN)]
    command += ["--picture", str(output / "retrieval_characters.png")]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=characters.one_thread())
    result = json.loads(done.stdout)
    verdicts = {verdict: (counted["right"], counted["wrong"]) for verdict, counted in result["verdicts"].items()}
    return Retrieval(result["classes"], np.array(result["confusion"]), verdicts)


def picture(found: Retrieval, path: Path) -> None:
    """Write a picture of the confusion matrix."""
    from wks_segment.blender.render.confusion_matrix import render_matrix

    render_matrix(found, path)
    print(f"\npicture: {path}", flush=True)


def report(title: str, found: Retrieval) -> None:
    """Print the confusion matrix, the share of right answers, and the verdicts."""
    print(f"\n| {title}: queries of | {' | '.join(found.names)} |\n|{'---|' * (len(found.names) + 1)}")
    for name, row in zip(found.names, found.confusion, strict=True):
        print(table_row([name, *map(str, row)]))
    print(f"\nright: {found.right} of {found.asked} ({found.rate:.1%})")
    counted = ((verdict, *found.verdicts[verdict]) for verdict in VERDICTS)
    print("; ".join(f"{verdict}: {right} right, {wrong} wrong" for verdict, right, wrong in counted), flush=True)
