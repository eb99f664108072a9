"""The ZIP that artists install: faults that `scripts/build_zip.py` must find, and installing, using and removing it.

The install test uses the newest `dist/wks_segment-*-linux-x64.zip`, or the one that WKS_SEGMENT_ZIP names.
It runs in a process of its own, with an empty profile and a Python that has only bpy and its requirements, so that
SciPy, scikit-learn and psutil can come only from the ZIP.
"""

import importlib.metadata
import importlib.util
import inspect
import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TIME_LIMIT = 300  # seconds; unpacking the wheels and starting Blender take about 20


def load_build_zip():
    spec = importlib.util.spec_from_file_location("build_zip", ROOT / "scripts" / "build_zip.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


build_zip = load_build_zip()
PYTHONS = ("3.11", "3.13")
LINUX = "manylinux_2_17_x86_64.manylinux2014_x86_64"
LINUX_WHEELS = [
    f"{name}-{version}-{f'cp36-abi3-{LINUX}' if name == 'psutil' else 'py3-none-any'}.whl"
    for name, version in build_zip.ANY_PYTHON.items()
] + [
    f"{name}-{version}-{tag}-{tag}-{LINUX}.whl"
    for python, tag in (("3.11", "cp311"), ("3.13", "cp313"))
    for name, version in build_zip.COMPILED[python].items()
]
MODEL = "wks_segment/models/human.json"
SCIPY_313 = next(name for name in LINUX_WHEELS if name.startswith("scipy") and "cp313" in name)


def write_zip(path, packed, listed=None, files=(), platforms=("linux-x64",)):
    """Write a ZIP with empty wheels, of which its manifest lists `listed`, by default all."""
    wheels = [f"./wheels/{name}" for name in (packed if listed is None else listed)]
    with zipfile.ZipFile(path, "w") as archive:
        manifest = f"platforms = {list(platforms)}\nwheels = {wheels}\n"
        archive.writestr("blender_manifest.toml", manifest)
        for name in ("__init__.py", "LICENSE", MODEL, *(f"wheels/{name}" for name in packed), *files):
            archive.writestr(name, "")
    return path


def faults_of(tmp_path, *args, **kwargs):
    return build_zip.zip_faults(write_zip(tmp_path / "made_up.zip", *args, **kwargs), "linux-x64", PYTHONS)


def test_the_readme_of_the_zip_has_no_link_that_leads_nowhere(tmp_path):
    target = tmp_path / "extension"
    target.mkdir()
    build_zip.stage(ROOT, target, "linux-x64", [])
    whole, text = (ROOT / "README.md").read_text(encoding="utf-8"), (target / "README.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    assert "LICENSE" in links
    assert [link for link in links if not link.startswith("http") and not (target / link).exists()] == []
    assert "![" not in text
    first = whole.split("![")[0].split()
    assert text.split()[: len(first)] == first
    assert "The five-minute tutorial goes through it slowly" in text.replace("\n", " ")


def test_the_zip_contains_the_starter_models(tmp_path):
    target = tmp_path / "extension"
    target.mkdir()
    build_zip.stage(ROOT, target, "linux-x64", [])
    shipped = {path.name for path in (ROOT / "wks_segment" / "models").glob("*.json")}
    assert {path.name for path in (target / "wks_segment" / "models").iterdir()} >= shipped > set()
    assert build_zip.file_faults(["__init__.py", "blender_manifest.toml", "LICENSE"]) == [
        "there is no starter model in wks_segment/models/"
    ]


def test_complete_zip_has_no_fault(tmp_path):
    assert faults_of(tmp_path, LINUX_WHEELS) == []


@pytest.mark.parametrize(
    ("added", "fault"),
    [
        ("numpy-1.26.4-cp311-cp311-manylinux_2_17_x86_64.whl", "would replace Blender's own NumPy"),
        ("joblib-1.6.0-py3-none-any.whl", "2 wheels of joblib suit linux-x64, Python 3.11"),
        ("scipy-1.15.3-cp311-cp311-win_amd64.whl", "does not suit linux-x64"),
        ("scipy-1.15.3-cp313-cp313t-manylinux_2_17_x86_64.whl", "does not suit linux-x64"),
        ("cholespy-2.2.0-cp312-cp312-manylinux_2_34_x86_64.whl", "does not suit linux-x64"),
        ("psutil-7.2.2-cp314-abi3-manylinux_2_17_x86_64.whl", "does not suit linux-x64"),
        ("psutil-7.3.0-cp36-abi3-manylinux_2_17_x86_64.whl", "2 wheels of psutil suit linux-x64, Python 3.11"),
        ("not_a_wheel.whl", "does not suit linux-x64"),
    ],
)
def test_wheel_that_must_not_be_inside(tmp_path, added, fault):
    faults = faults_of(tmp_path, [*LINUX_WHEELS, added])
    assert any(fault in each for each in faults), faults


def test_platform_without_a_wheel(tmp_path):
    faults = faults_of(tmp_path, [name for name in LINUX_WHEELS if name != SCIPY_313])
    assert faults == ["no wheel of scipy for linux-x64, Python 3.13"]


def test_wheel_of_another_platform_does_not_count(tmp_path):
    faults = faults_of(tmp_path, [name.replace(LINUX, "win_amd64") for name in LINUX_WHEELS])
    for package in ("scipy", "scikit_learn", "psutil"):
        for python in PYTHONS:
            assert f"no wheel of {package} for linux-x64, Python {python}" in faults


@pytest.mark.parametrize(("version", "runs"), [("12_0", True), ("14_0", False)])
def test_wheel_for_a_newer_macos(version, runs):
    wheel = build_zip.Wheel.parse(f"scipy-1.15.3-cp311-cp311-macosx_{version}_arm64.whl")
    assert wheel.suits("macos-arm64", "3.11") is runs


def test_listed_wheel_is_missing(tmp_path):
    faults = faults_of(tmp_path, LINUX_WHEELS, listed=[*LINUX_WHEELS, "narwhals-2.0.0-py3-none-any.whl"])
    assert faults == ["the manifest lists wheels/narwhals-2.0.0-py3-none-any.whl, which is not in the ZIP"]


def test_packed_wheel_is_not_listed(tmp_path):
    faults = faults_of(tmp_path, LINUX_WHEELS, listed=[name for name in LINUX_WHEELS if name != SCIPY_313])
    assert faults == [f"the ZIP contains wheels/{SCIPY_313}, which the manifest does not list"]


def test_manifest_of_several_platforms(tmp_path):
    faults = faults_of(tmp_path, LINUX_WHEELS, platforms=("linux-x64", "windows-x64"))
    assert faults == ["the manifest's platforms are ['linux-x64', 'windows-x64'], not ['linux-x64']"]


@pytest.mark.parametrize(
    "name", ["wks_segment/__pycache__/a.pyc", "tests/core/test_mesh.py", "docs/notes.docx", ".gitignore"]
)
def test_file_that_does_not_belong_in_the_zip(tmp_path, name):
    faults = faults_of(tmp_path, LINUX_WHEELS, files=[name])
    assert len(faults) == 1
    assert name in faults[0]


def test_failed_build_says_why_and_returns_1(tmp_path, capsys):
    (tmp_path / "blender_manifest.toml").write_text('platforms = ["amiga-m68k"]\n')
    assert build_zip.main(["--source", str(tmp_path), "--output", str(tmp_path / "dist")]) == 1
    assert "amiga-m68k" in capsys.readouterr().err
    assert not (tmp_path / "dist").exists()


@pytest.fixture
def zip_path():
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("the install test is for Linux x64")
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("bpy is not installed")
    if named := os.environ.get("WKS_SEGMENT_ZIP"):
        return Path(named).resolve(strict=True)
    built = sorted((ROOT / "dist").glob("wks_segment-*-linux-x64.zip"), key=lambda path: path.stat().st_mtime)
    if not built:
        pytest.skip("no ZIP in dist/: run `python scripts/build_zip.py --platform linux-x64` first")
    return built[-1]


@pytest.fixture
def bare_site(tmp_path):
    """A site-packages folder that links bpy and what bpy asks for, and nothing else of the environment."""
    site = tmp_path / "site"
    site.mkdir()
    waiting, seen = ["bpy"], set()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        try:
            distribution = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:
            continue  # a requirement of another system or Python
        requirements = [each for each in distribution.requires or () if "extra ==" not in each]
        waiting += [re.match(r"[\w.-]+", each)[0].lower() for each in requirements]
        for top in {file.parts[0] for file in distribution.files} - {"..", "__pycache__"}:
            (site / top).symlink_to(distribution.locate_file(top))
    return site


def use_extension(site, zip_path, profile):
    """Install the extension, learn, clear and disable it.

    The source of this function is run by another process, so it contains its imports.
    """
    import importlib.util
    import sys
    from pathlib import Path

    sys.path.append(site)
    for name in ("scipy", "sklearn", "joblib", "threadpoolctl", "psutil"):
        assert importlib.util.find_spec(name) is None, f"{name} is installed already, without the ZIP"

    import bpy
    import numpy as np

    bpy.ops.extensions.package_install_files(filepath=zip_path, repo="user_default", enable_on_install=True)
    module = "bl_ext.user_default.wks_segment"
    assert module in bpy.context.preferences.addons, "the extension is not enabled"

    import joblib
    import psutil
    import scipy
    import sklearn
    import threadpoolctl

    for package in (scipy, sklearn, joblib, threadpoolctl, psutil):
        assert Path(package.__file__).is_relative_to(profile), f"{package.__file__} is not from the ZIP"
    assert Path(np.__file__).is_relative_to(site), f"{np.__file__} is not the environment's NumPy"

    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=32)
    # Copies, since Blender numbers the faces of each new sphere in another order.
    poses = [bpy.context.object]
    for _ in range(2):
        poses.append(poses[0].copy())
        poses[-1].data = poses[0].data.copy()
        bpy.context.collection.objects.link(poses[-1])
    for turn, pose in zip((0.1, 0.3, 0.6), poses, strict=True):
        points = np.empty((len(pose.data.vertices), 3), dtype=np.float32)
        pose.data.vertices.foreach_get("co", points.ravel())
        angles = np.arctan2(points[:, 1], points[:, 0])
        flatness = np.hypot(points[:, 0], points[:, 1])
        points *= 1 + 2 * (flatness * np.cos(1.5 * angles) ** 2)[:, None] ** 4  # three limbs
        points[:, 2] += turn * np.maximum(points[:, 0], 0) ** 2  # one of them rises
        pose.data.vertices.foreach_set("co", points.ravel())
        pose.data.update()
        pose.select_set(True)

    settings = bpy.context.scene.wks_segment
    settings.source = "OBJECTS"
    settings.n_segments = 4
    settings.n_eigenpairs = 60
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    for pose in poses:
        labels = pose.data.attributes["wks_segment"]
        assert (labels.data_type, labels.domain) == ("INT", "FACE")
        values = np.empty(len(pose.data.polygons), dtype=np.int32)
        labels.data.foreach_get("value", values)
        assert len(np.unique(values)) > 1, "all faces have the same label"

    bpy.context.preferences.addons[module].preferences.model_folder = profile
    assert bpy.ops.wks_segment.save_model(filepath=str(Path(profile) / "shared.json")) == {"FINISHED"}
    settings.n_eigenpairs = 50  # copies of one model are counted once
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    assert bpy.ops.wks_segment.rank() == {"FINISHED"}
    assert "shared" in [item.name for item in settings.ranking], "the model folder of the preferences is not used"

    assert bpy.ops.wks_segment.clear() == {"FINISHED"}
    assert all("wks_segment" not in pose.data.attributes for pose in poses), "clear left an attribute"

    assert bpy.ops.preferences.addon_disable(module=module) == {"FINISHED"}
    assert module not in bpy.context.preferences.addons
    assert not hasattr(bpy.types.Scene, "wks_segment"), "unregister left the settings behind"


# Blender can crash or hang at a normal exit of Python, so the process always ends with os._exit.
RUN_AND_EXIT = """

import os, sys, traceback
code = 1
try:
    use_extension(*sys.argv[1:])
    code = 0
except BaseException:
    traceback.print_exc()
finally:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
"""


def test_install_learn_clear_and_disable(zip_path, bare_site, tmp_path):
    profile = tmp_path / "profile"
    profile.mkdir()
    program = tmp_path / "use_extension.py"
    program.write_text(inspect.getsource(use_extension) + RUN_AND_EXIT, encoding="utf-8")
    done = subprocess.run(
        # -I and -S: no PYTHONPATH, no site-packages
        [sys.executable, "-I", "-S", str(program), str(bare_site), str(zip_path), str(profile)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(profile)},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    shutil.rmtree(profile)  # 100 MB of wheels, which only a failure would need
