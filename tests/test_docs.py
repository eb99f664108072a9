"""README, docs and what belongs to them: lengths, links, pictures, figures and versions."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from scripts import build_zip

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "tests/window/README.md")),
    *sorted(DOCS.rglob("*.md")),
    *sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.md")),
]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FIGURES = {
    "characters.md": ("| **0.987** |", "| 0.965 |"),
    "quality.md": ("0.959 (0.937)", "**0.096**", "0.085"),
    "speed.md": ("| even | 20,000 | fast | 0.77 |", "| even | 1,000,000 | fast | 14.10 | – | 15.36 | 903 |"),
}
"""Lines of the docs whose figures are in the README: change both together."""
IN_README = ("98.7 %", "96.5 %", "95.9 %", "93.7 %", "0.096", "0.085", "0.8 s", "15 s", "1 GB")
PANEL = ("main_panel.py", "segments_panel.py", "models_panel.py")
"""Files that say what the panel shows."""
PICTURES_OF_THE_PANEL = ("panel.png", "panel_outputs.png")


def text_of(path):
    """A page without its code, where brackets are no links."""
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(path):
    """Anchors of the headings of a page, as mkdocs makes them."""
    headings = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_link_is_dead(page):
    for link in LINK.findall(text_of(page)):
        if re.match(r"[a-z]+:", link):
            continue
        place, _, anchor = link.partition("#")
        target = page.parent / place if place else page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_tests_that_are_named_exist(page):
    tests = {path.name for path in (ROOT / "tests").rglob("test_*.py")}
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r"\btest_\w+\.py\b", text)) <= tests
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    assert set(re.findall(r"`(test_\w+)`", text)) <= set(re.findall(r"^def (test_\w+)", code, re.MULTILINE))
    # Kinds of damage are named in brackets behind the test of them.
    named = [each for listed in re.findall(r"`test_any_mesh\.py` \(([^)]*)\)", text) for each in listed.split(", ")]
    defects = (ROOT / "tests/core/defects.py").read_text(encoding="utf-8")
    assert [each for each in named if not re.search(rf"^def {each}\(", defects, re.MULTILINE)] == []


LIST_WITHOUT_SPACE = re.compile(r"^(?![-#\s]|\d+\. ).+\n(?:- |1\. ).*", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_lists_are_lists(page):
    """mkdocs takes a list right below a paragraph for more of the paragraph; GitHub does not."""
    assert LIST_WITHOUT_SPACE.findall(text_of(page)) == []


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 90


def test_the_figures_of_the_readme_are_those_of_the_docs():
    readme = re.sub(r"\s+", " ", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert [figure for figure in IN_README if figure not in readme] == []
    for name, figures in FIGURES.items():
        page = (DOCS / name).read_text(encoding="utf-8")
        assert [figure for figure in figures if figure not in page] == []


def test_the_commands_of_the_readme_exist():
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    used = re.findall(r"\bmake\s+([a-z-]+)", (ROOT / "README.md").read_text(encoding="utf-8").replace("`make` ", ""))
    assert {"demo", "docs", "lint", "repository", "test", "zip"} <= set(used)
    assert set(used) <= set(targets)


def test_every_page_and_picture_is_shown():
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = sorted(DOCS.rglob("*.md"))
    assert [page.name for page in pages if f": {page.relative_to(DOCS).as_posix()}\n" not in site] == []
    everything = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    pictures = [path.name for path in (DOCS / "images").iterdir()]
    assert [name for name in pictures if f"images/{name})" not in everything] == []


def test_the_looping_picture_is_small():
    assert (DOCS / "images" / "walk.gif").stat().st_size < 3e6


def git(*arguments):
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("picture", PICTURES_OF_THE_PANEL)
def test_no_picture_is_older_than_the_panel_that_it_shows(picture):
    """`make screenshots` takes them again."""
    if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        pytest.skip("the history is not known here")
    panel, shown = (
        git("log", "-1", "--format=%H", "--", *paths).stdout.strip()
        for paths in ([f"wks_segment/blender/ui/{name}" for name in PANEL], [f"docs/images/{picture}"])
    )
    assert panel
    assert shown, f"{picture} is not committed"
    older = shown != panel and git("merge-base", "--is-ancestor", shown, panel).returncode == 0
    assert not older, f"{picture} of {shown[:8]} is older than the panel of {panel[:8]}: make screenshots"


def test_sizes_and_licenses_of_the_zips_are_told():
    page = (DOCS / "install.md").read_text(encoding="utf-8")
    version = tomllib.loads((ROOT / build_zip.MANIFEST).read_text(encoding="utf-8"))["version"]
    assert f"| zip of {version} | MB |" in page
    for platform in build_zip.TARGETS:
        assert re.search(rf"\| `{platform}` \| \d+\.\d \|", page)
    wheels = {name for wheels in (*build_zip.COMPILED.values(), build_zip.ANY_PYTHON) for name in wheels}
    named = {name.lower().replace("-", "_") for name in re.findall(r"^\| (\S+) \| [^|]+ \| BSD", page, re.MULTILINE)}
    assert named == wheels


def test_the_citation_has_the_version():
    version = tomllib.loads((ROOT / build_zip.MANIFEST).read_text(encoding="utf-8"))["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
