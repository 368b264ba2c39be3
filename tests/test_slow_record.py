"""What is kept of the slow checks."""

from tests.slow_record import record

XML = """<testsuites><testsuite time="12.5">
<testcase classname="tests.a.test_b" name="test_one" time="3.0"/>
<testcase classname="tests.a.test_b" name="test_two[x]" time="9.0"><failure message="no"/></testcase>
<testcase classname="tests.a.test_c" name="test_three" time="0.1"><skipped/></testcase>
</testsuite></testsuites>"""


def test_counts_names_and_times(tmp_path):
    (tmp_path / "slow.xml").write_text(XML)
    found = record(tmp_path / "slow.xml")
    assert (found["passed"], found["failed"], found["skipped"]) == (1, 1, 1)
    assert found["seconds"] == 12.5
    assert found["not passed"] == {"tests/a/test_b::test_two[x]": "failed", "tests/a/test_c::test_three": "skipped"}
    assert next(iter(found["slowest"])) == "tests/a/test_b::test_two[x]"
