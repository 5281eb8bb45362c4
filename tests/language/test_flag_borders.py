"""Which flags the last digits of a target may decide."""

import numpy as np

from postproc.language.krl.pose_encoding import KRL_DIALECT
from postproc.language.rapid.pose_encoding import RAPID_DIALECT
from postproc.robot.cell import load_cell
from tests.any_controller import any_controller, told
from tests.bench.languages import milled, written
from tests.conftest import CELL
from tests.language.neutral_job import compensated

AWAY = np.deg2rad([20.0, -25.0, -110.0, 30.0, 50.0, 20.0])


def beside(joint: int, degrees: float) -> np.ndarray:
    q = AWAY.copy()
    q[joint] = np.deg2rad(degrees)
    return q


def test_krl_counts_borders_at_0_of_all_axes():
    q = np.array([AWAY, beside(1, 0.05), beside(3, 90.05), beside(2, -0.09)])
    assert KRL_DIALECT.rounding_decides(q).tolist() == [False, True, False, True]


def test_rapid_counts_quarter_turns_of_joints_1_4_and_6():
    q = np.array([AWAY, beside(1, 0.05), beside(3, 90.05), beside(5, -179.95)])
    assert RAPID_DIALECT.rounding_decides(q).tolist() == [False, False, True, True]


def test_a_straight_wrist_and_unknown_joints_are_always_solved():
    unknown = np.full(6, np.nan)
    q = np.array([beside(4, 1.0), beside(4, 179.5), unknown])
    assert KRL_DIALECT.rounding_decides(q).all()


def test_nothing_changes_where_rounding_does_not_decide(
    tmp_path, job_model, monkeypatch
):
    (tmp_path / "cell.toml").write_text(told(CELL))
    cell = any_controller(load_cell(tmp_path / "cell.toml"))
    texts = written(milled(cell, 40))
    for name, files in texts.items():
        fast = compensated(name, files, cell, job_model).outputs
        with monkeypatch.context() as patch:
            patch.setattr(
                "postproc.language.pose_encoding.BESIDE", 10.0
            )  # all are solved
            slow = compensated(name, files, cell, job_model).outputs
        assert fast == slow
