"""Sensitivities: derivatives of outputs with respect to numbers, with names, units and estimated errors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mbref.files import replaced, write
from mbref.input_error import InputError
from mbref.motions.files import write_csv
from mbref.motions.motion import Motion
from mbref.motions.trajectory import Outcome
from mbref.records import strict_json

ARRAYS = ("times", "outputs", "parameters", "units", "values", "errors")  # of a file .npz


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities:
    """Derivatives ∂y/∂p of outputs y of a motion by numbers p of its scene, at k sample times.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Sample times, s.
    outputs, parameters : tuple of str
        Names of the o outputs and p numbers.
    units : tuple of tuple of str
        Units (o, p) of the derivatives, such as ``"(J)/(kg)"``; ``SI`` stands for units of ratios and of
        coefficients of functions.
    values : ndarray, shape (k, o, p)
        Derivatives, in the SI unit of the output over the SI unit of the number. NaN where a derivative does
        not exist or was not reached.
    errors : ndarray, shape (k, o, p)
        Estimated absolute errors of the derivatives.
    outcome : Outcome
        COMPLETED; UNDECIDED from a singular position on; otherwise the outcome of the run.
    message : str
        One sentence on an end before the last sample.
    motion : Motion
        The motion at the samples.
    """

    times: np.ndarray
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    units: tuple[tuple[str, ...], ...]
    values: np.ndarray
    errors: np.ndarray
    outcome: Outcome
    message: str
    motion: Motion

    def __repr__(self) -> str:
        o, p = len(self.outputs), len(self.parameters)
        count = f"{o} outputs to {p} numbers at {len(self.times)} samples"
        return f"<Sensitivities of {count}: {self.outcome.label}>"

    def get(self, output: str, parameter: str) -> np.ndarray:
        """Return the derivative of one output by one number.

        Parameters
        ----------
        output, parameter : str
            Names among ``outputs`` and ``parameters``.

        Returns
        -------
        ndarray, shape (k,)
            The derivative at the samples.

        Raises
        ------
        KeyError
            If there is no such output or number; the message lists them.
        """
        for name, known in ((output, self.outputs), (parameter, self.parameters)):
            if name not in known:
                raise KeyError(f"no {name!r}; there are {', '.join(known)}")
        return np.asarray(self.values[:, self.outputs.index(output), self.parameters.index(parameter)])

    def to_record(self) -> dict[str, Any]:
        """Return the attributes by name as numbers, lists and text, for JSON, without the motion.

        Returns
        -------
        dict
            A derivative that does not exist is None.
        """
        arrays = {"values": self.values, "errors": self.errors}
        return {
            "scene": self.motion.scene,
            "times": self.times.tolist(),
            "outputs": list(self.outputs),
            "parameters": list(self.parameters),
            "units": [list(row) for row in self.units],
            **{name: with_none(array) for name, array in arrays.items()},
            "outcome": self.outcome.label,
            "message": self.message,
        }

    def columns(self) -> dict[str, np.ndarray]:
        """Return ``time`` and the derivatives as columns.

        Returns
        -------
        dict of str to ndarray, shape (k,)
            The names are such as ``d(energy)/d(body[rod].mass)``.
        """
        pairs = [(o, p) for o in self.outputs for p in self.parameters]
        return {"time": self.times, **{f"d({o})/d({p})": self.get(o, p) for o, p in pairs}}

    def save(self, path: str | Path) -> None:
        """Write the derivatives: ``.npz`` with arrays and names, ``.json``, or ``.csv`` with columns.

        Parameters
        ----------
        path : str or path
            The file.

        Raises
        ------
        InputError
            If the file has another ending.
        """
        ending = Path(path).suffix.lower()
        if ending == ".csv":
            write_csv(path, self.columns())
        elif ending == ".json":
            write(path, strict_json(self.to_record()) + "\n")
        elif ending == ".npz":
            arrays = {name: np.array(getattr(self, name)) for name in ARRAYS}
            with replaced(path) as fresh, open(fresh, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
        else:
            raise InputError(f"{path}: must end in .npz, .json or .csv")


def with_none(array: np.ndarray) -> list[Any]:
    """Return an array as nested lists, with None for NaN and infinity."""
    found = array.astype(object)
    found[~np.isfinite(array)] = None
    listed: list[Any] = found.tolist()
    return listed
