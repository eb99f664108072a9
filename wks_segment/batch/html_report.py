"""The report of a batch: a page that a browser shows, failures first."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path
from urllib.parse import quote

from .job import Outcome

NAME = "report.html"
THUMBNAIL = ".png"
STYLE = """
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


def write_page(folder: Path, outcomes: Iterable[Outcome], planned: int, title: str = "WKS Segment: a batch") -> Path:
    """Write the report of a batch into its folder, with links relative to it.

    Parameters
    ----------
    folder : path
    outcomes
    planned : int
        Files of the batch, with those of which there is no outcome yet.
    """
    known = sorted(outcomes, key=lambda outcome: outcome.name.casefold())
    failed, done = [each for each in known if not each.done], [each for each in known if each.done]
    missing = planned - len(known)
    summary = f"{len(done)} of {planned} files done, {len(failed)} failed" + (
        f", {missing} to do" if missing > 0 else ""
    )
    text = "\n".join([
        "<!doctype html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<style>{STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1><p>{escape(summary)}</p>",
        *_failures(failed),
        "<h2>Done</h2><main>" if done else "<main>",
        *map(_figure, done),
        "</main></body></html>",
    ])  # fmt: skip
    path = folder / NAME
    unfinished = path.with_suffix(".part")
    unfinished.write_text(text, encoding="utf-8")
    unfinished.replace(path)
    return path


def _failures(failed: list[Outcome]) -> Iterable[str]:
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
    files = list(outcome.outputs.values())
    picture = next((file for file in files if file.endswith(THUMBNAIL)), None)
    shown = "" if picture is None else f'<img loading="lazy" src="{quote(picture)}" alt="{escape(outcome.name)}">'
    links = [f'<a href="{quote(file)}">{escape(file)}</a>' for file in files if file != picture]
    said = [f"{outcome.result['segments']} segments"] if "segments" in outcome.result else []
    said += [f"{len(poses)} pose{'s' * (len(poses) != 1)}"] if (poses := outcome.result.get("poses")) else []
    said += [f"best model: {outcome.result['best']}"] if outcome.result.get("best") else []
    said += [str(ranking.get("says")) for ranking in outcome.result.get("rankings", ())]
    said += [f"{outcome.seconds:.1f} seconds"]
    warnings = [
        f'<br><small class="warning">{escape(str(each))}</small>' for each in outcome.result.get("warnings", ())
    ]
    return (
        f'<figure>{shown}<figcaption><strong title="{escape(outcome.input)}">{escape(outcome.name)}</strong><br>'
        f"<small>{escape(', '.join(said))}</small><br>{'<br>'.join(links)}{''.join(warnings)}</figcaption></figure>"
    )
