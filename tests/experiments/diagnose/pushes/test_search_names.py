"""The progress of a diagnosis says in which search it is, and what is new in it."""

from golden import golden

from experiments.diagnose.core.search_names import differ_words, named_search, new_in_course


def test_a_search_is_named_by_its_number_and_by_what_is_new_in_it():
    told = []
    for number, new in ((0, ""), (1, differ_words(["bed"])), (2, "times jitter"), (11, "")):
        named_search(lambda what, done: told.append((what, done)), number, new)("trying layering", 0.5)
    assert [done for _, done in told] == [0.5] * 4
    golden("diagnose/search_names", [what for what, _ in told])


def test_kinds_of_scatter_and_courses_are_listed_in_words():
    assert differ_words(["a", "b", "c"]).endswith("b and c")
    assert new_in_course(aside=(), looked_at=(), with_wander=False) == ""
    assert new_in_course(aside=(1,), looked_at=("2",), with_wander=True).count(", ") == 2
