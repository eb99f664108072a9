"""Caches return a result for the same content and settings, and for nothing else."""

import functools
import multiprocessing
import os
import sys
import time

import numpy as np
import pytest
from shapes import creature, together

from wks_segment.core import DiskCache, MemoryCache, PoseSegmentation, TriangleMesh, connect

SMALL = {"n_segments": 4, "n_eigenpairs": 30, "n_energies": 20}
POSE = creature(0.3, 3)


class Counting:
    """Cache that counts its hits and misses."""

    def __init__(self, cache):
        self.cache, self.hits, self.misses = cache, 0, 0

    def get(self, key):
        found = self.cache.get(key)
        self.hits, self.misses = self.hits + (found is not None), self.misses + (found is None)
        return found

    def put(self, key, signature):
        self.cache.put(key, signature)

    def arrays(self, key):
        return self.cache.arrays(key)

    def keep(self, key, arrays):
        self.kept = getattr(self, "kept", 0) + 1
        self.cache.keep(key, arrays)


@pytest.fixture(params=["memory", "disk"])
def cache(request, tmp_path):
    """Cache that holds the signature of one pose."""
    kept = Counting(MemoryCache() if request.param == "memory" else DiskCache(tmp_path / "kept"))
    PoseSegmentation(**SMALL).describe_all([POSE], cache=kept)
    assert (kept.hits, kept.misses) == (0, 1)
    return kept


def same(one, other):
    ours, theirs = one.arrays(), other.arrays()
    assert ours.keys() == theirs.keys()
    for name, array in ours.items():
        assert array.dtype == theirs[name].dtype, name
        np.testing.assert_array_equal(array, theirs[name], name)
    return True


def test_cached_signature_equals_a_computed_one(cache):
    computed = PoseSegmentation(**SMALL).describe(POSE)
    (kept,) = PoseSegmentation(**SMALL).describe_all([TriangleMesh(POSE.vertices, POSE.faces)], cache=cache)
    assert cache.hits == 1
    assert same(kept, computed)
    assert kept.laplacian == computed.laplacian


def test_parameters_of_the_mixture_do_not_change_the_key(cache):
    others = {"n_segments": 6, "smoothness": 2.0, "covariance_type": "diag", "scaling": "raw", "random_state": 3}
    PoseSegmentation(**{**SMALL, **others}).describe_all([POSE], cache=cache)
    assert cache.hits == 1


@pytest.mark.parametrize(
    "change", [{"n_eigenpairs": 31}, {"n_energies": 21}, {"accuracy": "exact"}, {"laplacian": "delaunay"}]
)
def test_parameters_of_the_signature_change_the_key(cache, change):
    model = PoseSegmentation(**{**SMALL, **change})
    (found,) = model.describe_all([POSE], cache=cache)
    assert cache.hits == 0
    assert same(found, model.describe(POSE))


def test_changed_mesh_has_another_key(cache):
    moved = POSE.vertices.copy()
    moved[7, 1] += 1e-9
    turned = POSE.faces.copy()
    turned[3] = turned[3, [0, 2, 1]]
    for mesh in (
        TriangleMesh(moved, POSE.faces),
        TriangleMesh(POSE.vertices, POSE.faces[1:]),
        TriangleMesh(POSE.vertices, turned),
        TriangleMesh(np.append(POSE.vertices, [[0.0, 0, 0]], axis=0), POSE.faces),
    ):
        PoseSegmentation(**SMALL).describe_all([mesh], cache=cache)
    assert cache.hits == 0


def test_other_connection_has_another_key(cache):
    """A cut in the mesh is closed in this pose, but open in another one."""
    cut = POSE.faces.copy()
    corner = cut[0, 0]
    cut[0, 0] = POSE.n_vertices
    vertices = np.append(POSE.vertices, POSE.vertices[[corner]], axis=0)
    opened = vertices.copy()
    opened[-1] += 0.1
    closed, other = TriangleMesh(vertices, cut), TriangleMesh(opened, cut)
    model = PoseSegmentation(**SMALL)
    model.describe_all([closed], cache=cache)
    model.describe_all([closed], [connect(closed, other)], cache=cache)
    assert cache.hits == 0


def test_other_ties_of_islands_have_another_key(cache):
    pair = together(POSE, TriangleMesh(0.2 * POSE.vertices + 3, POSE.faces))
    for pieces in ("joined", "separate"):
        PoseSegmentation(**SMALL, pieces=pieces).describe_all([pair], cache=cache)
    assert (cache.hits, cache.misses) == (0, 3)


def test_finished_poses_of_a_canceled_job_are_kept():
    cache, poses = Counting(MemoryCache()), [creature(bend, 3) for bend in (0.0, 0.2, 0.4)]

    def cancel(stage, share):
        if share > 0.6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        PoseSegmentation(**SMALL).describe_all(poses, progress=cancel, workers=1, cache=cache)
    PoseSegmentation(**SMALL).describe_all(poses, cache=cache)
    assert cache.hits >= 1


def described(*bends):
    return [PoseSegmentation(**SMALL).describe(creature(bend, 3)) for bend in bends]


def test_memory_cache_is_limited_and_drops_the_least_recently_used():
    one, two, three = described(0.0, 0.2, 0.4)
    size = sum(array.nbytes for array in one.arrays().values())
    cache = MemoryCache(int(2.5 * size))
    cache.put("one", one)
    cache.put("two", two)
    assert cache.get("one") is one
    cache.put("three", three)
    assert (cache.get("one"), cache.get("two"), cache.get("three")) == (one, None, three)
    assert 0 < cache.size <= cache.limit
    cache.clear()
    assert cache.get("one") is None
    assert cache.size == 0


def test_entry_above_the_limit_is_not_kept():
    (one,) = described(0.0)
    cache = MemoryCache(1000)
    cache.put("one", one)
    assert cache.get("one") is None


def test_kept_arrays_are_read_only():
    cache, (one,) = MemoryCache(), described(0.0)
    cache.put("one", one)
    with pytest.raises(ValueError, match="read-only"):
        cache.get("one").signature[0] = 0


def test_disk_cache_is_limited_and_removes_the_least_recently_used(tmp_path):
    poses = described(0.0, 0.2, 0.4)
    cache = DiskCache(tmp_path, 10**9)
    for i, pose in enumerate(poses[:2]):
        cache.put(str(i), pose)
        os.utime(tmp_path / f"{i}.npz", (1000 + i, 1000 + i))
    assert cache.get("0") is not None
    cache.limit = int(2.5 * (tmp_path / "0.npz").stat().st_size)
    cache.put("2", poses[2])
    assert [cache.get(str(i)) is None for i in range(3)] == [False, True, False]


def test_damaged_file_counts_as_missing_and_is_replaced(tmp_path):
    cache, (one, two) = DiskCache(tmp_path), described(0.0, 0.2)
    for damage in (b"", b"PK\x03\x04 no zip", None):
        cache.put("one", two)
        whole = (tmp_path / "one.npz").read_bytes()
        (tmp_path / "one.npz").write_bytes(whole[: len(whole) // 2] if damage is None else damage)
        assert cache.get("one") is None
        cache.put("one", one)
        assert same(cache.get("one"), one)


def test_file_with_python_objects_is_not_read(tmp_path):
    cache = DiskCache(tmp_path)
    np.savez(tmp_path / "one.npz", vertices=np.array([{}], dtype=object))
    assert cache.get("one") is None


def test_cache_that_cannot_be_written_gives_a_warning_and_the_result(tmp_path):
    class Full:
        def get(self, key):
            return None

        def put(self, key, signature):
            raise OSError("no space left on device")

    with pytest.warns(UserWarning, match="not kept for the next time: no space left"):
        assert PoseSegmentation(**SMALL).describe(POSE, cache=Full()).signature.shape[1] == 20


def test_old_unfinished_files_are_removed(tmp_path):
    cache, (one,) = DiskCache(tmp_path), described(0.0)
    old, new = tmp_path / ".wks_segment-old.npz", tmp_path / ".wks_segment-new.npz"
    for path in (old, new):
        path.write_bytes(b"half")
    long_ago = time.time() - 7200
    os.utime(old, (long_ago, long_ago))
    cache.put("one", one)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".wks_segment-new.npz", "one.npz"]


def write_often(folder, limit, seed):
    pose = PoseSegmentation(**SMALL).describe(creature(0.1, 2))
    cache = DiskCache(folder, limit)
    found = 0
    for i in np.random.default_rng(seed).integers(0, 6, 60):
        kept = cache.get(str(i))
        found += kept is not None
        assert kept is None or same(kept, pose)
        cache.put(str(i), pose)
    sys.exit(0 if found else 3)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no umask")
def test_files_can_be_read_by_whom_the_user_allows(tmp_path):
    before = os.umask(0o027)
    try:
        PoseSegmentation(**SMALL).describe_all([POSE], cache=DiskCache(tmp_path))
    finally:
        os.umask(before)
    assert [oct(path.stat().st_mode & 0o777) for path in tmp_path.iterdir()] == ["0o640"]


def test_a_file_of_another_user_is_found(tmp_path, monkeypatch):
    """It can be read; to mark it as used, or to remove it from a shared folder, is not allowed."""

    def forbidden(*_):
        raise PermissionError("Operation not permitted")

    cache = Counting(DiskCache(tmp_path))
    PoseSegmentation(**SMALL).describe_all([POSE], cache=cache)
    (tmp_path / ".wks_segment-abandoned.npz").touch()
    os.utime(tmp_path / ".wks_segment-abandoned.npz", (0, 0))
    monkeypatch.setattr(os, "utime", forbidden)
    monkeypatch.setattr("pathlib.Path.unlink", forbidden)
    PoseSegmentation(**SMALL).describe_all([POSE, OTHER], cache=cache)
    assert cache.hits == 1


def test_several_processes_use_one_folder(tmp_path):
    limit = 4 * sum(array.nbytes for array in PoseSegmentation(**SMALL).describe(creature(0.1, 2)).arrays().values())
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=write_often, args=(tmp_path, limit, seed)) for seed in range(2)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(120)
    assert [writer.exitcode for writer in writers] == [0, 0]
    files = list(tmp_path.iterdir())
    assert {path.suffix for path in files} == {".npz"}
    assert sum(path.stat().st_size for path in files) <= limit


POSES = [creature(bend, 3) for bend in (0.0, 0.3)]
OTHER = creature(0.2, 2)
"""Pose with another mesh."""
LEARNED = {"one mesh": POSES, "one pose": POSES[:1], "meshes": [POSES[0], OTHER]}


@functools.cache
def model_without_a_cache(learned, number, **settings):
    return PoseSegmentation(**SMALL | settings | {"n_segments": number}).fit(LEARNED[learned]).to_json()


@pytest.mark.parametrize(
    ("learned", "settings"),
    [
        ("one mesh", {}),
        ("one mesh", {"scaling": "raw"}),
        ("one pose", {}),
        ("meshes", {}),
        ("meshes", {"covariance_type": "tied"}),
    ],
    ids=["one mesh", "one mesh, raw", "one pose", "meshes", "meshes, tied"],
)
def test_fit_with_a_cache_equals_fit_without(cache, learned, settings):
    for number in (6, 4):
        parameters = SMALL | settings | {"n_segments": number}
        cached = PoseSegmentation(**parameters).fit(LEARNED[learned], cache=cache)
        assert cached.to_json() == model_without_a_cache(learned, number, **settings)


def test_fit_with_another_number_of_segments_reuses_the_kinds(cache):
    stages = {}
    for number in (4, 8, 3, "auto"):
        said = stages[number] = set()
        model = PoseSegmentation(**SMALL | {"n_segments": number})
        model.fit(POSES, lambda stage, share, said=said: said.add((stage, round(share, 2))), cache=cache)
    assert cache.kept == len(POSES) + 1  # the creases of each pose, and the kinds of both
    parts = {number: sum(stage == "parts" for stage, _ in said) for number, said in stages.items()}
    assert parts.pop(4) > 10
    assert set(parts.values()) == {1}  # the begin of the stage alone


def test_settings_of_the_kinds_change_the_key():
    cache, poses = Counting(MemoryCache()), [creature(bend, 2) for bend in (0.0, 0.3)]
    PoseSegmentation(**SMALL).fit(poses, cache=cache)
    for change in ({"n_segments": 16}, {"scaling": "raw"}, {"n_energies": 21}, {"laplacian": "delaunay"}):
        before = cache.kept
        PoseSegmentation(**SMALL | change).fit(poses, cache=cache)
        assert cache.kept == before + 1, change  # the creases are the same
    before = cache.kept
    PoseSegmentation(**SMALL | {"n_segments": 15, "covariance_type": "diag", "smoothness": 2.0}).fit(poses, cache=cache)
    assert cache.kept == before


def test_poses_and_rest_of_the_kinds_change_the_key():
    cache, poses = Counting(MemoryCache()), [creature(bend, 2) for bend in (0.0, 0.3)]
    for learned, rest in ((poses, None), (poses[::-1], None), (poses, creature(0.1, 2))):
        before = getattr(cache, "kept", 0)
        cached = PoseSegmentation(**SMALL).fit(learned, rest=rest, cache=cache)
        assert cache.kept > before
        assert cached.to_json() == PoseSegmentation(**SMALL).fit(learned, rest=rest).to_json()


def test_a_mesh_with_few_distinct_signatures_is_learned_the_same_with_a_cache(cache):
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    box = TriangleMesh(cube, [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                              [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip
    for number in (2, 3):
        parameters = SMALL | {"n_segments": number}
        cached = PoseSegmentation(**parameters).fit([box], cache=cache)
        assert cached.to_json() == PoseSegmentation(**parameters).fit([box]).to_json()


def test_damaged_files_are_computed_again(tmp_path):
    cache = DiskCache(tmp_path)
    model = PoseSegmentation(**SMALL).fit(POSES, cache=cache)
    for path in tmp_path.glob("*.npz"):
        path.write_bytes(path.read_bytes()[:-200])
    assert PoseSegmentation(**SMALL).fit(POSES, cache=cache).to_json() == model.to_json()


def test_entries_that_took_each_others_names_are_computed_again(tmp_path):
    cache = DiskCache(tmp_path)
    model = PoseSegmentation(**SMALL).fit(POSES, cache=cache)
    files = sorted(tmp_path.glob("*.npz"))
    for a, b in zip(files, [*files[1:], files[0]], strict=True):
        a.rename(b.with_suffix(".new"))
    for path in tmp_path.glob("*.new"):
        path.rename(path.with_suffix(".npz"))
    assert PoseSegmentation(**SMALL).fit(POSES, cache=cache).to_json() == model.to_json()
    counting = Counting(DiskCache(tmp_path))
    PoseSegmentation(**SMALL).fit(POSES, cache=counting)
    assert counting.hits == len(POSES), "they were not replaced"


def test_an_altered_entry_counts_as_missing(tmp_path):
    cache, (one,) = DiskCache(tmp_path), described(0.0)
    cache.put("one", one)
    with np.load(tmp_path / "one.npz") as file:
        arrays = dict(file)
    for name in arrays:
        changed = arrays[name].astype(float) + 1 if name != "digest" else np.array("0" * 40)
        np.savez(tmp_path / "one.npz", **arrays | {name: changed})
        assert cache.get("one") is None, name
    np.savez(tmp_path / "one.npz", **{name: array for name, array in arrays.items() if name != "digest"})
    assert cache.get("one") is None, "an entry of an earlier version"
    np.savez(tmp_path / "one.npz", **arrays)
    assert same(cache.get("one"), one)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pipes with names")
@pytest.mark.timeout(60)
def test_pipes_and_folders_in_the_place_of_entries_are_skipped(tmp_path):
    model = PoseSegmentation(**SMALL).fit(POSES, cache=DiskCache(tmp_path)).to_json()
    files = list(tmp_path.glob("*.npz"))
    for make in (os.mkfifo, os.mkdir):
        for path in files:
            path.unlink()
            make(path)
        assert PoseSegmentation(**SMALL).fit(POSES, cache=DiskCache(tmp_path, 1000)).to_json() == model
        if make is os.mkfifo:
            assert not any(path.is_fifo() for path in tmp_path.iterdir()), "replaced"
            PoseSegmentation(**SMALL).fit(POSES, cache=DiskCache(tmp_path))


def test_parts_that_cannot_be_kept_give_a_warning_and_the_model():
    class Full(MemoryCache):
        def keep(self, key, arrays):
            raise OSError("no space left on device")

    with pytest.warns(UserWarning, match="not kept for the next time: no space left on device") as warned:
        model = PoseSegmentation(**SMALL).fit(POSES[:1], cache=Full())
    assert sorted(str(warning.message).split()[0] for warning in warned) == ["creases", "parts"]
    assert model.to_json() == model_without_a_cache("one pose", SMALL["n_segments"])
