import pytest

from postproc.exceptions import PostprocError
from postproc.simulation import NAMES, Planted, parse_effects


def test_names_joints_and_sizes() -> None:
    assert parse_effects("lag, scale@3,windup=0.1 ,coupling@5=2e-1") == (
        Planted("lag"),
        Planted("scale", 3),
        Planted("windup", 0, 0.1),
        Planted("coupling", 5, 0.2),
    )
    assert parse_effects(["lag", Planted("scale", 2)])[1] == Planted("scale", 2)
    assert parse_effects("") == ()
    assert {item.name for item in parse_effects("all")} == set(NAMES)


@pytest.mark.parametrize("text", ["rust", "scale@7", "scale@x", "lag=big", "lag=-1"])
def test_what_does_not_exist_is_refused_with_the_names(text: str) -> None:
    with pytest.raises(PostprocError, match="tracker_drift"):
        parse_effects(text)
