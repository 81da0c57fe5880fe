"""Every file that the program writes has the checksum recorded in goldens.json."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
try:
    import record
finally:
    sys.path.remove(str(Path(__file__).parent))

GOLDENS = json.loads(record.GOLDENS.read_text()) if record.GOLDENS.exists() else {}


def test_every_group_is_recorded():
    assert set(GOLDENS) == set(record.GROUPS)


@pytest.mark.parametrize("group", record.GROUPS)
def test_files_have_the_recorded_checksums(group):
    now, then = record.record(group), GOLDENS[group]
    assert set(now) == set(then)
    assert {name for name in now if now[name] != then[name]} == set()
