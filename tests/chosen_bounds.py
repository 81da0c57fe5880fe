"""Rounds of a time budget without a clock: a test says which bounds they have."""

from texbake.sampling.rounds import OutOfTimeError, Rounds


def chosen_bounds(monkeypatch, bounds, give_up=None):
    """Let rounds have these bounds; `give_up` says at which look at the clock one of them ends."""
    left, looks = list(enumerate(bounds)), [None]

    def choose(self, work):
        looks[0] = None
        if not left:
            return None
        index, bound = left.pop(0)
        looks[0] = (give_up or {}).get(index)
        return bound, 1.0, 1.0

    def check(self, seconds=0.0):
        if looks[0] is not None:
            looks[0] -= 1
            if looks[0] == 0:
                raise OutOfTimeError

    monkeypatch.setattr(Rounds, "_next", choose)
    monkeypatch.setattr(Rounds, "check", check)
