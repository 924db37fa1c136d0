"""The [study] table: a base job, what is varied in it, and what is kept of each case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..config import quantity
from ..errors import InputError, unknown_name

#: Kinds of job that a study can vary.
KINDS = ("stiffness", "loadmap", "vibration", "runup", "modes", "mechanism")
DESIGNS = ("factorial", "latin_hypercube", "sobol", "saltelli", "morris", "rows", "search")


@dataclass(frozen=True)
class DistributionTable:
    """One parameter: even between two ends, or normal, and then cut off where ends are given."""

    low: float | None = quantity(None, doc="lower end, in the unit of the key")
    high: float | None = quantity(None, doc="upper end")
    mean: float | None = quantity(None, doc="mean of a normal distribution")
    standard_deviation: float | None = quantity(None, above=0.0, doc="its standard deviation")
    iso_class: int | None = quantity(
        None,
        low=1,
        high=11,
        doc="for profile_slope_um and helix_slope_um: normal about mean, cut off at the tolerance of this class of ISO "
        "1328-1",
    )
    count: int | None = quantity(None, low=2, high=100_000, doc="even steps from low to high for a factorial design")
    tolerance: float = quantity(0.0, low=0.0, doc="+- of manufacture: a search reports the outputs at its ends")
    also: tuple[str, ...] = quantity((), doc="dotted names of further keys that take the same value")

    def check(self, where: str) -> None:
        """Ends or mean and standard deviation, not half of them; or a class."""
        if self.iso_class is not None:
            for name in ("low", "high", "standard_deviation", "count"):
                if getattr(self, name) is not None:
                    problem = "conflicts with iso_class"
                    raise InputError(
                        f"{where}.{name}", getattr(self, name), problem, "the class gives it: leave it out"
                    )
            return
        for one, other in (("mean", "standard_deviation"), ("standard_deviation", "mean")):
            if getattr(self, one) is not None and getattr(self, other) is None:
                raise InputError(f"{where}.{other}", None, f"is required with {one}", "add it")
        if self.mean is None:
            for name in ("low", "high"):
                if getattr(self, name) is None:
                    cure = "give low and high, mean and standard_deviation, or a list of values"
                    raise InputError(f"{where}.{name}", None, "is required", cure)
        elif self.count is not None:
            raise InputError(f"{where}.count", self.count, "conflicts with mean", "steps are even between low and high")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise InputError(f"{where}.high", self.high, f"must be > low = {self.low:g}", "swap them")


@dataclass(frozen=True)
class LimitTable:
    """Between which values an output is good."""

    low: float | None = quantity(None, doc="least good value")
    high: float | None = quantity(None, doc="largest good value")

    def check(self, where: str) -> None:
        """At least one end."""
        if self.low is None and self.high is None:
            raise InputError(f"{where}.high", None, "is required", "give low, high or both")


@dataclass(frozen=True)
class StudyTable:
    """Many cases of one job."""

    job: str = quantity(choices=KINDS, doc="kind of job, the name of its command (a microgeometry is a loadmap)")
    base: str | None = quantity(
        None,
        doc="job file that is varied, next to this one; left out: the job is in the other tables of this file",
    )
    mesh: str | None = quantity(None, doc="mesh of a stiffness or loadmap job that has several, by its name")
    design: str = quantity(
        "latin_hypercube",
        choices=DESIGNS,
        doc="factorial: all combinations; latin_hypercube, sobol: random cases; saltelli: cases for Sobol "
        "indices; morris: cases for elementary effects; rows: a CSV file; search: the best value of the "
        "output in minimise or maximise within the limits",
    )
    cases: int = quantity(
        64,
        low=1,
        high=10_000_000,
        doc="number of random cases; saltelli: base points; morris: trajectories; "
        "search: points at most, those at the tolerances included",
    )
    seed: int = quantity(1, low=0, doc="seed of the random cases")
    rows_csv: str | None = quantity(None, doc="CSV file whose columns are named as the keys, for design = rows")
    parameters: dict[str, Any] = quantity(  # noqa: RUF009
        dict, doc="dotted name of a key of the job -> list of values, or low and high, mean and deviation, or iso_class"
    )
    worst_over: dict[str, Any] = quantity(  # noqa: RUF009
        dict,
        doc="dotted name of a key -> list of values. Each case is solved at all their combinations, and the worst "
        "value of each output counts: the smallest for outputs in maximise or with a lower limit only, "
        "otherwise the largest",
    )
    outputs: dict[str, str] = quantity(  # noqa: RUF009
        doc="name -> expression of the job's columns and of summary, as `ptp(transmission_error_um)`"
    )
    limits: dict[str, LimitTable] = quantity(dict, doc="output -> low and high of good cases, for the yield")  # noqa: RUF009
    minimise: tuple[str, ...] = quantity((), doc="outputs of which less is better, for the Pareto set")
    maximise: tuple[str, ...] = quantity((), doc="outputs of which more is better, for the Pareto set")
    estimate: bool = quantity(False, doc="true: with the error estimates of the job, where it has some")

    def check(self, where: str) -> None:
        """Rules that join several keys."""
        if self.mesh is not None and self.job not in ("stiffness", "loadmap"):
            problem = f"conflicts with job = {self.job!r}, which has all meshes"
            raise InputError(f"{where}.mesh", self.mesh, problem, "leave it out")
        if not self.outputs:
            raise InputError(f"{where}.outputs", None, "is empty", "name at least one output")
        for name in self.outputs:
            if not name.isidentifier():
                problem = "must be a word of letters, digits and _ (it becomes a column)"
                raise InputError(f"{where}.outputs", name, problem, "rename it")
        for key in ("limits", "minimise", "maximise"):
            for name in getattr(self, key):
                if name not in self.outputs:
                    raise unknown_name(f"{where}.{key}", name, self.outputs)
        for name in self.minimise:
            if name in self.maximise:
                raise InputError(f"{where}.maximise", name, "is also in minimise", "leave one of them out")
        rows = self.design == "rows"
        if rows and self.rows_csv is None:
            raise InputError(f"{where}.rows_csv", None, 'is required with design = "rows"', "name the CSV file")
        if rows and self.parameters:
            problem = 'conflicts with design = "rows"'
            raise InputError(f"{where}.parameters", None, problem, "the CSV file's columns are the parameters")
        if not rows and self.rows_csv is not None:
            problem = f"conflicts with design = {self.design!r}"
            raise InputError(f"{where}.rows_csv", self.rows_csv, problem, 'use design = "rows"')
        if not rows and not self.parameters:
            raise InputError(f"{where}.parameters", None, "is empty", "vary at least one key of the job")
