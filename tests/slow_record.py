"""Keep what the slow checks said: `make slow` writes `tests/slow.json` from pytest's XML, with date and commit.

python tests/slow_record.py out/slow.xml
"""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path

HERE = Path(__file__).resolve().parent
SLOWEST = 10


def said(case: ET.Element) -> str:
    """How a check ended."""
    for how in ("failure", "error"):
        if case.find(how) is not None:
            return "failed"
    return "skipped" if case.find("skipped") is not None else "passed"


def record(xml: Path) -> dict:
    """Counts, seconds, the slowest checks, and the names of those that failed or were skipped."""
    suites = list(ET.parse(xml).getroot().iter("testsuite"))
    cases = [case for suite in suites for case in suite.iter("testcase")]
    names = {f"{c.get('classname', '').replace('.', '/')}::{c.get('name')}": c for c in cases}
    ends = {name: said(case) for name, case in names.items()}
    by_time = sorted(names, key=lambda name: -float(names[name].get("time", 0)))
    git = ["git", "-C", str(HERE), "rev-parse", "--short=7", "HEAD"]
    changed = ["git", "-C", str(HERE), "status", "--porcelain", "--", "../tissuejax", ".", ":!slow.json"]
    commit = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    dirty = "-dirty" * bool(subprocess.run(changed, capture_output=True, text=True).stdout.strip())
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit + dirty,
        "seconds": round(sum(float(s.get("time", 0)) for s in suites), 1),
        **{how: sum(e == how for e in ends.values()) for how in ("passed", "failed", "skipped")},
        "not passed": {name: end for name, end in ends.items() if end != "passed"},
        "slowest": {name: round(float(names[name].get("time", 0)), 1) for name in by_time[:SLOWEST]},
    }


if __name__ == "__main__":
    found = record(Path(sys.argv[1]))
    (HERE / "slow.json").write_text(json.dumps(found, indent=1) + "\n")
    print(f"{found['passed']} passed, {found['failed']} failed, {found['skipped']} skipped: tests/slow.json")
