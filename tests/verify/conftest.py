from __future__ import annotations

import pytest

from postproc.model.model import Model
from tests.verify.judged import own_models


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Model]:
    """The models of the arms of the shipped programs, by cell file."""
    return own_models(tmp_path_factory.mktemp("arms"))
