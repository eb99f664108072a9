"""Build the extension: one ZIP a platform, each with every wheel that Blender does not bring itself.

    python scripts/build_zip.py                                     # all platforms, Python 3.11 and 3.13
    python scripts/build_zip.py --platform linux-x64 --python 3.11  # one of them, while developing

pip gathers unmodified wheels in `wheels/` and leaves alone what is already there, so that a second run needs
no network. Blender's own builder, found inside the `bpy` wheel, packs a clean copy of the extension.
`zip_faults` has the last word: only a ZIP without a fault reaches the output folder.
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

# Compiled wheels of each Python. None brings NumPy: they run on the one that Blender has.
COMPILED = {
    "3.11": {"scipy": "1.15.3", "scikit_learn": "1.7.2"},  # Blender 4.2 to 5.0, NumPy 1.24 to 1.26
    "3.13": {"scipy": "1.15.3", "scikit_learn": "1.7.2"},  # Blender 5.1 and later, NumPy 2
    "3.14": {"scipy": "1.17.1", "scikit_learn": "1.7.2"},  # built by Linux distributions; 1.15 has no wheel
}
# Pure Python wheels suit every Python: of two versions in one ZIP, Blender would unpack only the newer.
# Neither version needs a further package; joblib 1.6 would need cloudpickle.
PURE = {"joblib": "1.5.2", "threadpoolctl": "3.6.0"}
DEFAULT_PYTHONS = ("3.11", "3.13")


class Target(NamedTuple):
    """A platform of Blender: the tags to ask pip for, and the pattern of the tags that run on it."""

    pip_tags: tuple[str, ...]
    accepts: str


# Blender ignores the version in a tag, so wheels for a newer macOS or glibc would be unpacked and then fail
# to load. These limits are the lowest that SciPy's arm64 wheels know, and the glibc of official Blender.
TARGETS = {
    "windows-x64": Target(("win_amd64",), r"win_amd64"),
    "macos-arm64": Target(("macosx_12_0_arm64",), r"macosx_1[0-2]_\d+_(arm64|universal2)"),
    "macos-x64": Target(("macosx_12_0_x86_64",), r"macosx_1[0-2]_\d+_(x86_64|universal2)"),
    "linux-x64": Target(
        tuple(f"manylinux{version}_x86_64" for version in ("_2_28", "_2_27", "_2_17", "2014")),
        r"manylinux(1|2010|2014|_2_(\d|1\d|2[0-8]))_x86_64",
    ),
}

REQUIRED_FILES = ("__init__.py", MANIFEST, "LICENSE")
FILE_TYPES = {".py", ".toml", ".md", ".whl", ".json", ".npz", ".png", ".svg", ".typed"}
FORBIDDEN_FOLDERS = {"__pycache__", "test", "tests"}


class BuildError(Exception):
    """What stopped the build, worded for the person who started it."""


class Wheel(NamedTuple):
    """What the file name of a wheel says: `name-version(-build)-python-abi-platform.whl`."""

    name: str
    python: str
    abi: str
    platform: str

    @classmethod
    def parse(cls, filename: str) -> Wheel:
        """A malformed name gives a wheel that suits nothing."""
        parts = posixpath.basename(filename).removesuffix(".whl").split("-")
        return cls(parts[0].lower(), *["", "", "", *parts][-3:])

    def suits(self, platform: str, python: str) -> bool:
        tag = "cp" + python.replace(".", "")
        right_python = "py3" in self.python.split(".") or self.python == self.abi == tag
        accepts = TARGETS[platform].accepts
        return right_python and (
            self.platform == "any" or any(re.fullmatch(accepts, each) for each in self.platform.split("."))
        )


def find_wheel(folder: Path, name: str, version: str, platform: str, python: str) -> Path | None:
    """The wheel in `folder` that answers the pin, if there is one."""
    candidates = sorted(folder.glob(f"{name}-{version}-*.whl"))
    return next((path for path in candidates if Wheel.parse(path.name).suits(platform, python)), None)


def download_wheel(folder: Path, name: str, version: str, platform: str, python: str) -> Path:
    """Let pip fetch the wheel, for a platform and a Python that need not be the running ones."""
    print(f"downloading {name} {version} for {platform}, Python {python}", flush=True)
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
    command += ["--python-version", python, "--dest", str(folder), f"{name}=={version}"]
    for tag in TARGETS[platform].pip_tags:
        command += ["--platform", tag]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wheel = None if done.returncode else find_wheel(folder, name, version, platform, python)
    if wheel is None:
        raise BuildError(f"pip brought no {name} {version} for {platform}, Python {python}:\n{done.stderr}")
    return wheel


def gather_wheels(folder: Path, platform: str, pythons: Sequence[str]) -> list[Path]:
    """All wheels of one platform, downloaded where `folder` lacks them."""
    folder.mkdir(parents=True, exist_ok=True)
    wheels = set()
    for python in pythons:
        for name, version in (COMPILED[python] | PURE).items():
            pin = (folder, name, version, platform, python)
            wheels.add(find_wheel(*pin) or download_wheel(*pin))
    return sorted(wheels)


def manifest_with_wheels(text: str, platform: str, wheels: Sequence[Path]) -> str:
    """The manifest's text for one platform, its `platforms` line followed by the list of wheels."""
    listed = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    entry = f'platforms = ["{platform}"]\nwheels = [\n{listed}]'
    text, count = re.subn(r"^platforms\s*=\s*\[[^\]]*\]", lambda _: entry, text, flags=re.MULTILINE)
    if count != 1:
        raise BuildError(f"{MANIFEST} must hold one `platforms = [...]`, found {count}")
    return text


def stage(source: Path, target: Path, platform: str, wheels: Sequence[Path]) -> None:
    """Copy what belongs into the ZIP, and nothing else, so that no stray file of a checkout is packed."""
    ignore = shutil.ignore_patterns("__pycache__", "*.py[cod]", ".*")
    shutil.copytree(source / PACKAGE, target / PACKAGE, ignore=ignore)
    for name in (*REQUIRED_FILES, "README.md"):
        if (source / name).exists():
            shutil.copy2(source / name, target / name)
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
    """All that makes a ZIP unfit for `platform` and `pythons`, a sentence each; empty if it is fit."""
    with zipfile.ZipFile(path) as archive:
        files = [name for name in archive.namelist() if not name.endswith("/")]
        if MANIFEST not in files:
            return [f"{MANIFEST} is missing"]
        manifest = tomllib.loads(archive.read(MANIFEST).decode("utf-8"))
    packed = {name for name in files if name.endswith(".whl")}
    listed = {posixpath.normpath(name) for name in manifest.get("wheels", [])}
    faults = [f"the manifest lists {name}, which the ZIP lacks" for name in sorted(listed - packed)]
    faults += [f"the ZIP holds {name}, which the manifest does not list" for name in sorted(packed - listed)]
    if manifest.get("platforms") != [platform]:
        faults.append(f"the manifest's platforms are {manifest.get('platforms')}, not ['{platform}']")
    return faults + wheel_faults(sorted(packed), platform, pythons) + file_faults(files)


def wheel_faults(filenames: Sequence[str], platform: str, pythons: Sequence[str]) -> list[str]:
    """Each Python must find one wheel of each package, and no wheel may be there for anything else."""
    faults = []
    wheels = {filename: Wheel.parse(filename) for filename in filenames}
    for filename, wheel in wheels.items():
        if wheel.name == "numpy":
            faults.append(f"{filename} would replace Blender's own NumPy for every add-on")
        if not any(wheel.suits(platform, python) for python in pythons):
            faults.append(f"{filename} does not suit {platform} with Python {', '.join(pythons)}")
    for python in pythons:
        counts = Counter(wheel.name for wheel in wheels.values() if wheel.suits(platform, python))
        for name in sorted(counts.keys() | COMPILED[python].keys() | PURE.keys()):
            if counts[name] == 0:
                faults.append(f"{platform} lacks a wheel of {name} for Python {python}")
            if counts[name] > 1:
                faults.append(f"{counts[name]} wheels of {name} suit {platform}, Python {python}: keep one")
    return faults


def file_faults(files: Sequence[str]) -> list[str]:
    """Files that must be there and are not, and files that slipped in."""
    faults = [f"{name} is missing" for name in REQUIRED_FILES if name not in files]
    for path in map(PurePosixPath, sorted(files)):
        if FORBIDDEN_FOLDERS & set(path.parts[:-1]):
            faults.append(f"{path} does not belong into a ZIP for artists")
        elif path.suffix not in FILE_TYPES and str(path) not in REQUIRED_FILES:
            faults.append(f"{path} is of a type that FILE_TYPES does not list")
    return faults


def build_zip(source: Path, wheel_folder: Path, output: Path, platform: str, pythons: Sequence[str]) -> Path:
    """Build and check the ZIP of one platform; it is moved to `output` only without a fault."""
    wheels = gather_wheels(wheel_folder, platform, pythons)
    version = tomllib.loads((source / MANIFEST).read_text(encoding="utf-8"))["version"]
    with tempfile.TemporaryDirectory() as folder:
        staged, packed = Path(folder, "extension"), Path(folder, f"{PACKAGE}-{version}-{platform}.zip")
        stage(source, staged, platform, wheels)
        run_blender_builder("validate", str(staged))
        run_blender_builder("build", "--source-dir", str(staged), "--output-filepath", str(packed))
        faults = zip_faults(packed, platform, pythons)
        if faults:
            raise BuildError(f"{packed.name} is not fit to publish:\n  " + "\n  ".join(faults))
        output.mkdir(parents=True, exist_ok=True)
        return Path(shutil.move(packed, output / packed.name))


def table_row(path: Path, platform: str, pythons: Sequence[str]) -> str:
    """One line of the closing table."""
    with zipfile.ZipFile(path) as archive:
        n_wheels = sum(name.endswith(".whl") for name in archive.namelist())
    size, digest = path.stat().st_size / 1e6, hashlib.sha256(path.read_bytes()).hexdigest()
    return f"{path.name:40} {platform:12} {' '.join(pythons):15} {n_wheels:6} {size:7.1f}  {digest[:12]}"


def parse_arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Build the extension's ZIPs, one a platform.")
    parser.add_argument("--platform", nargs="+", choices=TARGETS, help="default: all of the manifest")
    parser.add_argument("--python", nargs="+", choices=COMPILED, default=DEFAULT_PYTHONS)
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder of the ZIPs")
    parser.add_argument("--source", type=Path, default=ROOT, help="folder that holds the manifest")
    parser.add_argument("--wheels", type=Path, default=ROOT / "wheels", help="folder of downloaded wheels")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    arguments = parse_arguments(argv)
    manifest = tomllib.loads((arguments.source / MANIFEST).read_text(encoding="utf-8"))
    platforms, pythons = arguments.platform or manifest["platforms"], arguments.python
    rows = []
    try:
        if unknown := set(platforms) - TARGETS.keys():
            raise BuildError(f"TARGETS does not say which wheels run on {', '.join(sorted(unknown))}")
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
