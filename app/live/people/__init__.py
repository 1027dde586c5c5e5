"""People of live worlds: workers, pedestrians, dragged people.

body         How large a live person is, changed while the cell runs: lengths glide, they never
             jump
dragging     A person who is moved by hand: follows drags smoothly, with a speed that makes
             sense
pedestrians  The people of a live reach cell: none to four walking cylinders, or who drags them
work_loop    The work of one live person: task primitives, one script after the other without a
             jump
worker       One person of a live cell: works, acts a case study, moves as recorded, rests, or
             is dragged
workers      The people of a live cell: none to four, each with a home and a part of the table
"""
