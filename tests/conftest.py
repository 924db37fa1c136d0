"""Keep meshes that tests make in an ignored folder of the repository; print failing tests as they fail."""

import os
import signal
from collections.abc import Iterator

import pytest

from tests.places import ROOT

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell without job control starts what runs behind it so
    signal.signal(signal.SIGINT, signal.default_int_handler)  # commands under test inherit it and would ignore Ctrl-C
os.environ.setdefault("GEARFE_CACHE", str(ROOT / ".test_cache"))
#: A list of fonts of its own: one that another environment wrote may lack the fonts that Matplotlib brings along.
os.environ.setdefault("MPLCONFIGDIR", str(ROOT / ".test_cache" / "matplotlib"))


class FailuresAsTheyHappen:
    """Print the name of each failing test when it fails: a run of minutes then need not end to be of use."""

    def __init__(self, terminal: pytest.TerminalReporter) -> None:
        self.terminal = terminal

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.terminal.ensure_newline()
            self.terminal.write_line(f"FAILED ({report.when}) {report.nodeid}", red=True)


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    if terminal is not None and not hasattr(config, "workerinput"):
        config.pluginmanager.register(FailuresAsTheyHappen(terminal))


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """An empty cache for the tests of a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GEARFE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
