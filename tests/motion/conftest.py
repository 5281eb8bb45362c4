from __future__ import annotations

import numpy as np
import pytest

from postproc.robot.arm import Arm, load_arm
from postproc.robot.pose import pose_from_record


@pytest.fixture(scope="session")
def arm() -> Arm:
    return load_arm("nj220-2.7")


@pytest.fixture(scope="session")
def tool() -> np.ndarray:
    return pose_from_record(np.array([30.0, -20.0, 180.0, 0.0, 25.0, 40.0]))


@pytest.fixture(scope="session")
def home(arm: Arm) -> np.ndarray:
    """Joint angles away from every singularity, branch 0, (6,) [rad]."""
    return np.deg2rad([5.0, 5.0, -95.0, 20.0, 50.0, -30.0])
