"""Signals of a run that goes by, with nothing folded into them: filtered and thinned out as those of its spectrum."""

from __future__ import annotations

import numpy as np

from ..record_spectrum import low_pass
from ..train.response import TrainResponse
from ..typing import Array


class Tracked:
    """Contact forces, transmission errors and attachments' accelerations, and the drive's angle.

    The signals pass the low-pass filter of `gearfe.record_spectrum`, and every (m/2)-th sample is kept, m in an output
    step: up to half the output's sampling frequency nothing is folded into them. Beyond its ends the run is held.

    Parameters
    ----------
    every
        Samples of the response in an output step: 1, or an even number.
    step
        Output step (s).
    """

    def __init__(self, every: int, step: float) -> None:
        self.keep = max(1, every // 2)
        self.step = step * self.keep / every
        self.highest = 0.5 / step
        self.names: tuple[str, ...] = ()
        self._filter = low_pass(self.keep)
        self._half = len(self._filter) // 2
        self._buffer = np.zeros((0, 0))
        self._arrived = 0  # samples
        self._rows: list[Array] = []
        self._angles: list[Array] = []
        self._start = 0.0

    def add(self, piece: TrainResponse) -> None:
        """Take the samples that follow those taken before."""
        if not len(piece.time):
            return
        columns = signals(piece)
        values = np.column_stack(list(columns.values()))
        if not self.names:
            self.names, self._start = tuple(columns), float(piece.time[0])
            self._buffer = np.repeat(values[:1], self._half, axis=0)
        self._angles.append(piece.drive_angle[-self._arrived % self.keep :: self.keep])
        self._arrived += len(values)
        self._pass(values)

    def _pass(self, values: Array) -> None:
        """Filter what is complete; row i of the buffer is centred half a filter later."""
        x = np.concatenate([self._buffer, values])
        width = 2 * self._half + 1
        if len(x) < width:
            self._buffer = x
            return
        seen = np.lib.stride_tricks.sliding_window_view(x, width, axis=0)[:: self.keep]
        self._rows.append(np.asarray(seen @ self._filter) / self._filter.sum())
        self._buffer = x[len(seen) * self.keep :]

    def finished(self) -> tuple[Array, Array, Array]:
        """Times (n,), angles of the drive (n,) and signals (n, s)."""
        angle = np.concatenate(self._angles) if self._angles else np.zeros(0)
        made = list(self._rows)
        if len(self._buffer):
            x = np.concatenate([self._buffer, np.repeat(self._buffer[-1:], self._half + self.keep, axis=0)])
            seen = np.lib.stride_tricks.sliding_window_view(x, 2 * self._half + 1, axis=0)[:: self.keep]
            made.append(np.asarray(seen @ self._filter) / self._filter.sum())
        values = np.concatenate(made)[: len(angle)] if made else np.zeros((0, 0))
        return self._start + self.step * np.arange(len(angle)), angle, values


def signals(piece: TrainResponse) -> dict[str, Array]:
    """Columns that are tracked, by the names of response.csv."""
    made = {f"contact_force_{i + 1}_N": force for i, force in enumerate(piece.contact_force.T)}
    made |= {f"transmission_error_{i + 1}_um": 1e6 * error for i, error in enumerate(piece.transmission_error.T)}
    for name, moved in zip(piece.attachment_names, piece.attachment_acceleration.T, strict=True):
        made[f"attachment_{name}_acceleration_m_per_s2"] = moved
    return made
