"""What all runs of an experiment share: texts of files and versions. It goes to every worker, and into the plan."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from slip_core.errors import SlipVicError
from slip_core.files.urdf_file import read_urdf
from slip_vic.experiments.rows import difference
from slip_vic.presets import preset_text
from slip_vic.run.versions import digest, versions
from slip_vic.scenarios.scenario import Texts, load_scenario, read_scenario


class MixedVersions(SlipVicError):
    """A worker that does not run what the study runs."""

    exit_code = 2


@dataclass(frozen=True, slots=True)
class Contents:
    """What all runs share.

    texts: of scenarios, sensors and arms; versions: of the code, by name; more: digests of whatever else rows depend
    on, by name.
    """

    texts: Texts
    versions: Mapping[str, str]
    more: Mapping[str, str] = field(default_factory=dict)

    @property
    def made_of(self) -> dict[str, str]:
        """Versions, and the digest of every text, by name."""
        kinds = {"scenario": self.texts.scenarios, "sensor": self.texts.sensors, "arm": self.texts.urdfs}
        digests = {
            f"{kind} {name}": digest([text.encode()]) for kind, texts in kinds.items() for name, text in texts.items()
        }
        return {**self.versions, **digests, **self.more}


def gather(scenarios: Iterable[str], sensors: Iterable[str], assignments: Sequence[str]) -> Contents:
    """Read every file that worlds need.

    Raises:
        InputError: an unknown name, a file that cannot be read, a bad override.
    """
    scenarios = list(scenarios)
    files = {
        params.robot_description_file
        for name in scenarios
        for params in load_scenario(name, assignments=assignments).bridges.values()
    }  # fmt: skip
    texts = Texts(
        scenarios={name: read_scenario(name)[0] for name in scenarios},
        sensors={name: preset_text("sensors", name) for name in sensors if name},
        urdfs={file: read_urdf(file, "parameter robot_description_file") for file in sorted(files)},
    )
    return Contents(texts, versions())


def check_versions(wanted: Mapping[str, str]) -> None:
    """Compare what runs here with what a study runs.

    Raises:
        MixedVersions: names what differs.
    """
    other = difference(wanted, versions())
    if other:
        raise MixedVersions(
            f"worker on {platform.node()}: got {other[0]} {versions().get(other[0], 'missing')}, expected "
            f"{wanted[other[0]]}, as where the study was started; install the same there"
        )
