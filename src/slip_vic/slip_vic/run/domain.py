"""Choose a ROS domain: locked while in use, and without other nodes.

A lock is a file because it must hold across network namespaces; the ports of DDS do not. The ports show the nodes that
are not of this suite.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from slip_core.compiled import make_folder, user_cache
from slip_core.errors import InputError, ProtocolError
from slip_vic.run.lock import TakenError, is_locked, locked

# Above 101 the DDS ports reach into Linux's ephemeral range; 0 is everybody's default.
FIRST, LAST = 1, 101
PORT: Final = 7400
"""First UDP port of domain 0; each domain has `PORTS` of them (RTPS 2.5, 9.6.2.3)."""
PORTS: Final = 250
LISTEN_S: Final = 3.5
"""How long to listen for other publishers [s]: every DDS participant announces itself each 3 s."""
_turns = itertools.count(os.getpid())  # the next run gets the next domain: nothing of the last one is under way


@contextlib.contextmanager
def domain_id(wanted: int | None = None, namespace: str = "") -> Iterator[int]:
    """Hold a domain id for a namespace: the wanted one, or one in which there is no other process of this machine.

    Raises:
        InputError: a run of this suite has the wanted one; the folder of the locks cannot be made.
        ProtocolError: all ids are taken, or locks cannot be written.
    """
    folder = user_cache() / "domains"
    make_folder(folder)
    count, turn, kept = LAST - FIRST + 1, next(_turns), contextlib.ExitStack()
    taken = domains_in_use() if wanted is None else []
    for candidate in [FIRST + (turn + k) % count for k in range(count)] if wanted is None else [wanted]:
        path = folder / f"{candidate}.{namespace.strip('/').replace('/', '.')}"
        if wanted is None and (candidate in taken or has_nodes(candidate)):
            continue
        try:
            kept.enter_context(locked(path))
        except TakenError as owner:
            if wanted is not None:
                fix = "wait for it, or give another --domain-id or --namespace"
                raise InputError(f"ROS domain {wanted}", got=f"a run, {owner}", expected="one run", fix=fix) from None
        except OSError as error:
            raise ProtocolError(f"lock {path}: {error.strerror}; set XDG_CACHE_HOME to a folder of yours") from None
        else:
            with kept:
                os.utime(path)
                yield candidate
            return
    raise ProtocolError(f"all ROS domain ids from {FIRST} to {LAST} are in use; give --domain-id")


def domains_in_use() -> list[int]:
    """Return the domain ids that this user's runs of the suite hold, the newest first."""
    found = [path for path in (user_cache() / "domains").glob("*.*") if is_locked(path)]
    return [int(path.name.partition(".")[0]) for path in sorted(found, key=lambda path: -path.stat().st_mtime)]


def has_nodes(domain: int) -> bool:
    """Return whether a process of this machine has a port of a domain, whatever DDS it uses."""
    tables = [Path(f"/proc/net/{name}") for name in ("udp", "udp6")]
    lines = [line for table in tables if table.exists() for line in table.read_text().splitlines()[1:]]
    ports = (int(line.split()[1].rpartition(":")[2], 16) for line in lines)
    return any((port - PORT) // PORTS == domain for port in ports)


def check_alone(domain: int, topics: Iterable[str]) -> None:
    """Listen before a run joins a domain: no other node may publish on its topics.

    topics: with their namespace. Where DDS stays on this machine, its ports show whether other nodes exist.

    Raises:
        InputError: another node publishes on one of them.
    """
    from slip_msgs_py.environment import choose_transport
    from slip_msgs_py.node_main import ros_node

    if choose_transport() and not has_nodes(domain):
        return
    names, until, heard = [*topics], time.monotonic() + LISTEN_S, ""
    with ros_node("slip_vic_listens", domain=domain) as node:
        while time.monotonic() < until and (not heard or "UNKNOWN" in heard):  # a topic is heard before its node
            found = ((name, info) for name in names for info in node.get_publishers_info_by_topic(name))
            for name, other in itertools.islice(found, 1):
                heard = f"node {other.node_namespace.rstrip('/')}/{other.node_name}, which publishes {name}"
            time.sleep(0.05)
    if heard:
        fix = "stop it, or give another --domain-id or --namespace"
        raise InputError(f"ROS domain {domain}", got=heard, expected="no other publisher of it", fix=fix)
