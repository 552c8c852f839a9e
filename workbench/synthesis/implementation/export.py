"""Export of controllers to MATLAB files, JSON and C99 headers, and import of the first two."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Callable, Mapping
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, ResultError
from workbench.input_checks import need_choice
from workbench.synthesis.implementation.c_code.export_c import Precision, header
from workbench.synthesis.implementation.second_order import Sections
from workbench.synthesis.implementation.working_point.actuator import Actuator, Limits, limits_of
from workbench.systems.conversion import as_system
from workbench.systems.realisation import realisation

Format = Literal["json", "mat", "c"]
"""File formats."""
FILE_KIND = "workbench controller"
"""Text in a file that shows that `export` wrote it."""


def export(
    controller: Any,
    path: str | Path,
    format: Format,
    *,
    metadata: Mapping[str, Any] | None = None,
    name: str = "controller",
    precision: Precision = "double",
    limits: Limits | None = None,
) -> Path:
    """Write a controller to a file; an existing file is replaced as a whole or not at all.

    Parameters
    ----------
    controller
        StateSpace or TransferFunction; for ``"c"`` a sampled one, or `Sections`.
    format
        ``"json"`` and ``"mat"`` hold A, B, C, D, dt [s], the names of the signals and the metadata
        exactly. ``"c"`` is a C99 header with a state, a function that clears it and a function that
        makes a step.
    metadata
        Values that JSON can hold; for "json" and "mat" only.
    name, precision
        As in `export_c.header`; for "c" only.
    limits
        Lowest and highest value of each output; for "c" only.

    Raises
    ------
    InputError
        The format is unknown; the controller is not finite, or is continuous with "c"; JSON cannot
        hold the metadata; an option belongs to another format; or the folder is missing or not
        writable.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import export
    >>> file = export(control.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01), "controller.h", "c")
    >>> "controller_step" in file.read_text()
    True
    """
    if not isinstance(path, str | PathLike):
        raise InputError(f"the path of a file is needed, not {path!r}")
    path = Path(path)
    need_choice(format, Format, "format")
    if format == "c":
        if metadata:
            raise InputError("a C header takes no metadata; leave it out")
        actuator = None
        if limits is not None:
            outputs = (
                controller
                if isinstance(controller, Sections)
                else as_system(controller, "controller")
            ).noutputs
            actuator = Actuator(*limits_of(limits, outputs))
        content = header(controller, name, precision, actuator).encode("ascii")
    else:
        if limits is not None or (name, precision) != ("controller", "double"):
            raise InputError(f"name, precision and limits are for C, not for {format!r}")
        content = _WRITERS[format](_fields(controller, metadata or {}))
    replace_file(path, content)
    return path


def load_controller(path: str | Path) -> tuple[StateSpace, dict[str, Any]]:
    """Read a controller and its metadata from a file that `export` wrote as "json" or "mat".

    Raises
    ------
    ResultError
        The file cannot be read, or was not written by `export` as "json" or "mat".

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import export, load_controller
    >>> K = control.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> again, metadata = load_controller(export(K, "K.json", "json", metadata={"axis": "focus"}))
    >>> again.A.tolist(), metadata
    ([[0.9]], {'axis': 'focus'})
    """
    path = Path(path)
    try:
        content = path.read_bytes()
        fields = _from_json(content) if content.lstrip()[:1] == b"{" else _from_mat(content)
        if fields["kind"] != FILE_KIND:
            raise ValueError(f"it calls itself {fields['kind']!r}")
        K = realisation(
            tuple(fields[key] for key in "ABCD"),
            fields["dt"],
            name=fields["name"],
            inputs=fields["inputs"],
            outputs=fields["outputs"],
            states=fields["states"],
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ResultError(
            f"{path} holds no controller that export wrote as json or mat: {error}"
        ) from None
    return K, fields["metadata"]


def _fields(K: Any, metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a file; raises InputError for metadata that JSON cannot hold."""
    K = as_system(K.system if isinstance(K, Sections) else K, "K")
    parts = {key: np.asarray(getattr(K, key), dtype=float) for key in "ABCD"}
    try:
        text = json.dumps(metadata, allow_nan=False)
        same = json.loads(text) == dict(metadata)
    except (TypeError, ValueError) as error:
        raise InputError(f"metadata cannot be written as JSON: {error}") from None
    if not same:
        raise InputError(
            "metadata does not come back from JSON as it is; use dicts with text as keys, lists, "
            "text, numbers, booleans and None"
        )
    names = {
        "inputs": list(K.input_labels),
        "outputs": list(K.output_labels),
        "states": list(K.state_labels),
        "name": K.name,
    }
    return {"kind": FILE_KIND, **parts, "dt": K.dt, **names, "metadata": dict(metadata)}


def _to_json(fields: dict[str, Any]) -> bytes:
    """JSON with numbers in the shortest exact form, and with the shapes of the matrices."""
    plain = {
        key: {"shape": value.shape, "data": value.ravel().tolist()}
        if isinstance(value, np.ndarray)
        else value
        for key, value in fields.items()
    }
    return (json.dumps(plain, indent=1, allow_nan=False) + "\n").encode()


def _from_json(content: bytes) -> dict[str, Any]:
    """Fields of a JSON file."""
    fields: dict[str, Any] = json.loads(content)
    for key in "ABCD":
        matrix = fields[key]
        fields[key] = np.array(matrix["data"], dtype=float).reshape(matrix["shape"])
    return fields


def _to_mat(fields: dict[str, Any]) -> bytes:
    """MATLAB file, version 5. As in MATLAB, dt is -1 for an unknown sampling time; it is NaN for
    any time.
    """
    from scipy.io import savemat

    dt = fields["dt"]
    number = -1.0 if dt is True else math.nan if dt is None else float(dt)
    texts = {key: np.array(fields[key], dtype=object) for key in ("inputs", "outputs", "states")}
    stream = BytesIO()
    about = {"dt": number, "metadata": json.dumps(fields["metadata"])}
    savemat(stream, {**fields, **texts, **about}, oned_as="row")
    return stream.getvalue()


def _from_mat(content: bytes) -> dict[str, Any]:
    """Fields of a MATLAB file; raises ValueError for other content."""
    from scipy.io import loadmat

    try:
        found = loadmat(BytesIO(content))
    except Exception as error:  # loadmat raises many kinds of errors for other content
        raise ValueError(f"it is not JSON, and not a MATLAB file: {error}") from None
    dt = float(found["dt"].item())
    texts = {
        key: [str(text.item()) for text in found[key].ravel()]
        for key in ("inputs", "outputs", "states")
    }
    n, m, p = (len(texts[key]) for key in ("states", "inputs", "outputs"))
    sizes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    return {
        "kind": str(found["kind"].item()),
        **{key: found[key].astype(float).reshape(size) for key, size in sizes.items()},
        **texts,
        "dt": True if dt == -1.0 else None if math.isnan(dt) else dt,
        "name": str(found["name"].item()),
        "metadata": json.loads(found["metadata"].item()),
    }


_WRITERS: dict[str, Callable[[dict[str, Any]], bytes]] = {"json": _to_json, "mat": _to_mat}


def replace_file(path: Path, content: bytes) -> None:
    """Write a new file beside the old one and rename it, so that an interruption keeps the old."""
    partial: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(
            dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as stream:
            partial = Path(stream.name)
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        partial.chmod(0o644)
        partial.replace(path)
        partial = None
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None
    finally:
        if partial is not None:
            partial.unlink(missing_ok=True)
