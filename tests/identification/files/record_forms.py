"""Sixty forms of one record, as loggers, spreadsheets and programs write it.

The table was written before the readers that it judges. Each form tells how it is asked for, and
what comes out: 40 samples of u and y, 10 ms apart (more coarsely where a form has no fractions).
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

N = 40
STEP = 0.01
U = np.round(np.sin(0.7 * np.arange(N)) + 0.3, 4)
Y = np.round(-1.5 * np.cos(0.4 * np.arange(N) ** 1.1), 4)
NIGHT = datetime(2024, 1, 31, 23, 59, 59, 800000)
MORNING = datetime(2024, 1, 31, 10, 0, 0)


@dataclass(frozen=True)
class Form:
    """Contents of a file, and what asks for its record."""

    content: Any
    asked: dict[str, Any] = field(default_factory=dict)
    step: float = STEP
    ending: str = "csv"
    u: np.ndarray = field(default_factory=lambda: U)
    y: np.ndarray = field(default_factory=lambda: Y)

    def written(self, folder: Path) -> Path:
        """The file."""
        file = folder / f"record.{self.ending}"
        if callable(self.content):
            self.content(file)
        else:
            raw = self.content if isinstance(self.content, bytes) else self.content.encode()
            file.write_bytes(raw)
        return file

    @property
    def call(self) -> dict[str, Any]:
        """Arguments of `read_record`."""
        return {"inputs": "u", "outputs": "y", "time": "t"} | self.asked


def plain(value: float) -> str:
    return f"{value:.4f}"


def comma(value: float) -> str:
    return plain(value).replace(".", ",")


def rows(
    mark: str = ",",
    number: Callable[[float], str] = plain,
    instant: Callable[[int], str] | None = None,
    scale: float = 1.0,
    more: Callable[[int], tuple[str, ...]] = lambda k: (),
) -> str:
    """Lines of instants, inputs and outputs."""
    at = instant or (lambda k: number(k * STEP * scale))
    lines = [mark.join([at(k), number(U[k]), number(Y[k]), *more(k)]) for k in range(N)]
    return "\n".join(lines) + "\n"


def stamped(start: datetime, form: Callable[[datetime], str], step: float = STEP):
    return lambda k: form(start + timedelta(seconds=round(k * step, 6)))


def millis(one: datetime) -> str:
    return f"{one:%H:%M:%S}.{one.microsecond // 1000:03d}"


def named_time(name: str, **form: Any) -> Form:
    return Form(f"{name},u,y\n" + rows(**form), {"time": name})


def matlab_7_3(file: Path) -> None:
    import h5py

    with h5py.File(file, "w", userblock_size=512) as stored:
        for name, values in (("t", np.arange(N) * STEP), ("u", U), ("y", Y)):
            data = stored.create_dataset(name, data=values[:, None].T)
            data.attrs["MATLAB_class"] = np.bytes_("double")
    with file.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")


def matlab_struct(file: Path) -> None:
    from scipy.io import savemat

    savemat(file, {"log": {"t": np.arange(N) * STEP, "u": U, "y": Y, "rig": "two"}})


def netcdf_dates(file: Path) -> None:
    import xarray as xr

    time = np.datetime64("2024-01-31") + np.arange(N) * np.timedelta64(10, "ms")
    arrays = {"u": ("t", U), "y": ("t", Y)}
    xr.Dataset(arrays, coords={"t": time}).to_netcdf(file, engine="h5netcdf")


def excel(*head: list[str], dates: bool = False) -> Callable[[Path], None]:
    def write(file: Path) -> None:
        import openpyxl

        book = openpyxl.Workbook()
        for line in head:
            book.active.append(line)
        for k in range(N):
            at = MORNING + timedelta(seconds=k) if dates else k * STEP
            book.active.append([at, float(U[k]), float(Y[k])])
        book.save(file)

    return write


def pandas_csv(file: Path) -> None:
    import pandas as pd

    stream = io.StringIO()
    pd.DataFrame({"t": np.arange(N) * STEP, "u": U, "y": Y}).to_csv(stream)
    file.write_text(stream.getvalue())


GERMAN = "t;u;y\n" + rows(";", comma)
FORMS: dict[str, Form] = {
    # marks, comments, lines
    "commas": Form("t,u,y\n" + rows()),
    "semicolons": Form("t;u;y\n" + rows(";")),
    "tabs": Form("t\tu\ty\n" + rows("\t")),
    "aligned by blanks": Form("   t      u      y\n" + rows("   ")),
    "decimal commas": Form(GERMAN),
    "decimal commas and tabs": Form("t\tu\ty\n" + rows("\t", comma)),
    "decimal commas and blanks": Form("t u y\n" + rows(" ", comma)),
    "decimal commas and commas": Form("t,u,y\n" + rows(",", comma)),
    "comments above": Form("# rig 3\n# 5 V\nt,u,y\n" + rows()),
    "names in a comment": Form("% rig 3\n% t u y\n" + rows(" ")),
    "comments among the numbers": Form("t,u,y\n" + rows().replace("\n", "\n# pause\n", 7)),
    "metadata above": Form("Logger 7\nRate,100 Hz\nChannels,3\n\nt,u,y\n" + rows()),
    "a footer": Form("t,u,y\n" + rows() + "\nEnd of measurement\n"),
    "separator of Excel": Form("sep=;\n" + GERMAN),
    "separators at the ends": Form("t;u;y;\n" + rows(";", comma).replace("\n", ";\n")),
    "line ends of old": Form(("t,u,y\n" + rows()).replace("\n", "\r")),
    "all in quotes": Form('"t","u","y"\n' + '"' + rows('","').replace("\n", '"\n"')[:-1]),
    "a rule below the names": Form("t u y\n------ ------ ------\n" + rows(" ")),
    "no names": Form(rows(), {"time": "1", "inputs": "2", "outputs": "3"}),
    # encodings
    "UTF-8 with a mark": Form(GERMAN.encode("utf-8-sig")),
    "UTF-16": Form(GERMAN.encode("utf-16")),
    "UTF-16, big end first": Form(b"\xfe\xff" + GERMAN.encode("utf-16-be")),
    "UTF-16 without a mark": Form(GERMAN.encode("utf-16-le")),
    "micro sign of Windows": Form(("t [µs],u,y\n" + rows(scale=1e6)).encode("cp1252")),
    "Greek mu": Form("t [\u03bcs],u,y\n" + rows(scale=1e6)),
    # units
    "t_ms": named_time("t_ms", scale=1e3),
    "t/ms": named_time("t/ms", scale=1e3),
    "millis": named_time("millis", scale=1e3),
    "timestamp_us": named_time("timestamp_us", scale=1e6),
    "Time [ms]": Form("Time [ms],u,y\n" + rows(scale=1e3), {"time": "Time"}),
    "Time (sec)": Form("Time (sec),u,y\n" + rows(), {"time": "Time"}),
    "hours": Form("t [h],u,y\n" + rows(instant=lambda k: repr(k * STEP / 3600))),
    "minutes": named_time("t_min", instant=lambda k: repr(k * STEP / 60)),
    "row of units": Form("t;u;y\nms;V;1/min\n" + rows(";", comma, scale=1e3)),
    "row of units in brackets": Form("t,u,y\n[ms],[V],[mm/s]\n" + rows(scale=1e3)),
    "units in the cells": Form(
        "t;u;y\n" + "".join(f"{k * 10} ms;{U[k]} V;{Y[k]} mm/s\n" for k in range(N))
    ),
    # instants
    "dates of ISO 8601": Form("t,u,y\n" + rows(instant=stamped(NIGHT, datetime.isoformat))),
    "dates with a blank": Form("t,u,y\n" + rows(instant=stamped(NIGHT, str))),
    "dates in UTC": Form(
        "t,u,y\n" + rows(instant=stamped(MORNING, lambda at: f"{at:%Y-%m-%dT}{millis(at)}Z"))
    ),
    "dates of summer time": Form(
        "t,u,y\n"
        + rows(
            instant=lambda k: (
                f"2024-03-31T01:{k + 40}:00+01:00"
                if k < 20
                else f"2024-03-31T03:{k - 20:02d}:00+02:00"
            )
        ),
        step=60.0,
    ),
    "dates with the day first": Form(
        "t;u;y\n" + rows(";", comma, stamped(NIGHT, lambda at: f"{at:%d.%m.%Y} {millis(at)}"))
    ),
    "dates with the month first": Form(
        "t,u,y\n" + rows(instant=stamped(NIGHT, lambda at: f"{at:%m/%d/%Y} {millis(at)}"))
    ),
    "dates that leave day and month open": Form(
        "t,u,y\n"
        + rows(instant=stamped(datetime(2024, 3, 4), lambda at: f"{at:%d/%m/%Y}", 86400.0)),
        step=86400.0,
    ),
    "hh:mm:ss": Form("t,u,y\n" + rows(instant=stamped(MORNING, millis))),
    "hh:mm:ss, decimal comma": Form(
        "t;u;y\n" + rows(";", comma, stamped(MORNING, lambda at: millis(at).replace(".", ",")))
    ),
    "hh:mm:ss over midnight": Form("t,u,y\n" + rows(instant=stamped(NIGHT, millis))),
    "hours up to twelve": Form(
        "t,u,y\n"
        + rows(
            instant=stamped(datetime(2024, 1, 31, 12, 59, 40), lambda at: f"{at:%I:%M:%S %p}", 1.0)
        ),
        step=1.0,
    ),
    "date and clock apart": Form(
        "day,t,u,y\n" + rows(instant=stamped(NIGHT, lambda at: f"{at:%Y-%m-%d},{millis(at)}"))
    ),
    # cells and columns
    "TRUE and FALSE": Form(
        "t,u,y\n" + "".join(f"{k * STEP},{str(U[k] > 0).upper()},{Y[k]}\n" for k in range(N)),
        u=(U > 0).astype(float),
    ),
    "#N/A beside": Form("t,u,y,z\n" + rows(more=lambda k: ("#N/A" if k % 3 else "1.5",))),
    "words beside": Form("t,u,y,state\n" + rows(more=lambda k: ("RUN",))),
    "a last column without entries": Form("t,u,y,remark\n" + rows()),
    "two columns of one name": Form("t,u,y,z,z\n" + rows(more=lambda k: ("1", "2"))),
    "a torn last line": Form("t,u,y\n" + rows() + "0.4000,1.2"),
    "minus signs of print": Form("t,u,y\n" + rows().replace("-", "\u2212")),
    "thousands apart": Form(
        "t;u;y\n"
        + rows(";", lambda x: f"{x:,.4f}".translate(str.maketrans(",.", ".,")), scale=1e6),
        step=STEP * 1e6,
    ),
    # other formats
    "rows numbered by pandas": Form(pandas_csv),
    "MATLAB 7.3": Form(matlab_7_3, ending="mat"),
    "MATLAB's struct": Form(
        matlab_struct, {"time": "log.t", "inputs": "log.u", "outputs": "log.y"}, ending="mat"
    ),
    "Excel with dates": Form(excel(["t", "u", "y"], dates=True), step=1.0, ending="xlsx"),
}
