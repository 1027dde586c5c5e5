"""Evaluation of the pick scenario.

episodes         Runs pick episodes to their ends under any rule of choosing among candidates
people           Protocols ``pick-people``, ``pick-mocap``, ``pick-yielding``: a policy beside
                 other people
recorded_people  What is recorded of episodes for a second look: poses of robot and people, for
                 FCL
selection_rules  Rules of choosing among candidates, to compare the critic's choice with
                 (METHOD 3.6)
tasks            Protocols ``pick-single`` and ``pick-choice`` (METHOD 3.6)
tracker          Protocol ``pick-tracker``: what a policy loses when it sees people through a
                 tracker
"""
