"""One recorded topic's subscription, following the QoS of publishers that come and go.

It requests reliable or transient local only where every publisher offers it. Where that changes, the new
subscription is opened before the old one is closed, and what both bring is taken once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from rclpy.node import Node

from slip_bags.format import QosProfile
from slip_bags.recording.raw_subscription import Arrival, RawSubscription, recording_qos

OVERLAP_S: Final = 0.5  # old subscriptions stay this long after the last change
MATCH_LIMIT_S: Final = 5.0  # and no longer than this where a publisher never matches


class Strength(NamedTuple):
    """What a subscription requests beyond the weakest, which fits every publisher."""

    reliable: bool
    transient_local: bool


MOST_LIKELY: Final = Strength(True, False)  # asked for while there is no publisher: mostly it can stay


@dataclass(frozen=True, slots=True)
class Offer:
    """One publisher: its identity, what it offers, and the hash of its type ("" where not given)."""

    gid: tuple[int, ...]
    qos: QosProfile
    type_hash: str


def common_strength(offers: Sequence[Offer]) -> Strength:
    """Return the strongest request that every publisher answers."""
    return Strength(
        all(offer.qos.reliability == "reliable" for offer in offers),
        all(offer.qos.durability == "transient_local" for offer in offers),
    )


class TopicSubscription:
    """Takes a topic's messages, each once, through one subscription or, while publishers change, several.

    Args:
        node: a node in no executor.
        message_class: the topic's type.
        topic: full name.
        depth: messages the middleware keeps between two calls.
        ask: returns the publishers there are now.
    """

    def __init__(
        self, node: Node, message_class: type, topic: str, depth: int, ask: Callable[[], Sequence[Offer]]
    ) -> None:
        self._node, self._class, self._topic, self._depth, self._ask = node, message_class, topic, depth, ask
        self._subscriptions: dict[Strength, RawSubscription] = {}
        self._seen: set[tuple[int, int]] = set()  # (time sent, number) of what came while there were several
        self._seen_last = -1
        self._changed_at = 0.0
        self.offers = ask()
        self.strength = common_strength(self.offers) if self.offers else MOST_LIKELY
        self._open()
        self._settled = bool(self.offers)

    @property
    def matched(self) -> bool:
        """Whether there is a publisher, and the subscription that stays has found all there are."""
        return bool(self.offers) and self._subscriptions[self.strength].publisher_count() >= len(self.offers)

    def follow(self, now: float) -> None:
        """Look at the publishers there are now and change what is asked for where needed."""
        offers = self._ask()
        if not offers:
            return  # the last known stay the topic's description
        if {offer.gid for offer in offers} != {offer.gid for offer in self.offers}:
            self._changed_at = now
        self.offers = offers
        wanted = common_strength(offers)
        if self._settled:
            # Only what is weaker is opened from now on: anything else would bring latched messages a second time.
            keep = all(new >= old for new, old in zip(wanted, self.strength, strict=True))
            wanted = self.strength if keep else Strength(wanted.reliable and self.strength.reliable, False)
        if wanted != self.strength:
            self.strength = wanted
            self._changed_at = now
            self._open()

    def drain(self, now: float) -> list[Arrival]:
        """Return what has come, each message once."""
        if self._settled:
            # A reliable publisher may repeat, long after, what another subscription had brought.
            return [
                arrival
                for arrival in self._subscriptions[self.strength].drain()
                if arrival.sequence > self._seen_last or (arrival.sent_ns, arrival.sequence) not in self._seen
            ]
        fresh = []
        for subscription in self._subscriptions.values():
            for arrival in subscription.drain():
                key = (arrival.sent_ns, arrival.sequence)
                if key not in self._seen:
                    self._seen.add(key)
                    self._seen_last = max(self._seen_last, arrival.sequence)
                    fresh.append(arrival)
        self._settle(now)
        return fresh

    def close(self) -> None:
        """Unsubscribe."""
        for subscription in self._subscriptions.values():
            subscription.close()

    def _open(self) -> None:
        self._settled = False
        if self.strength not in self._subscriptions:
            reliable, transient_local = self.strength
            qos = recording_qos(self._depth, reliable=reliable, transient_local=transient_local)
            self._subscriptions[self.strength] = RawSubscription(self._node, self._class, self._topic, qos)

    def _settle(self, now: float) -> None:
        """Close what is not needed any more."""
        if not self.offers or now - self._changed_at < OVERLAP_S:
            return
        if len(self._subscriptions) > 1:
            if not self.matched and now - self._changed_at < MATCH_LIMIT_S:
                return
            self.follow(now)  # a publisher that has come just now may need an old one
            if now - self._changed_at < OVERLAP_S:
                return
            for strength in [strength for strength in self._subscriptions if strength != self.strength]:
                self._subscriptions.pop(strength).close()
        self._settled = True
