"""Motion decisions: answers of the route, and sockets for loops with a deadline.

decision  Answers to motion requests, for the route and for sockets
load      Admission of motion sockets by the measured time of decisions
stream    One motion socket: requests with a deadline, of which the newest is answered
"""
