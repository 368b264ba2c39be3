"""What a program writes into a page stands between two marks, and nothing else of the page changes."""

import pytest

from tissuejax.errors import InputError
from tissuejax.storage import write_between

PAGE = "before\n\n<!-- table -->\nold\n<!-- end -->\n\nafter\n"


def test_what_stands_between_the_marks_is_replaced_and_written_twice_it_is_the_same(tmp_path):
    page = tmp_path / "README.md"
    page.write_text(PAGE)
    for _ in range(2):
        write_between(page, "<!-- table -->", "<!-- end -->", "\n| new |\n")
        assert page.read_text() == PAGE.replace("old", "| new |")


@pytest.mark.parametrize(
    "text",
    [
        "no marks\n",
        PAGE.replace("<!-- end -->", ""),
        PAGE + PAGE,
        "<!-- end -->\n<!-- table -->\n",
    ],
)
def test_a_page_without_its_marks_is_refused_and_left_alone(text, tmp_path):
    page = tmp_path / "README.md"
    page.write_text(text)
    with pytest.raises(InputError, match="once and in this order"):
        write_between(page, "<!-- table -->", "<!-- end -->", "new")
    assert page.read_text() == text
