"""The page of modules is complete."""

from benchmarks import modules


def test_the_page_of_modules_has_every_module_with_the_first_line_of_its_docstring() -> None:
    assert modules.PAGE.read_text("utf-8") == modules.page(), "run make modules"
