from __future__ import annotations

from collections.abc import Iterator

import pytest

from postproc.model.model import Model
from tests.verify.judged import own_models
from tests.verify.remembered import remember_all


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Model]:
    """The models of the arms of the shipped programs, by cell file."""
    return own_models(tmp_path_factory.mktemp("arms"))


@pytest.fixture(scope="package", autouse=True)
def remembered() -> Iterator[None]:
    """Find every time law and way of these tests once."""
    with pytest.MonkeyPatch.context() as patch:
        remember_all(patch)
        yield
