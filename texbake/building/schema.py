"""The JSON Schema of pipeline files, and schemas as files.

Based on: JSON Schema, draft 2020-12 (https://json-schema.org/draft/2020-12).
"""

from __future__ import annotations

import json
from pathlib import Path

from texbake.building.file import PipelineTable, model_of
from texbake.building.steps import STEP_KINDS
from texbake.errors import OptionError
from texbake.files import PathLike, check_writable, replacing
from texbake.jobs.outputs import JobResult
from texbake.rendering.scene.file.schema import scene_schema
from texbake.rendering.scene.file.tables import FileSchema, file_schema
from texbake.schema import JsonSchema


def pipeline_schema() -> JsonSchema:
    """JSON Schema of pipeline files, draft 2020-12, for editors to complete and check them by."""
    schema = file_schema(PipelineTable, "texbake pipeline")
    kinds = []
    for kind in STEP_KINDS.values():
        step = model_of(kind).model_json_schema(schema_generator=FileSchema)
        step["description"] = f"{kind.does[:1].upper()}{kind.does[1:]}."
        step["properties"]["do"] = {"const": kind.name, "description": step["description"]}
        step["required"] = sorted({"do", *step.get("required", ())})
        kinds.append(step)
    schema["properties"]["steps"]["additionalProperties"] = {"oneOf": kinds}
    return schema


def schema_file(file: str, output: PathLike) -> JobResult[JsonSchema]:
    """Write the JSON Schema of `pipeline` or `scene` files."""
    if file not in ("pipeline", "scene"):
        raise OptionError(f"file: {file} is not one of pipeline, scene")
    check_writable(output)
    schema = pipeline_schema() if file == "pipeline" else scene_schema()
    with replacing(output) as partial:
        partial.write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
    return JobResult(files=(Path(output),), report=schema)
