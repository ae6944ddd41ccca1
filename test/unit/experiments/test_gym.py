"""The Gymnasium environment, by Gymnasium's own checker."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra `gym`")
NAME = "slip_vic.gym:slip_vic/Carry-v0"


def test_the_environment_passes_the_checker() -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make(NAME, duration_s=0.1).unwrapped, skip_render_check=True)


def test_an_object_without_squeeze_is_lost_and_one_with_squeeze_is_kept_to_the_end() -> None:
    env = gymnasium.make(NAME, duration_s=0.3)
    for squeeze, kept in ((-1.0, False), (0.0, True)):
        env.reset(seed=0)
        rewards, truncated, lost = [], False, False
        while not (truncated or lost):
            action = np.array([0, 0, 0, 0, 0, 0, squeeze], np.float32)
            _, reward, lost, truncated, info = env.step(action)
            rewards.append(reward)
        assert (truncated, lost, info["success"]) == (kept, not kept, False)  # 0.3 s of a path of 2 s
        assert len(rewards) == 30 or lost
    assert rewards[0] == pytest.approx(-0.5 * 0.01, rel=1e-3)  # half of the squeeze for ten periods, and no slip yet
