"""Processes that end for good: who is told, and of what."""

import re

import pytest

from hindrax_bringup.supervisor import Supervisor
from hindrax_bringup.system import Process
from hindrax_core.errors import HindraxError


def test_a_process_that_is_gone_for_good_is_told_with_its_last_words(tmp_path):
    with Supervisor(tmp_path, {}) as supervisor:
        child = supervisor.start(Process("lamps", "p", "no_such_module", "lamps", (), "none", restart=False))
        child.handle.wait(30.0)
        assert re.fullmatch(r"lamps ended with code 1 and stays down; its log is \S+/lamps\.log", *supervisor.check())
        wanted = r"lamps: the process has ended for good; its last words: .*no_such_module'?; look into .*, start again"
        with pytest.raises(HindraxError, match=wanted):
            supervisor.require()
