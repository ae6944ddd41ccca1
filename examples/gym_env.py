"""python examples/gym_env.py        (needs the extra `gym`: pip install gymnasium)

The Gymnasium environment slip_vic/Carry-v0 with a policy in one line: follow the path, squeeze by a third."""

import gymnasium
import numpy as np

env = gymnasium.make("slip_vic.gym:slip_vic/Carry-v0", sensor="vision_60", duration_s=2.5)
observation, info = env.reset(seed=1)
total, over = 0.0, False
while not over:
    correction = 12.0 * observation[:6] + 6.0 * observation[6:12]
    action = np.append(correction / np.repeat([5.0, 20.0], 3), -1 / 3).clip(-1.0, 1.0).astype(np.float32)
    observation, reward, lost, truncated, info = env.step(action)
    total, over = total + float(reward), lost or truncated
print(f"return {total:.3f}, slip {1e3 * info['slip_m']:.2f} mm, {'lost' if lost else 'kept'}")
