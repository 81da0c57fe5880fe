"""The naive formula fails where ours holds, by the same measure."""


def test_ours_holds_where_the_naive_formula_does_not(contrast):
    naive, ours = contrast.measured()
    assert ours <= contrast.bound
    assert naive > contrast.bound
