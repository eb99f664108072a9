"""Make an extension repository: a folder that any web server can serve, from which Blender installs and updates.

    python -m scripts.build_repository                                    # build all ZIPs first, in dist/
    python -m scripts.build_repository --zips dist/*.zip --output public  # of ZIPs that are there

Users add the address of its `index.json` once, in *Get Extensions > Repositories*. Blender's own `server-generate`
writes `index.json` and `index.html`, the latter from `scripts/repository.html`. A folder that is there already is
replaced, but only if it is such a repository, and only when the new one is complete.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

from scripts import build_zip

TEMPLATE = build_zip.ROOT / "scripts" / "repository.html"
INDEX = "index.json"


def make_repository(zips: Sequence[Path], output: Path) -> None:
    """Write a repository of these ZIPs to the folder `output`; BuildError if it cannot be done."""
    if output.exists() and any(output.iterdir()) and not (output / INDEX).is_file():
        raise build_zip.BuildError(f"{output} is no extension repository: name an empty or a new folder")
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".repository-") as folder:
        made = Path(folder, "made")
        made.mkdir()
        for path in zips:
            shutil.copy2(path, made / path.name)
        build_zip.run_blender_builder(
            "server-generate", "--repo-dir", str(made), "--html", "--html-template", str(TEMPLATE)
        )
        if faults := repository_faults(made):
            raise build_zip.BuildError("the repository has faults:\n  " + "\n  ".join(faults))
        if output.exists():
            output.rename(Path(folder, "before"))
        made.rename(output)


def repository_faults(folder: Path) -> list[str]:
    """What is wrong with a repository: Blender's generator leaves out ZIPs that it cannot read, and says nothing."""
    listed = json.loads((folder / INDEX).read_text(encoding="utf-8"))["data"]
    zips = {path.name: path for path in folder.glob("*.zip")}
    names = [entry["archive_url"].removeprefix("./") for entry in listed]
    faults = [f"{name} is not listed" for name in sorted(zips.keys() - set(names))]
    platforms: dict[str, str] = {}
    for name in sorted(names):
        for platform in _platforms(zips[name]):
            if platform in platforms:
                faults.append(f"{name} and {platforms[platform]} are both for {platform}: keep one")
            platforms[platform] = name
    versions = {entry["version"] for entry in listed}
    if len(versions) != 1:
        faults.append(f"there must be ZIPs of one version, not of {', '.join(sorted(versions)) or 'none'}")
    return faults


def _platforms(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        manifest = tomllib.loads(archive.read(build_zip.MANIFEST).decode("utf-8"))
    return manifest.get("platforms", ["all platforms"])


def parse_arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Make an extension repository that any web server can serve.")
    parser.add_argument("--zips", nargs="+", type=Path, help="ZIPs to offer (default: all platforms are built)")
    parser.add_argument("--output", type=Path, default=build_zip.ROOT / "repository", help="folder to write")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    arguments = parse_arguments(argv)
    try:
        zips = arguments.zips or build_all()
        make_repository(zips, arguments.output)
    except (build_zip.BuildError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.output}: {len(zips)} ZIPs, {INDEX}, index.html")
    print(f"to try it: python -m http.server --directory {arguments.output}")
    return 0


def build_all() -> list[Path]:
    """The ZIPs of this version for all platforms, built in `dist/`."""
    with tempfile.TemporaryDirectory() as folder:
        if build_zip.main(["--output", folder]):
            raise build_zip.BuildError("the ZIPs could not be built, see above")
        dist = build_zip.ROOT / "dist"
        dist.mkdir(exist_ok=True)
        return [Path(shutil.move(path, dist / path.name)) for path in sorted(Path(folder).glob("*.zip"))]


if __name__ == "__main__":
    sys.exit(main())
