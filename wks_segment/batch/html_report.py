"""Report of a batch: an HTML page, failures first."""

from __future__ import annotations

import os
from collections.abc import Iterable
from html import escape
from pathlib import Path
from urllib.parse import quote

from ..core.files.whole_file import write_whole
from .job import Outcome

REPORT_NAME = "report.html"
THUMBNAIL_SUFFIX = ".png"
STYLE_SHEET = """
:root { color-scheme: light dark; font: 15px/1.45 system-ui, sans-serif; }
body { max-width: 80rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .35rem .6rem; border-bottom: 1px solid #8884; }
.failed td:first-child { border-left: 4px solid #c33; }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 1rem; }
figure { margin: 0; border: 1px solid #8884; border-radius: 6px; overflow: hidden; }
figure img { width: 100%; display: block; background: #d0d0d4; aspect-ratio: 4 / 3; object-fit: contain; }
figcaption { padding: .5rem .7rem; overflow-wrap: anywhere; }
small { opacity: .75; }
.warning { color: #b60; }
"""


def write_report(folder: Path, outcomes: Iterable[Outcome], n_files: int, title: str = "WKS Segment: a batch") -> Path:
    """Write the report of a batch to its folder, with links relative to it; return its path.

    Parameters
    ----------
    folder : path
    outcomes
    n_files : int
        Number of files of the batch, including those that have no outcome yet.
    title : str
    """
    outcomes = sorted(outcomes, key=lambda outcome: outcome.name.casefold())
    failed = [outcome for outcome in outcomes if not outcome.done]
    done = [outcome for outcome in outcomes if outcome.done]
    n_missing = n_files - len(outcomes)
    summary = f"{len(done)} of {n_files} files done, {len(failed)} failed"
    if n_missing > 0:
        summary += f", {n_missing} to do"
    text = "\n".join([
        "<!doctype html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<style>{STYLE_SHEET}</style></head><body>",
        f"<h1>{escape(title)}</h1><p>{escape(summary)}</p>",
        *_table_of_failures(failed),
        "<h2>Done</h2><main>" if done else "<main>",
        *map(_figure, done),
        "</main></body></html>",
    ])  # fmt: skip
    path = folder / REPORT_NAME
    write_whole(path, text.encode(errors="backslashreplace"))  # names of files that are not UTF-8
    return path


def _table_of_failures(failed: list[Outcome]) -> Iterable[str]:
    if not failed:
        return
    yield '<h2>Failed</h2><table class="failed"><tr><th>file</th><th>why</th><th>seconds</th></tr>'
    for outcome in failed:
        yield (
            f'<tr><td title="{escape(outcome.input)}">{escape(outcome.name)}</td><td>{escape(outcome.reason)}</td>'
            f"<td>{outcome.seconds:.1f}</td></tr>"
        )
    yield "</table>"


def _figure(outcome: Outcome) -> str:
    """Thumbnail of a file with its name, links, facts and warnings."""
    files = list(outcome.outputs.values())
    picture = next((file for file in files if file.endswith(THUMBNAIL_SUFFIX)), None)
    image = (
        ""
        if picture is None
        else f'<img loading="lazy" src="{quote(os.fsencode(picture))}" alt="{escape(outcome.name)}">'
    )
    links = [f'<a href="{quote(os.fsencode(file))}">{escape(file)}</a>' for file in files if file != picture]
    facts = [f"{outcome.result['segments']} segments"] if "segments" in outcome.result else []
    facts += [f"{len(poses)} pose{'s' * (len(poses) != 1)}"] if (poses := outcome.result.get("poses")) else []
    facts += [f"best model: {outcome.result['best']}"] if outcome.result.get("best") else []
    facts += [str(ranking.get("says")) for ranking in outcome.result.get("rankings", ())]
    facts += [f"{outcome.seconds:.1f} seconds"]
    warnings = [
        f'<br><small class="warning">{escape(str(warning))}</small>' for warning in outcome.result.get("warnings", ())
    ]
    return (
        f'<figure>{image}<figcaption><strong title="{escape(outcome.input)}">{escape(outcome.name)}</strong><br>'
        f"<small>{escape(', '.join(facts))}</small><br>{'<br>'.join(links)}{''.join(warnings)}</figcaption></figure>"
    )
