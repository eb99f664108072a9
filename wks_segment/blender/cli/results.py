"""Files that commands write, and the result that they print."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...core import PoseSegmentation
from ...core.message import Message, message_of
from ..errors import UserError
from ..outputs.origin import Origin
from ..outputs.overrides import merge_parts
from ..parts import part_ids
from ..props.settings import WKSSegmentSettings
from ..render.contact_sheet import Tile, render_poses
from ..scene import file_formats
from ..scene.poses import Pose
from ..workflow import pipeline
from ..workflow.describing import Run
from ..workflow.followed_settings import values_of
from ..workflow.pipeline import LabelRequest
from ..workflow.report import Report, merged_facts
from .terminal import table

LABELED, SOFTENED = 0.4, 0.6
"""Shares of the time after which the poses are labeled, and soft weights are known; the rest draws a picture."""


def check_outputs(options: argparse.Namespace) -> None:
    """UserError if a scene or a picture of the options cannot be written; called before the computation."""
    if options.output:
        file_formats.check_output(options.output)
    if options.render:
        check_picture(options.render)


def check_picture(path: Path) -> None:
    """UserError if a picture cannot be written to a path."""
    if path.suffix.lower() != ".png":
        raise UserError("{path}: a picture must have the suffix .png", path=path)
    file_formats.check_folder(path)


def label_and_write(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[Any], settings: WKSSegmentSettings,
    options: argparse.Namespace, run: Run,
) -> None:  # fmt: skip
    """Label poses by the model in use; write the labels to the meshes and a picture, if the options ask for these."""
    request = LabelRequest.of(settings, (pose.character for pose in poses))
    parts = [run.with_progress(run.progress.part(*ends)) for ends in ((0.0, LABELED), (LABELED, SOFTENED))]
    labels = pipeline.label(model, poses, described, request, parts[0])
    if options.output:
        weights = pipeline.soften(model, poses, described, labels, request, parts[1])
        origin = Origin(settings.labels(), values_of(settings))
        pipeline.write_outputs(settings, labels, request, run.report, weights, origin)
    if options.render:
        run.progress(SOFTENED, "Picture")
        with run.report.stage("render"):
            merged_into = settings.notes().joined
            tiles = [Tile(pose, merge_parts(labels[pose.character], merged_into), pose.name) for pose in poses]
            render_poses(tiles, options.render, style=settings.style(), pixels=options.tile)


def save_model(model: PoseSegmentation, path: Path) -> None:
    """Write a model to a file; UserError if it cannot be written."""
    try:
        model.save(path)
    except ValueError as error:
        raise UserError("{path}: {reason}", path=path, reason=message_of(error)) from error
    except OSError as error:
        raise file_formats.not_written(path, error) from error


def result_of(options: argparse.Namespace, report: Report) -> dict[str, Any]:
    """Result of a command that segments or labels, as a JSON object."""
    outputs = {name: getattr(options, name, None) for name in ("model", "output", "render")}
    return {
        "poses": [
            {
                "name": pose.name,
                "vertices": pose.mesh.n_vertices,
                "triangles": pose.mesh.n_faces,
                "laplacian": laplacian,
            }
            for pose, laplacian in zip(report.poses, report.laplacians, strict=True)
        ],
        "segments": report.n_segments,
        **({"parts": report.parts} if report.parts else {}),
        **({"merged": report.n_merged} if report.n_merged else {}),
        **({} if report.certainty is None else {"certainty": report.certainty}),
        "notes": report.notes,
        "seconds": rounded_seconds(report),
        "warnings": report.warnings,
        "files": {name: str(path) for name, path in outputs.items() if path is not None},
    }


def rounded_seconds(report: Report) -> dict[str, float]:
    """Duration of each stage in seconds, to the millisecond."""
    return {name: round(seconds, 3) for name, seconds in report.seconds.items()}


def result_text(result: dict[str, Any]) -> str:
    """Text of the result of a command that segments or labels, or of the demo."""
    is_demo = "agreement" in result["poses"][0]
    header = ["pose", "vertices", *(["", "agreement"] if is_demo else [])]
    rows = [
        [pose["name"], f"{pose['vertices']:,}"]
        + (["learned" if pose["learned"] else "unseen", f"{pose['agreement']:.3f}"] if is_demo else [])
        for pose in result["poses"]
    ]
    stages = [[name, f"{seconds:.1f}"] for name, seconds in result["seconds"].items()]
    counts = [
        part_ids.count_text(result["segments"], len(result.get("parts", {}))),
        *merged_facts(result.get("merged", 0)),
    ]
    lines = [table(header, rows), "", table(["stage", "seconds"], stages), "", Message.joined(", ", counts)]
    if is_demo:
        lines.append(f"agreement of unseen poses: {result['agreement']:.3f} of the area has the learned label")
    lines += result["notes"]
    return "\n".join([*lines, *warnings_and_files(result)])


def warnings_and_files(result: dict[str, Any]) -> list[str]:
    """Lines of text with the warnings and the written files of a result."""
    return [
        *(f"warning: {warning}" for warning in result["warnings"]),
        *(f"{name}: {path}" for name, path in result.get("files", {}).items()),
    ]
