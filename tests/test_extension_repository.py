"""The extension repository of `make repository`: what it contains, and faults that are found.

`tests/window/test_repository.py` installs and updates from one in a real Blender.
"""

import json
import re
import tomllib
import zipfile
from pathlib import Path

import pytest

from scripts import build_repository, build_zip

pytest.importorskip("bpy", reason="Blender's generator is in the bpy wheel")
ROOT = Path(__file__).resolve().parents[1]
MANIFEST = (ROOT / build_zip.MANIFEST).read_text(encoding="utf-8")
VERSION = tomllib.loads(MANIFEST)["version"]


def write_zip(folder, platform, version=VERSION, manifest=MANIFEST):
    """Write a ZIP with the manifest of the extension and no code."""
    text = re.sub(r"platforms = .*", f'platforms = ["{platform}"]', manifest)
    path = folder / f"wks_segment-{version}-{platform}.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("__init__.py", "")
        archive.writestr(build_zip.MANIFEST, re.sub(r'\nversion = ".*"', f'\nversion = "{version}"', text))
    return path


@pytest.fixture
def zips(tmp_path):
    return [write_zip(tmp_path, platform) for platform in build_zip.TARGETS]


def test_all_platforms_are_listed(zips, tmp_path):
    output = tmp_path / "public"
    assert build_repository.main(["--zips", *map(str, zips), "--output", str(output)]) == 0
    listed = json.loads((output / "index.json").read_text(encoding="utf-8"))["data"]
    assert sorted(platform for entry in listed for platform in entry["platforms"]) == sorted(build_zip.TARGETS)
    assert {(entry["id"], entry["version"]) for entry in listed} == {("wks_segment", VERSION)}
    assert {entry["archive_url"] for entry in listed} == {f"./{path.name}" for path in zips}
    page = (output / "index.html").read_text(encoding="utf-8")
    assert "Add Remote" in page
    for path in zips:
        assert f"./{path.name}?repository=" in page, "Blender takes what is dragged into its window by this address"
    assert sorted(tmp_path.iterdir()) == sorted([*zips, output]), "something temporary is left"


def test_a_new_version_replaces_the_old_one(zips, tmp_path):
    output = tmp_path / "public"
    build_repository.make_repository(zips, output)
    newer = write_zip(tmp_path, "linux-x64", "9.9.9")
    build_repository.make_repository([newer], output)
    assert sorted(path.name for path in output.iterdir()) == ["index.html", "index.json", newer.name]


def test_two_versions_are_refused_and_nothing_is_replaced(zips, tmp_path, capsys):
    output = tmp_path / "public"
    build_repository.make_repository(zips, output)
    before = {path.name: path.read_bytes() for path in output.iterdir()}
    both = [*zips, write_zip(tmp_path, "linux-x64", "9.9.9")]
    assert build_repository.main(["--zips", *map(str, both), "--output", str(output)]) == 1
    told = capsys.readouterr().err
    assert "are both for linux-x64" in told
    assert f"not of {VERSION}, 9.9.9" in told
    assert {path.name: path.read_bytes() for path in output.iterdir()} == before


def test_a_zip_that_cannot_be_read_is_named(zips, tmp_path, capsys):
    broken = tmp_path / "wks_segment-broken.zip"
    broken.write_bytes(b"PK")
    assert build_repository.main(["--zips", str(zips[0]), str(broken), "--output", str(tmp_path / "public")]) == 1
    assert broken.name in capsys.readouterr().err
    assert not (tmp_path / "public").exists()


def test_a_folder_of_something_else_is_left_alone(zips, tmp_path, capsys):
    other = tmp_path / "photos"
    other.mkdir()
    (other / "cat.png").write_bytes(b"cat")
    assert build_repository.main(["--zips", str(zips[0]), "--output", str(other)]) == 1
    assert "is no extension repository" in capsys.readouterr().err
    assert [path.name for path in other.iterdir()] == ["cat.png"]


def test_one_version_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    package = re.search(r'__version__ = "(.*)"', (ROOT / "wks_segment" / "__init__.py").read_text(encoding="utf-8"))
    changes = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert VERSION == project == package[1] == changes[1]
