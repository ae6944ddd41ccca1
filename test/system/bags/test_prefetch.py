"""Reading ahead in a thread."""

from __future__ import annotations

import itertools
import threading

import pytest

from slip_bags.playing import player as player_module
from slip_bags.playing.prefetch import DEPTH, Prefetch
from slip_core.errors import InputError


def test_everything_in_order():
    assert list(Prefetch(range(3 * DEPTH))) == list(range(3 * DEPTH))


def test_errors_come_where_they_happen():
    def broken():
        yield 1
        raise InputError("chunk", got="damage", expected="none")

    ahead = iter(Prefetch(broken()))
    assert next(ahead) == 1
    with pytest.raises(InputError, match="damage"):
        next(ahead)


def test_closing_ends_the_thread():
    before = threading.active_count()
    ahead = Prefetch(itertools.count())
    assert next(iter(ahead)) == 0
    ahead.close()
    assert threading.active_count() == before


def test_bags_too_large_to_preload_are_played_the_same(ros_node, tmp_path, monkeypatch):
    from slip_bags.playing.player import Controls, Player, PlayOptions
    from slip_bags.reader import Bag
    from test.support.bag_maker import make_bag

    monkeypatch.setattr(player_module, "PRELOAD_BYTES", 0)
    make_bag(tmp_path / "bag", count=100, topics={"/a": "std_msgs/msg/String"})

    class Nobody(Controls):
        pass  # nobody at the keyboard: `Controls` itself asks for nothing

    with Bag(tmp_path / "bag") as bag:
        result = Player(ros_node, bag, PlayOptions(rate=10.0), Nobody(), pytest.fail).run()
    assert (result.messages, result.loops, result.completed) == (100, 1, True)
