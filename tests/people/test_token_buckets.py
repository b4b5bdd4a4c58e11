"""How much a process remembers of those it slows down."""

from rehab.people import token_buckets
from rehab.people.token_buckets import TokenBuckets


def test_the_longest_unused_key_is_forgotten_beyond_the_limit(monkeypatch):
    monkeypatch.setattr(token_buckets, "MAX_KEYS", 2)
    buckets = TokenBuckets(burst=1, interval_s=60)
    assert [buckets.take(key, 0.0) for key in "aba"] == [0, 0, 60]
    assert buckets.take("c", 0.0) == 0
    assert buckets.take("a", 0.0) == 60
    assert buckets.take("b", 0.0) == 0
