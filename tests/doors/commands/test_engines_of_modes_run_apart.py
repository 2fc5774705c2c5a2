"""`crosscheck modes` runs each engine in a process of its own."""

import json

from crosscheck.cli import main
from tests.helpers.fake_engines import FAKES


def test_modes_reports_the_crash_of_one_engine_and_hides_the_banner_of_another(capfd):
    """The engine SEGFAULT ends its process by SIGSEGV. CHATTER, version 1.2.3, writes the word "banner" to
    the file descriptor of standard output, and has no accelerations."""
    engines = [word for name in ("SEGFAULT", "CHATTER") for word in ("--engine", f"{FAKES}:{name}")]
    assert main(["modes", "point_pendulum", "--starts", "1", "--json", *engines]) == 0
    out, said = capfd.readouterr()
    crashed, silent = json.loads(out)["poses"][0]["results"]
    assert "SIGSEGV" in crashed["reason"] and crashed["error"] is None
    assert (silent["version"], silent["reason"]) == ("1.2.3", "reports no accelerations")
    assert "banner" not in out + said
