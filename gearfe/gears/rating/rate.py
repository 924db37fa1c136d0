"""The rating of a mesh: safety factors of flanks and roots with all values that lead to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ...base.config import build
from ...base.errors import InputError
from ...base.shown import ShownTable
from ...base.tables.gearbox import NamedMesh
from ...base.tables.pair import MaterialTable
from ...base.tables.rating import EDITIONS, RatingTable
from ..geometry.mesh_geometry import MeshGeometry
from ..geometry.pair import pair_of
from .data import Load, PairData, Strength, load_of, pair_data, strength_of
from .flank import HIGHEST_RATIO, NOTABLE, TWO_PAIRS, Flank, contact_ratio_factor, flank
from .ledger import Entry, entries
from .load_factors import Influence, influence, speed_range
from .loss import Loss, loss
from .root import NOTCHES, Root, root
from .scuffing import Scuffing, scuffing
from .service import Service, service
from .stiffness import ordered, single_stiffness

#: Steel of the standard (E 206 GPa).
STEEL_TABLE = MaterialTable(youngs_modulus_GPa=206.0, poisson_ratio=0.3, density_kg_per_m3=7830.0)
#: Usual K_gamma of 3 and more planets, IEC 61400-4.
PLANETS = {3: 1.10, 4: 1.25, 5: 1.35, 6: 1.44, 7: 1.47}
#: Sums of profile shifts that the series of the flexibility holds for.
SHIFTS = (-0.5, 2.0)


@dataclass(frozen=True, repr=False)
class Rating(ShownTable):
    """Rating of a mesh by ISO 6336; pairs of values are of gear 1, with fewer teeth, and gear 2.

    Attributes
    ----------
    edition
        Edition of ISO 6336.
    names
        Names of gear 1 and gear 2.
    driver
        0 where gear 1 drives, else 1.
    of_pair
        Numbers of gear 1 and gear 2 in the pair: 0 its pinion, 1 its wheel.
    pair, strengths, load
        What was rated.
    general, flank, root, service, loss
        Factors of general influence; flanks; roots; life under the spectrum; loss factor.
    scuffing
        Temperatures of contact, None: without oil_temperature_C.
    computed
        Symbol -> computation that gave the factor instead of the standard.
    """

    edition: int
    names: tuple[str, str]
    driver: int
    of_pair: tuple[int, int]
    pair: PairData
    strengths: tuple[Strength, Strength]
    load: Load
    general: Influence
    flank: Flank
    root: Root
    service: Service
    loss: Loss
    scuffing: Scuffing | None
    computed: Mapping[str, str] = field(default_factory=dict)

    @property
    def sources(self) -> dict[str, str]:
        """Symbol -> source of each factor K that is not the standard's."""
        load, made = self.load, {}
        if load.dynamic_factor is not None:
            made["K_v"] = "prescribed"
        if load.face_load_factor is not None:
            made["K_Hbeta"] = "prescribed"
        if load.transverse_load_factor is not None:
            made |= dict.fromkeys(("K_Halpha", "K_Falpha"), "prescribed")
        return made | dict(self.computed)

    @property
    def S_H(self) -> tuple[float, float]:
        """Safety factors against pitting."""
        return self.flank.S_H

    @property
    def S_F(self) -> tuple[float, float]:
        """Safety factors of the roots."""
        return self.root.S_F

    def entries(self) -> list[Entry]:
        """All values with their formulas."""
        groups: dict[str, Any] = {
            "influence": self.general,
            "flank": self.flank,
            "root": self.root,
            "life": self.service,
        }
        groups["loss"] = self.loss
        if self.scuffing is not None:
            groups["scuffing"] = self.scuffing
        made = [entry for group, results in groups.items() for entry in entries(group, results)]
        sources = self.sources
        return [
            replace(row, formula=sources[row.name], meaning=f"{row.meaning} ({sources[row.name]})")
            if row.group == "influence" and row.name in sources
            else row
            for row in made
        ]

    def facts(self) -> Mapping[str, str]:
        """Edition, safety factors."""
        return {
            "edition": f"ISO 6336:{self.edition}",
            "S_H": f"{self.S_H[0]:.4g}/{self.S_H[1]:.4g}",
            "S_F": f"{self.S_F[0]:.4g}/{self.S_F[1]:.4g}",
            "gears": "/".join(self.names),
        }

    def columns(self) -> Mapping[str, Iterable[Any]]:
        """All values as a table; a value of the mesh stands for both gears."""
        rows = self.entries()
        values = [row.value if isinstance(row.value, tuple) else (row.value, row.value) for row in rows]
        return {
            "group": [row.group for row in rows],
            "name": [row.name for row in rows],
            "gear_1": [value[0] for value in values],
            "gear_2": [value[1] for value in values],
            "unit": [row.unit for row in rows],
            "formula": [row.formula for row in rows],
            "meaning": [row.meaning for row in rows],
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the standard asks to look at, one sentence each."""
        made: list[str] = []
        pair, general = self.pair, self.general
        where = speed_range(general.N, general.line_load_N_per_mm)
        if where in ("main resonance", "intermediate"):
            made.append(f"N = {general.N:.3g} is in the {where} range: ISO 6336-1 recommends method A for K_v there")
        total = sum(pair.x)
        if not SHIFTS[0] <= total <= SHIFTS[1]:
            made.append(f"x_1 + x_2 = {total:.3g} is beyond -0.5 to 2, the range of c' in ISO 6336-1")
        if pair.eps_alpha < 1.2:
            made.append(f"eps_alpha = {pair.eps_alpha:.3g} < 1.2: c_gamma may be up to 10 % too large (ISO 6336-1)")
        if pair.eps_alpha >= TWO_PAIRS:
            made.append(
                f"eps_alpha = {pair.eps_alpha:.3g} >= 2: Z_B and Z_D are those of the inner points of double pair "
                "contact, on the safe side of even load shares"
            )
            if self.load.oil is not None:
                made.append(
                    f"eps_alpha = {pair.eps_alpha:.3g} >= 2: no rating of scuffing, whose load shares are below 2"
                )
        if self.root.eps_alphan > HIGHEST_RATIO:
            made.append(
                f"eps_alphan = {self.root.eps_alphan:.3g} > {HIGHEST_RATIO:g} is beyond the range of Y_F in ISO 6336-3"
            )
        for name, q_s in zip(self.names, self.root.q_s, strict=True):
            if not NOTCHES[0] <= q_s < NOTCHES[1]:
                made.append(f"q_s = {q_s:.3g} of {name} is beyond 1 to 8, the range of Y_S in ISO 6336-3")
        planets = max(strength.mates for strength in self.strengths)
        if planets in PLANETS and general.K_gamma == 1.0:
            made.append(
                f"K_gamma = 1 for {planets} mates: {PLANETS[planets]:g} is usual for planets (mesh_load_factor)"
            )
        if general.K_Hbeta > NOTABLE:
            made.append(
                f"K_Hbeta = {general.K_Hbeta:.3g} > {NOTABLE:g}: the load is on a part of the width; a computed load "
                "distribution says more (gearfe rating --computed)"
            )
        flank_safety, root_safety = self.load.flank_safety, self.load.root_safety
        least = {"S_H": (self.S_H, flank_safety), "S_F": (self.S_F, root_safety)}
        if self.load.spectrum:
            least["S_H_spectrum"] = self.service.S_H_spectrum, flank_safety
            least["S_F_spectrum"] = self.service.S_F_spectrum, root_safety
        for symbol, (values, required) in least.items():
            for name, value in zip(self.names, values, strict=True):
                if value < required:
                    made.append(f"{symbol} = {value:.4g} of {name} is below the required {required:g}")
        if self.scuffing is not None:
            least_scuffing = self.load.scuffing_safety
            for symbol in ("S_B", "S_intS"):
                value = getattr(self.scuffing, symbol)
                if value is not None and value < least_scuffing:
                    made.append(f"{symbol} = {value:.4g} against scuffing is below the required {least_scuffing:g}")
        return tuple(made)


def rate(
    pair: MeshGeometry,
    table: RatingTable | Mapping[str, Any],
    *,
    materials: tuple[MaterialTable, MaterialTable] = (STEEL_TABLE, STEEL_TABLE),
    names: tuple[str, str] = ("pinion", "wheel"),
    mesh: str = "pinion-wheel",
    torque: float | None = None,
) -> Rating:
    """Rate a mesh by ISO 6336.

    Parameters
    ----------
    pair : GearPair
        The gears; the pinion of the pair drives.
    table : RatingTable or mapping
        Keys of the table [rating]: load, strength, lubricant; see docs/keys.md.
    materials : (MaterialTable, MaterialTable)
        Elastic constants and densities of driver and driven gear.
    names, mesh : (str, str), str
        Names of the gears and of the mesh, under which the table may have keys of their own.
    torque : float, optional
        Torque at the driver (N m) where the table gives none.

    Raises
    ------
    InputError
        For mistakes in the table, and gears beyond the formulas.
    """
    keys = build(RatingTable, table, "rating") if isinstance(table, Mapping) else table
    keys.check("rating")
    return _rated(pair, keys, materials, names, mesh, torque, dict.fromkeys(names), {mesh: None}, (None, None))


def rate_mesh(
    mesh: NamedMesh,
    table: RatingTable,
    gears: Mapping[str, Any],
    meshes: Mapping[str, Any],
    pair: MeshGeometry | None = None,
) -> Rating:
    """Rate a mesh of a job file.

    Parameters
    ----------
    mesh : NamedMesh
        The mesh.
    table : RatingTable
        The table [rating].
    gears, meshes : mapping
        Names of gears and meshes that the file has.
    pair : MeshGeometry, optional
        Its gears, where they were made before.

    Raises
    ------
    InputError
        For mistakes in the table, a gear without material, and gears beyond the formulas.
    """
    for gear in mesh.gears:
        if gear.material is None:
            problem = "has no material: the flank's elasticity factor needs one"
            raise InputError(f"{gear.where}.material", None, problem, "write all gears as [gears.NAME]")
    stiffness = mesh.stiffness.torque_Nm
    made = pair_of(mesh) if pair is None else pair
    materials = tuple(gear.material for gear in mesh.gears)
    names = mesh.driver.name, mesh.driven.name
    torque = None
    drives = 1 if mesh.ring_drives else 0
    if stiffness is not None:  # that of [stiffness] is at the wheel, of this mesh alone
        torque = stiffness * (1.0 if drives else 1.0 / abs(made.gear_ratio))
        torque *= table.of_gear(names[drives], gears).mates or 1
    tables = tuple(gear.microgeometry for gear in mesh.gears)
    driver, driven = (None if flanks is None else flanks.flank(mesh.flank).tip_relief_um for flanks in tables)
    return _rated(made, table, materials, names, mesh.name, torque, gears, meshes, (driver, driven), drives)


def _rated(
    pair: MeshGeometry,
    table: RatingTable,
    materials: tuple[Any, ...],
    names: tuple[str, str],
    mesh: str,
    torque: float | None,
    gears: Mapping[str, Any],
    meshes: Mapping[str, Any],
    reliefs: tuple[float | None, float | None],
    drives: int = 0,
) -> Rating:
    if table.edition not in EDITIONS:
        raise InputError("rating.edition", table.edition, "must be 2006 or 2019", "2019 is the newer one")
    load = load_of(table.of_mesh(mesh, meshes), f"rating.meshes.{mesh}" if mesh in table.meshes else "rating", torque)
    one, other = ordered(pair)
    order = (0, 1) if one is pair.pinion else (1, 0)
    driver = order.index(drives)
    both, names = (one, other), (names[order[0]], names[order[1]])
    elastic = tuple(materials[i] for i in order)
    strengths = tuple(
        strength_of(
            table.of_gear(name, gears),
            gear,
            table.edition,
            f"rating.gears.{name}" if name in table.gears else "rating",
            reliefs[i],
        )
        for name, gear, i in zip(names, both, order, strict=True)
    )
    data, two = pair_data(pair), (strengths[0], strengths[1])
    # torque and speed of gear 1 in this mesh from those of the driver, whose torque its mates share
    ratio, shares = abs(data.u) if driver else 1.0, two[driver].mates
    modulus = 1e9 * elastic[0].youngs_modulus_GPa, 1e9 * elastic[1].youngs_modulus_GPa
    single = 1e-9 * single_stiffness(pair, modulus[0], modulus[1])

    def cycles_of(speed: float, hours: float) -> tuple[float, float]:
        turns = 60.0 * hours * speed * ratio
        return turns * two[0].mates, turns / abs(data.u) * two[1].mates

    cycles = cycles_of(load.speed, load.hours)

    def stressed(torque: float, speed: float) -> tuple[Influence, Flank, Root]:
        """Factors and stresses at a torque (N m) and a speed (1/min) of the driver."""
        general = influence(
            data,
            two,
            load,
            torque=torque / ratio / shares,
            speed=speed * ratio,
            single=single,
            bores=(2e3 * one.held_radius, 2e3 * other.held_radius),
            density=(1e-9 * elastic[0].density_kg_per_m3, 1e-9 * elastic[1].density_kg_per_m3),
            contact_factor=contact_ratio_factor(data),
        )
        of_flank = flank(
            data,
            two,
            load,
            general,
            edition=table.edition,
            modulus=(1e-6 * modulus[0], 1e-6 * modulus[1]),
            poisson=(elastic[0].poisson_ratio, elastic[1].poisson_ratio),
            cycles=cycles,
        )
        return general, of_flank, root(data, two, load, general, edition=table.edition, cycles=cycles)

    general, of_flank, of_root = stressed(load.torque, load.speed)
    parts = [(part.torque_driver_Nm, part.speed_rpm, part.hours) for part in load.spectrum]
    parts = parts or [(load.torque, load.speed, load.hours)]
    made = [stressed(torque, speed) for torque, speed, _ in parts]
    of_service = service(
        {"flank": of_flank.curves, "root": of_root.curves},
        {
            "flank": lambda i: [found[1].sigma_H_MPa[i] for found in made],
            "root": lambda i: [found[2].sigma_F_MPa[i] for found in made],
        },
        lambda i: [cycles_of(speed, hours)[i] for _, speed, hours in parts],
        sum(hours for _, _, hours in parts),
        {"flank": load.flank_safety, "root": load.root_safety},
    )
    heated, losses = None, loss(data)
    if load.oil is not None and data.eps_alpha < TWO_PAIRS:
        heated = scuffing(
            data,
            two,
            load.oil,
            general,
            driver=driver,
            viscosity_40=load.viscosity_40,
            modulus=(1e-6 * modulus[0], 1e-6 * modulus[1]),
            poisson=(elastic[0].poisson_ratio, elastic[1].poisson_ratio),
            eps=losses.eps,
        )
        losses = loss(data, general.F_t_N * general.v_m_per_s * heated.mu_mC)
    return Rating(
        edition=table.edition,
        names=names,
        driver=driver,
        of_pair=order,
        pair=data,
        strengths=two,
        load=load,
        general=general,
        flank=of_flank,
        root=of_root,
        service=of_service,
        loss=losses,
        scuffing=heated,
    )
