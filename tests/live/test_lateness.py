from app.live.lateness import BOUNDS_S, Lateness


def test_ticks_are_counted_up_to_each_bound() -> None:
    late = Lateness()
    for seconds in (0.0, BOUNDS_S[0], 0.0015, 10.0):
        late.add(seconds)
    buckets = dict(late.buckets())
    assert buckets[str(BOUNDS_S[0])] == 2
    assert buckets[str(BOUNDS_S[1])] == buckets[str(BOUNDS_S[-1])] == 3
    assert buckets["+Inf"] == 4
    assert late.total_s == 10.0025
