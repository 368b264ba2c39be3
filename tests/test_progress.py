"""Progress where nobody watches a bar."""

import io

from tissuejax.progress import Lines


def test_a_log_gets_a_line_now_and_then_and_none_of_what_is_quick():
    file = io.StringIO()
    quick = Lines(every=1e6, file=file)
    with quick.stage("fitting", 3) as stage:
        stage.advance(note="r1")
    assert file.getvalue() == ""
    with Lines(every=0.0, file=file).stage("fitting", 3) as stage:
        stage.advance(note="r1")
        stage.advance()
    lines = file.getvalue().splitlines()
    assert [line.split("] ")[1] for line in lines] == ["fitting 1 of 3: r1", "fitting 2 of 3: r1"]
