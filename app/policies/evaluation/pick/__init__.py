"""Evaluation of the pick scenario.

calibration      Protocol ``risk-calibration``: predicted probabilities against rates
case_variants    Protocol ``pick-case-variants``: variants that no policy selected
cases            Protocol ``pick-cases``: the four case studies
episodes         Run pick episodes to their ends under a selection rule
people           Protocols ``pick-people``, ``pick-mocap``, ``pick-yielding`` and
                 ``pick-rest``: other people in the cell
selection_rules  Selection rules: the critic's with hysteresis, and others
ssm              Protocol ``pick-ssm``: picks under speed and separation monitoring
tasks            Protocols ``pick-single``, ``pick-choice`` and ``pick-choice-hard``
                 (docs/method.md 3.6)
tracker          Protocol ``pick-tracker``: people observed through a tracker
worst_people     Protocol ``pick-worst``: people found by a search
"""
