"""Build the extension: one ZIP for each platform, with every wheel that Blender does not bring itself.

    python scripts/build_zip.py                                     # all platforms, Python 3.11 and 3.13
    python scripts/build_zip.py --platform linux-x64 --python 3.11  # one of them, while developing

pip downloads unmodified wheels to `wheels/`. Wheels that are there already are kept, so a second run needs no network.
Blender's own builder, found inside the `bpy` wheel, packs a clean copy of the extension. A ZIP is moved to the output
folder only if `zip_faults` finds no fault in it.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import posixpath
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "wks_segment"
MANIFEST = "blender_manifest.toml"

# Wheels compiled for one version of Python. They contain no NumPy and run on the one that Blender has.
COMPILED = {
    "3.11": {"scipy": "1.15.3", "scikit_learn": "1.7.2"},  # Blender 4.2 to 5.0, NumPy 1.24 to 1.26
    "3.13": {"scipy": "1.15.3", "scikit_learn": "1.7.2"},  # Blender 5.1 and later, NumPy 2
    "3.14": {"scipy": "1.17.1", "scikit_learn": "1.7.2"},  # built by Linux distributions; 1.15 has no wheel
}
# Wheels that suit every Python: pure ones, and psutil, which is compiled for the stable ABI. Only one version of each
# may be in a ZIP, since Blender would unpack only the newer of two. None of them needs a further package; joblib 1.6
# would need cloudpickle.
ANY_PYTHON = {"joblib": "1.5.2", "threadpoolctl": "3.6.0", "psutil": "7.2.2"}
DEFAULT_PYTHONS = ("3.11", "3.13")


class Target(NamedTuple):
    """A platform of Blender: the platform tags to ask pip for, and a pattern of all tags that run on it."""

    pip_tags: tuple[str, ...]
    accepts: str


# Blender ignores the version in a platform tag: it would unpack a wheel for a newer macOS or glibc, which then fails to
# load. The limits are macOS 12, the oldest for which SciPy has arm64 wheels, and glibc 2.28, that of official Blender.
TARGETS = {
    "windows-x64": Target(("win_amd64",), r"win_amd64"),
    "macos-arm64": Target(("macosx_12_0_arm64",), r"macosx_1[0-2]_\d+_(arm64|universal2)"),
    "macos-x64": Target(("macosx_12_0_x86_64",), r"macosx_1[0-2]_\d+_(x86_64|universal2)"),
    "linux-x64": Target(
        tuple(f"manylinux{version}_x86_64" for version in ("_2_28", "_2_27", "_2_17", "2014")),
        r"manylinux(1|2010|2014|_2_(\d|1\d|2[0-8]))_x86_64",
    ),
}

README = "README.md"
MODELS = f"{PACKAGE}/models/"
REQUIRED_FILES = ("__init__.py", MANIFEST, "LICENSE")
FILE_TYPES = {".py", ".toml", ".md", ".whl", ".json", ".npz", ".png", ".svg", ".typed"}
FORBIDDEN_FOLDERS = {"__pycache__", "test", "tests"}


class BuildError(Exception):
    """The build cannot go on; the message is shown to the person who started it."""


class Wheel(NamedTuple):
    """Fields of the file name of a wheel: `name-version(-build)-python-abi-platform.whl`."""

    name: str
    python: str
    abi: str
    platform: str

    @classmethod
    def parse(cls, filename: str) -> Wheel:
        """Split a file name; a malformed one gives a wheel that suits no platform."""
        parts = posixpath.basename(filename).removesuffix(".whl").split("-")
        return cls(parts[0].lower(), *["", "", "", *parts][-3:])

    def suits(self, platform: str, python: str) -> bool:
        """Whether Blender on this platform, with this Python, can load the wheel."""
        accepts = TARGETS[platform].accepts
        return self._suits_python(python) and (
            self.platform == "any" or any(re.fullmatch(accepts, tag) for tag in self.platform.split("."))
        )

    def _suits_python(self, python: str) -> bool:
        if self.abi == "abi3":  # from that version on
            oldest = re.fullmatch(r"cp3(\d+)", self.python)
            return oldest is not None and int(oldest[1]) <= int(python.removeprefix("3."))
        return "py3" in self.python.split(".") or self.python == self.abi == "cp" + python.replace(".", "")


def find_wheel(folder: Path, name: str, version: str, platform: str, python: str) -> Path | None:
    """The wheel of this version in `folder` for a platform and a Python; None if there is none."""
    candidates = sorted(folder.glob(f"{name}-{version}-*.whl"))
    return next((path for path in candidates if Wheel.parse(path.name).suits(platform, python)), None)


def download_wheel(folder: Path, name: str, version: str, platform: str, python: str) -> Path:
    """Download a wheel with pip, for a platform and a Python that need not be the running ones."""
    print(f"downloading {name} {version} for {platform}, Python {python}", flush=True)
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
    command += ["--python-version", python, "--dest", str(folder), f"{name}=={version}"]
    for tag in TARGETS[platform].pip_tags:
        command += ["--platform", tag]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wheel = None if done.returncode else find_wheel(folder, name, version, platform, python)
    if wheel is None:
        raise BuildError(f"pip found no {name} {version} for {platform}, Python {python}:\n{done.stderr}")
    return wheel


def gather_wheels(folder: Path, platform: str, pythons: Sequence[str]) -> list[Path]:
    """All wheels for one platform; those that `folder` lacks are downloaded."""
    folder.mkdir(parents=True, exist_ok=True)
    wheels = set()
    for python in pythons:
        for name, version in (COMPILED[python] | ANY_PYTHON).items():
            pin = (folder, name, version, platform, python)
            wheels.add(find_wheel(*pin) or download_wheel(*pin))
    return sorted(wheels)


def manifest_with_wheels(text: str, platform: str, wheels: Sequence[Path]) -> str:
    """The text of the manifest for one platform, with the list of wheels after its `platforms` line."""
    listed = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    entry = f'platforms = ["{platform}"]\nwheels = [\n{listed}]'
    text, count = re.subn(r"^platforms\s*=\s*\[[^\]]*\]", lambda _: entry, text, flags=re.MULTILINE)
    if count != 1:
        raise BuildError(f"{MANIFEST} must have one line `platforms = [...]`, not {count}")
    return text


def readme_alone(text: str, folder: Path) -> str:
    """A text in Markdown without pictures and links of files that are not in its folder; the words of links stay."""

    def word(match: re.Match[str]) -> str:
        is_picture, words, place = match.groups()
        if re.match(r"[a-z]+:|#", place) or (folder / place.partition("#")[0]).exists():
            return match[0]
        return "" if is_picture else words

    text = re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", word, text)
    return re.sub(r"\n{3,}", "\n\n", text)


def stage(source: Path, target: Path, platform: str, wheels: Sequence[Path]) -> None:
    """Copy the files that belong in the ZIP to an empty folder, so that nothing else of the checkout is packed."""
    ignore = shutil.ignore_patterns("__pycache__", "*.py[cod]", ".*")
    shutil.copytree(source / PACKAGE, target / PACKAGE, ignore=ignore)
    for name in (*REQUIRED_FILES, README):
        if (source / name).exists():
            shutil.copy2(source / name, target / name)
    if (target / README).exists():
        text = readme_alone((target / README).read_text(encoding="utf-8"), target)
        (target / README).write_text(text, encoding="utf-8")
    (target / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy2(wheel, target / "wheels" / wheel.name)
    text = (source / MANIFEST).read_text(encoding="utf-8")
    (target / MANIFEST).write_text(manifest_with_wheels(text, platform, wheels), encoding="utf-8")


def run_blender_builder(*arguments: str) -> None:
    """Run Blender's `extension` command, a plain script inside the `bpy` wheel, without importing bpy."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None or bpy.origin is None:
        raise BuildError("Blender's builder is missing: install the `bpy` wheel that pyproject.toml names")
    script = next(Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    command = [sys.executable, str(script), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(f"Blender's builder refused the extension:\n{done.stdout}{done.stderr}")


def zip_faults(path: Path, platform: str, pythons: Sequence[str]) -> list[str]:
    """Everything that is wrong with a ZIP for `platform` and `pythons`, one sentence each."""
    with zipfile.ZipFile(path) as archive:
        files = [name for name in archive.namelist() if not name.endswith("/")]
        if MANIFEST not in files:
            return [f"{MANIFEST} is missing"]
        manifest = tomllib.loads(archive.read(MANIFEST).decode("utf-8"))
    packed = {name for name in files if name.endswith(".whl")}
    listed = {posixpath.normpath(name) for name in manifest.get("wheels", [])}
    faults = [f"the manifest lists {name}, which is not in the ZIP" for name in sorted(listed - packed)]
    faults += [f"the ZIP contains {name}, which the manifest does not list" for name in sorted(packed - listed)]
    if manifest.get("platforms") != [platform]:
        faults.append(f"the manifest's platforms are {manifest.get('platforms')}, not ['{platform}']")
    return faults + wheel_faults(sorted(packed), platform, pythons) + file_faults(files)


def wheel_faults(filenames: Sequence[str], platform: str, pythons: Sequence[str]) -> list[str]:
    """Wheels that are missing, superfluous or there twice: each Python needs exactly one wheel of each package."""
    faults = []
    wheels = {filename: Wheel.parse(filename) for filename in filenames}
    for filename, wheel in wheels.items():
        if wheel.name == "numpy":
            faults.append(f"{filename} would replace Blender's own NumPy for every add-on")
        if not any(wheel.suits(platform, python) for python in pythons):
            faults.append(f"{filename} does not suit {platform} with Python {', '.join(pythons)}")
    for python in pythons:
        counts = Counter(wheel.name for wheel in wheels.values() if wheel.suits(platform, python))
        for name in sorted(counts.keys() | COMPILED[python].keys() | ANY_PYTHON.keys()):
            if counts[name] == 0:
                faults.append(f"no wheel of {name} for {platform}, Python {python}")
            if counts[name] > 1:
                faults.append(f"{counts[name]} wheels of {name} suit {platform}, Python {python}: keep one")
    return faults


def file_faults(files: Sequence[str]) -> list[str]:
    """Required files that are missing, and files that do not belong in the ZIP."""
    faults = [f"{name} is missing" for name in REQUIRED_FILES if name not in files]
    if not any(name.startswith(MODELS) and name.endswith(".json") for name in files):
        faults.append(f"there is no starter model in {MODELS}")
    for path in map(PurePosixPath, sorted(files)):
        if FORBIDDEN_FOLDERS & set(path.parts[:-1]):
            faults.append(f"{path} does not belong in the ZIP")
        elif path.suffix not in FILE_TYPES and str(path) not in REQUIRED_FILES:
            faults.append(f"{path} has a type that is not in FILE_TYPES")
    return faults


def build_zip(source: Path, wheel_folder: Path, output: Path, platform: str, pythons: Sequence[str]) -> Path:
    """Build and check the ZIP for one platform; return its path in the output folder."""
    wheels = gather_wheels(wheel_folder, platform, pythons)
    version = tomllib.loads((source / MANIFEST).read_text(encoding="utf-8"))["version"]
    with tempfile.TemporaryDirectory() as folder:
        staged, packed = Path(folder, "extension"), Path(folder, f"{PACKAGE}-{version}-{platform}.zip")
        stage(source, staged, platform, wheels)
        run_blender_builder("validate", str(staged))
        run_blender_builder("build", "--source-dir", str(staged), "--output-filepath", str(packed))
        faults = zip_faults(packed, platform, pythons)
        if faults:
            raise BuildError(f"{packed.name} has faults:\n  " + "\n  ".join(faults))
        output.mkdir(parents=True, exist_ok=True)
        return Path(shutil.move(packed, output / packed.name))


def table_row(path: Path, platform: str, pythons: Sequence[str]) -> str:
    """Line of the table that is printed at the end: size, wheels and checksum of a ZIP."""
    with zipfile.ZipFile(path) as archive:
        n_wheels = sum(name.endswith(".whl") for name in archive.namelist())
    size, digest = path.stat().st_size / 1e6, hashlib.sha256(path.read_bytes()).hexdigest()
    return f"{path.name:40} {platform:12} {' '.join(pythons):15} {n_wheels:6} {size:7.1f}  {digest[:12]}"


def parse_arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Build the ZIPs of the extension, one for each platform.")
    parser.add_argument(
        "--platform", nargs="+", choices=TARGETS, help="platforms to build for (default: all in the manifest)"
    )
    parser.add_argument(
        "--python", nargs="+", choices=COMPILED, default=DEFAULT_PYTHONS, help="Python versions to pack wheels for"
    )
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder to write the ZIPs to")
    parser.add_argument("--source", type=Path, default=ROOT, help="folder with the manifest")
    parser.add_argument("--wheels", type=Path, default=ROOT / "wheels", help="folder for downloaded wheels")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    arguments = parse_arguments(argv)
    manifest = tomllib.loads((arguments.source / MANIFEST).read_text(encoding="utf-8"))
    platforms, pythons = arguments.platform or manifest["platforms"], arguments.python
    rows = []
    try:
        if unknown := set(platforms) - TARGETS.keys():
            raise BuildError(f"TARGETS has no entry for {', '.join(sorted(unknown))}")
        for platform in platforms:
            path = build_zip(arguments.source, arguments.wheels, arguments.output, platform, pythons)
            rows.append(table_row(path, platform, pythons))
    except BuildError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{'zip':40} {'platform':12} {'Pythons':15} {'wheels':>6} {'MB':>7}  sha256", *rows, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
