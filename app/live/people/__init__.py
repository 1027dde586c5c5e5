"""People of live worlds: workers, pedestrians, dragged people.

anthropometry  Body dimensions of a live person, which change continuously
dragging       Motion of a dragged person: low-pass filter with bounded joint speeds
people_by_id   What workers and pedestrians of a live cell share: people by their ids
pedestrians    People of a live reach cell: up to four pedestrians as vertical cylinders
work_loop      Continuous work of one person: random scripts of task primitives
worker         One 18-DoF person of a live cell and the sources of its motion
workers        People of a live pick or sorting cell: up to four workers with their work areas
"""
