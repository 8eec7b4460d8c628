"""Doubts about the records of another stack: the usual ones only where the user has set none."""

from hindrax_ident.tuning import LAG_SIGMA_S, STAMP_SIGMA_S, THRUST_SHARE, Tuning, for_foreign_records


def test_what_the_user_has_set_stays_also_where_it_is_less_than_usual_or_0() -> None:
    usual = for_foreign_records(Tuning())
    assert (usual.stamp_doubt_s, usual.thrust_doubt, usual.lag_doubt_s) == (STAMP_SIGMA_S, THRUST_SHARE, LAG_SIGMA_S)
    own = Tuning(stamp_doubt_s=0.0, thrust_doubt=0.0, lag_doubt_s=0.01)
    assert for_foreign_records(own) == own
