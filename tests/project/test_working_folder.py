"""Files of strangers beside a job: modules, settings of libraries, options of the mesher. None of them may act."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from gearfe.cli import COMMANDS
from gearfe.study.run import processes
from tests.makers.studies import written
from tests.places import GEOMETRY, MESHES

#: What the installed program is: a script in a folder of its own.
SCRIPT = "import sys\nfrom gearfe.cli.main import main\nif __name__ == '__main__':\n    sys.exit(main())\n"
#: Reports that it was imported, wherever that happens.
HOSTILE = "open({mark!r}, 'a').write(__name__ + '\\n')\n"
#: Name of a library's file of settings -> settings that change pictures, end imports, or run a command in gmsh.
SETTINGS = {
    "matplotlibrc": b"figure.facecolor: red\ntext.usetex: True\nbackend: module://hostile\n\xff\xfe\n",
    ".numba_config.yaml": b"disable_jit: 1\n]\n",
    "ezdxf.ini": "[core]".encode("utf-16"),
    **dict.fromkeys(
        [".gmshrc", "gmshrc", ".gmsh-options", "gmsh-options", "box.msh.opt"], b"SystemCall 'touch RAN';\n"
    ),
}
COARSE = ["--set", "stiffness.coarsen=4"]
BOX = [*COARSE, "--set", "housing.reduction.modes_below_Hz=2000"]
#: Command -> lines that reach its libraries and its child processes.
LINES = {
    "stiffness": [["gear_train.toml", *COARSE, "--angles", "0", "9", "9", "--fields", "0", "--no-estimate"]],
    "loadmap": [["gear_train.toml", *COARSE, "--torques-Nm", "50", "--positions", "3", "--law", "half_plane"]],
    "gear": [["gear_train.toml", "--export", "dxf"]],
    "rating": [["gear_train.toml", "--set", "rating={torque_driver_Nm=50,speed_rpm=900}"]],
    "mesh": [["gear_train.toml", *COARSE, "--out", "gears.msh"]],
    "mechanism": [["slider_crank.toml", "--until", "0.02"]],
    "housing": [["box.toml", *BOX, "--modes", "2"]],
    "vibration": [["box.toml", *BOX, "--set", "train.duration_ms=0.7", "--fields", "--no-estimate", "--no-floquet"]],
    "modes": [["box.toml", *BOX, "--fields", "1", "--speed-stop-rad-per-s", "300"]],
    "runup": [["box.toml", *BOX, "--set", "runup={speed_start_rad_per_s=200,speed_stop_rad_per_s=210,speeds=2}"]],
    "study": [["study.toml", "--jobs", "2"], ["search.toml", "--jobs", "2"]],
    "compare": [["one.csv", "two.csv"]],
    "report": [["gear_train.toml", "--results", "done"]],
    "new": [["vibration", "new.toml"]],
    "cache": [[]],
    "completion": [["bash"]],
}
SEARCH = """
[study]
job = "mechanism"
base = "base.toml"
design = "search"
cases = 20
minimise = ["f"]
[study.parameters]
bodies.a.position_m.0 = { low = -3.0, high = 3.0, tolerance = 0.5 }
[study.outputs]
f = "(x1[0] - 1)**2"
"""
#: Prints the modules that Python loads before it runs a module.
PROBE = "import sys\nprint(*{name.partition('.')[0] for name in sys.modules})\n"


def names_of_modules() -> set[str]:
    """Names under which the program and its libraries import anything."""
    return (
        {"gearfe", "sitecustomize", "usercustomize"} | sys.stdlib_module_names | set(metadata.packages_distributions())
    )


def hostile(folder: Path, names: set[str]) -> Path:
    """A folder with modules of these names and settings of libraries; return the file that shows what has run."""
    mark = folder / "RAN"
    for name in names:
        (folder / f"{name}.py").write_text(HOSTILE.format(mark=str(mark)))
    for name, content in SETTINGS.items():
        (folder / name).write_bytes(content)
    return mark


def jobs(folder: Path) -> None:
    """Jobs for all commands beside them."""
    for path in (GEOMETRY / "gear_train.toml", *GEOMETRY.glob("slider_crank*"), *MESHES.glob("box.*")):
        shutil.copy(path, folder)
    written(folder)
    (folder / "search.toml").write_text(SEARCH)
    (folder / "done").mkdir()
    for name in ("one", "two", "done/stiffness"):
        (folder / f"{name}.csv").write_text("pinion_angle_deg,k_mesh_N_per_m\n0,1e8\n9,2e8\n")


def program(tmp_path: Path) -> list[str]:
    """The program as it is installed."""
    (tmp_path / "bin").mkdir(exist_ok=True)
    (tmp_path / "bin" / "gearfe").write_text(SCRIPT)
    return [sys.executable, str(tmp_path / "bin" / "gearfe")]


def ran(line: list[str], folder: Path, **environment: str) -> str:
    """Output of a program in this folder."""
    done = subprocess.run(
        line, cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


def test_every_command_is_tried() -> None:
    assert LINES.keys() == COMMANDS.keys()


@pytest.mark.parametrize("command", LINES)
def test_nothing_beside_a_job_runs(command: str, tmp_path: Path) -> None:
    folder = tmp_path / "jobs"
    folder.mkdir()
    jobs(folder)
    mark = hostile(folder, names_of_modules())
    for line in LINES[command]:
        ran([*program(tmp_path), command, *line], folder)
    assert not mark.exists(), mark.read_text()


@pytest.mark.parametrize("before", [("-m", "gearfe"), ("-E", "-m", "gearfe"), ("-P", "-m", "gearfe")])
def test_nothing_beside_a_job_runs_by_python_m(before: tuple[str, ...], tmp_path: Path) -> None:
    """Nor in the processes of a study. What Python loads for ``-m`` itself is found in the folder first, without -P."""
    folder = tmp_path / "jobs"
    folder.mkdir()
    (folder / "probe.py").write_text(PROBE)
    first = set() if "-P" in before else {"gearfe", *ran([sys.executable, "-m", "probe"], folder).split()}
    jobs(folder)
    mark = hostile(folder, names_of_modules() - first)
    for line in (["study", "study.toml", "--jobs", "2"], ["gear", "gear_train.toml"]):
        ran([sys.executable, *before, *line], folder)
    assert not mark.exists(), mark.read_text()


def test_relative_entries_of_the_path_of_modules_are_left(tmp_path: Path) -> None:
    """An empty entry of PYTHONPATH, as many a shell's start file writes one, is the working folder."""
    folder = tmp_path / "jobs"
    folder.mkdir()
    jobs(folder)
    mark = hostile(folder, {"numpy", "json", "random", "matplotlib", "signal", "multiprocessing", "tomllib"})
    for entries in (f"{os.pathsep}{tmp_path}", "."):
        ran([*program(tmp_path), "study", "study.toml", "--jobs", "2"], folder, PYTHONPATH=entries)
    assert not mark.exists(), mark.read_text()


def test_settings_beside_a_job_and_of_the_user_change_no_picture(tmp_path: Path) -> None:
    pictures = []
    for name in ("plain", "beside", "user"):
        folder = tmp_path / name
        folder.mkdir()
        jobs(folder)
        environment = {"HOME": str(tmp_path), "MPLCONFIGDIR": str(tmp_path / "settings")}
        if name == "beside":
            hostile(folder, set())
        if name == "user":
            (tmp_path / "matplotlibrc").write_text("figure.facecolor: red\ntext.usetex: True\n")
            environment |= {"MATPLOTLIBRC": str(tmp_path / "matplotlibrc"), "MPLBACKEND": "hostile"}
        ran([*program(tmp_path), "gear", "gear_train.toml", "--out", "out"], folder, **environment)
        pictures.append((folder / "out" / "gear_pair.png").read_bytes())
    assert pictures[0] == pictures[1] == pictures[2]


COMPILED = """
from gearfe.multibody.compiled.object_code import import_numba
numba = import_numba()
assert numba.njit(lambda x: x + 1)(1) == 2
assert not numba.config.DISABLE_JIT
"""


def test_settings_of_numba_beside_a_job_are_not_read(tmp_path: Path) -> None:
    """Numba looks for them as it loads, and before each compilation."""
    pytest.importorskip("numba")
    pytest.importorskip("yaml")
    (tmp_path / ".numba_config.yaml").write_text("disable_jit: 1\n")
    ran([sys.executable, "-P", "-c", COMPILED], tmp_path)


def test_processes_go_back_to_the_working_folder() -> None:
    """Names of files in a job are relative to it, in every process."""
    before = Path.cwd()
    with processes(1) as pool:
        assert pool.submit(os.getcwd).result() == str(before)
    assert Path.cwd() == before
