"""The table of what the suite runs."""

import json

from tests.coverage_table import table


def test_a_line_counts_that_any_part_ran_and_the_least_covered_come_first(tmp_path):
    one = {"a.py": ([1, 2], [3, 4]), "b.py": ([1], [2, 3, 4])}
    two = {"a.py": ([2, 3], [1, 4])}
    meta = {"software": "slipcover", "branch_coverage": False, "show_contexts": False}
    for name, part in {"one": one, "two": two}.items():
        files = {f: {"executed_lines": run, "missing_lines": missed} for f, (run, missed) in part.items()}
        (tmp_path / name).write_text(json.dumps({"meta": meta, "files": files, "summary": {}}))
    lines = [line.split() for line in table([tmp_path / "one", tmp_path / "two"]).splitlines()]
    assert [(line[0], line[1], line[3], line[5]) for line in lines] == [
        ("b.py", "4", "3", "25"),
        ("a.py", "4", "1", "75"),
        ("TOTAL", "8", "4", "50"),
    ]
    assert table([tmp_path / "one"], 1).split()[0] == "b.py"
