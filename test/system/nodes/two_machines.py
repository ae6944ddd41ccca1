"""Two nodes of ours, and a stranger on another machine that knows their address: two networks and a cable.

Run by a test. One node stays on its machine, the other may be found: what the stranger hears of that one shows that it
listens at all.
"""

import os
import subprocess
import sys
from pathlib import Path

from slip_msgs_py.environment import PROFILES, RANGE
from test.campaigns.attacks.network import Cable

SPEAKS_S, RATE_HZ = "30", "50"
STRANGER = Path(__file__).with_name("stranger.py")


def main() -> None:
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    unset = {name: value for name, value in os.environ.items() if name not in PROFILES}
    with Cable() as cable:
        speakers = [
            subprocess.Popen(
                [sys.executable, "-m", "test.campaigns.attacks.flood", topic, RATE_HZ, SPEAKS_S],
                env={**unset, RANGE: reach},
            )
            for topic, reach in (("joint_states", "LOCALHOST"), ("wrench", "SUBNET"))
        ]
        try:
            far = {**unset, RANGE: "SUBNET", "ROS_STATIC_PEERS": "10.93.0.1"}
            subprocess.run(cable.behind([sys.executable, str(STRANGER)]), env=far, check=True)
        finally:
            for speaker in speakers:
                speaker.kill()
                speaker.wait()


if __name__ == "__main__":
    main()
