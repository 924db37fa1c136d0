"""Stress campaigns: many random cases, each answered rightly, refused with a reason, or stopped with a status.

A campaign draws its cases from a seed, so that any of them can be drawn again by its number; `runner` runs them in a
process of their own under limits of time, `record` keeps what came out, `report` writes the worst cases as jobs for
the ordinary commands. `campaign.py` says what a campaign provides.
"""
