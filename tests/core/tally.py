"""Counts the examples of property-based tests and their outcomes, for the summary of a run."""

from collections import Counter, defaultdict

OUTCOMES = defaultdict(Counter)


def count(kind, names, outcome):
    """Count an example: its kind ("mesh"), the names of its defects, and its outcome ("labeled")."""
    for name in ("all", *dict.fromkeys(names)):
        OUTCOMES[kind, name][outcome] += 1


def counted():
    """All counts, as lists that one process can send to another."""
    return [[*names, outcome, n] for names, counter in OUTCOMES.items() for outcome, n in counter.items()]


def add(counts):
    """The counts of another process."""
    for what, name, outcome, n in counts:
        OUTCOMES[what, name][outcome] += n


def table():
    """Lines of Markdown tables; none if nothing was counted."""
    lines = []
    for kind in dict.fromkeys(kind for kind, _ in OUTCOMES):
        rows = {name: counter for (of, name), counter in OUTCOMES.items() if of == kind}
        outcomes = sorted({outcome for counter in rows.values() for outcome in counter})
        lines += ["", f"| {kind} | tried | " + " | ".join(outcomes) + " |", "|---|" + "---|" * (1 + len(outcomes))]
        for name, counter in sorted(rows.items(), key=lambda row: (row[0] != "all", row[0])):
            cells = (str(counter[outcome]) for outcome in outcomes)
            lines.append(f"| {name.replace('_', ' ')} | {counter.total()} | " + " | ".join(cells) + " |")
    return lines
