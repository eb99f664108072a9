"""Provisional segments, to look at while the real ones are computed, which do not depend on them."""
