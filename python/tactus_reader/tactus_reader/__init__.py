"""Recordings and movement primitives of Tactus as numpy arrays.

SI units and radians. The world frame has its origin where the axes of J1 and J2 meet, z up; quaternions are w, x, y, z.
"""

import csv
import io
import math
import pathlib
import tomllib

import numpy as np

__all__ = ["Recording", "align", "read_primitive", "read_recording"]

SCHEMA = "tactus-primitive/1"

# Decay of the phase over a movement, where no primitive says otherwise: s ends at 0.01.
ALPHA = math.log(100)

# A phase that is larger than the one before it by this factor is that of a movement begun anew: within one it only falls.
ANEW = 1.1

# Progress up to which the first and the last cycle of a movement stand for what was not recorded beside them.
REACH = 0.01

# Columns that belong together. A quantity exists if all its columns do.
QUANTITIES = {
    "q": [f"q{joint}_rad" for joint in range(1, 8)],
    "dq": [f"dq{joint}_rad_s" for joint in range(1, 8)],
    "tau": [f"tau{joint}_Nm" for joint in range(1, 8)],
    "position": ["x_m", "y_m", "z_m"],
    "orientation": ["qw", "qx", "qy", "qz"],
    "position_d": ["x_d_m", "y_d_m", "z_d_m"],
    "orientation_d": ["qw_d", "qx_d", "qy_d", "qz_d"],
    "wrench": ["fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm"],
    "hand": ["spread_rad", "finger1_rad", "finger2_rad", "finger3_rad"],
    "hand_d": ["spread_d_rad", "finger1_d_rad", "finger2_d_rad", "finger3_d_rad"],
    "gauges": ["gauge1_Nm", "gauge2_Nm", "gauge3_Nm"],
}

# Other spellings that are read.
ALIASES = {"px_m": "x_m", "py_m": "y_m", "pz_m": "z_m"}


class Recording:
    """What was measured, one line a control cycle.

    `recording["x_m"]` is a column. The quantities `q`, `dq`, `tau`, `position`, `orientation`, `position_d`,
    `orientation_d`, `wrench`, `hand`, `hand_d` and `gauges` are arrays with one row a cycle.
    """

    def __init__(self, path, notes, columns):
        self.path = path
        #: Notes `key: value` of its first lines, such as `primitive`, `speed` and `mode`.
        self.notes = notes
        #: Every column by its name: numbers, but for `state`, which is text.
        self.columns = columns

    def __len__(self):
        return len(self.time)

    def __getitem__(self, name):
        return self.columns[name]

    def __getattr__(self, name):
        names = QUANTITIES.get(name)
        if names is None:
            raise AttributeError(name)
        missing = [column for column in names if column not in self.columns]
        if missing:
            raise KeyError(f"{self.path} has no column {', '.join(missing)}")
        return np.column_stack([self.columns[column] for column in names])

    @property
    def time(self):
        """Time since the first line, s."""
        return self.columns["t_s"]

    @property
    def is_running(self):
        """True in the cycles in which a movement is played."""
        return self.columns["phase"] > 0

    def movements(self):
        """The movements that were played, each as a recording of its own: one that somebody looking on made may hold
        several."""
        phase, running = self.columns["phase"], self.is_running
        begins = running.copy()
        begins[1:] &= ~running[:-1] | (phase[1:] > ANEW * phase[:-1])
        number = np.cumsum(begins)
        return [self._part(running & (number == which)) for which in range(1, number.max(initial=0) + 1)]

    def _part(self, rows):
        return Recording(self.path, self.notes, {name: values[rows] for name, values in self.columns.items()})

    def progress(self, alpha=ALPHA):
        """Part of the movement that is played, 0 to 1 and beyond, from its phase; NaN outside of a movement."""
        with np.errstate(divide="ignore"):
            progress = -np.log(self.columns["phase"]) / alpha
        return np.where(self.is_running, progress, np.nan)


def read_recording(path):
    """Reads a recording, or the `.part` of one that was cut off. Raises ValueError where it is none."""
    path = pathlib.Path(path)
    notes, rows = {}, []
    text = path.read_text(encoding="utf-8-sig")
    for number, line in enumerate(io.StringIO(text), 1):
        if line.startswith("#"):
            key, separator, value = line[1:].partition(": ")
            if separator:
                notes[key.strip()] = value.strip()
        elif path.suffix == ".part" and not line.endswith("\n"):
            break  # it was being written when the end came
        elif not line.endswith(("\n", "\r")):
            raise ValueError(f"{path}, line {number}: the line has no end: the file was cut, maybe within a number")
        elif line.strip():
            rows.append((number, next(csv.reader([line]))))
    if not rows:
        raise ValueError(f"{path} has no header")
    names = [ALIASES.get(name.strip(), name.strip()) for name in rows[0][1]]
    if "t_s" not in names:
        raise ValueError(f"{path} is no recording: it has no column t_s")
    for number, fields in rows[1:]:
        if len(fields) != len(names):
            raise ValueError(f"{path}, line {number}: {len(fields)} fields, {len(names)} are expected")
    columns = {}
    for index, name in enumerate(names):
        fields = [fields[index] for _, fields in rows[1:]]
        if name == "state":
            columns[name] = np.array(fields, dtype=str)
            continue
        try:
            columns[name] = np.array(fields, dtype=float)
        except ValueError as error:
            raise ValueError(f"{path}, column {name}: {error}") from None
    return Recording(path, notes, columns)


def read_primitive(path):
    """Reads a primitive as a dictionary of its sections; lists of numbers become arrays.

    Raises ValueError where it is no primitive. Its check sum is not verified: `tactus check` does that.
    """
    with open(path, "rb") as file:
        primitive = tomllib.load(file)
    if primitive.get("schema") != SCHEMA:
        raise ValueError(f"{path} is no primitive: its schema is {primitive.get('schema')!r}, not {SCHEMA!r}")
    return _arrays(primitive)


def align(recordings, quantity, points=101, alpha=ALPHA):
    """A quantity of several runs at equal progress of the movement.

    Returns the progress, `points` values from 0 to 1, and an array runs x points x columns. Progress is that of the
    phase, so that runs at different speeds, and runs that were slowed, can be compared. What was not played, of a run
    that was stopped, is NaN. `alpha` is `primitive["movement"]["alpha"]`.

    Raises ValueError where a recording holds no movement, or several: `movements` parts them.
    """
    progress = np.linspace(0, 1, points)
    aligned = []
    for recording in recordings:
        movements = recording.movements()
        if not movements:
            raise ValueError(f"{recording.path} holds no movement: its phase is 0 throughout")
        if len(movements) > 1:
            raise ValueError(f"{recording.path} holds {len(movements)} movements: take one of `movements()`")
        at, values = movements[0].progress(alpha), getattr(movements[0], quantity)
        runs = np.column_stack([np.interp(progress, at, column) for column in values.T])
        runs[(progress < at[0] - REACH) | (progress > at[-1] + REACH)] = np.nan
        aligned.append(runs)
    return progress, np.array(aligned)


def _arrays(value):
    if isinstance(value, dict):
        return {key: _arrays(item) for key, item in value.items()}
    if isinstance(value, list):
        return np.array(value, dtype=float)
    return value
