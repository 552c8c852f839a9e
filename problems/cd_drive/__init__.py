"""Twelve measured CD drives, read from bottom to top.

- drive: the drive and the disc: printed tables, actuator, optics, responses
- laboratory: the drive on a virtual bench, and what experiments on it identify
- uncertainty: sets of plants that contain the twelve drives
- control: robust controllers, their margins, and bounds that no controller beats
- diagnosis: surface defects: detected, distinguished, estimated
- tolerance: strategies that hold the loop while a defect passes, and their performance
- operation: start-up, track jumps, change of controller, recovery of a lost loop, sledge and disc
  servo
- coupling: both loops together, and what couples them

A problem's name leads to its file: ``cd/focus/fault-filter`` is ``fault_filter.py``, or
``problem.py`` in the folder ``fault_filter``, in one of these rooms.
"""
