"""Chapter 1: what the thesis says that it contributes."""

from __future__ import annotations

from ..items import Item, Verdict, at_least, at_most

ITEMS = (
    Item(
        "Section 1.3",
        "Two controllers, a fast one and a slow one that runs during defects only, are better",
        Verdict.REFUTED,
        (
            at_least(
                "balloon of the best pair less the best controller alone, upper end, focus",
                "cd/focus/best-gains",
                "switched_less_alone_high",
                0.0,
            ),
            at_least("the same, radial", "cd/radial/best-gains", "switched_less_alone_high", 0.0),
            at_most(
                "the best pair less the best reference strategy, upper end, focus",
                "cd/focus/best-gains",
                "switched_less_reference_high",
                0.0,
            ),
        ),
        "The best of twelve pairs gains nothing that is sure over the best controller alone. It "
        "gains much over the reference strategy, which is held in defects",
        "compared",
    ),
    Item(
        "Section 1.3",
        "A mu-controller reduced to third order meets the CD standard on all twelve drives",
        Verdict.REFUTED,
        (
            at_least(
                "largest error over 2 um, by the Red Book's deviations",
                "cd/focus/sensitivity",
                "red_book_error_full_continuous",
                1.0,
            ),
            at_most(
                "largest size of W_p S, which the thesis takes for the standard",
                "cd/focus/sensitivity",
                "max_weighted_S",
                1.0,
            ),
        ),
        "It meets W_p, but in a band W_p permits more than 2 um. There the error is a few percent "
        "too large",
    ),
    Item(
        "Section 1.3",
        "A measured coil current makes the loops less sensitive to shocks (a paper of 2000)",
        Verdict.NOT_COMPUTABLE,
        found="The thesis names the method and does not describe it",
    ),
)
