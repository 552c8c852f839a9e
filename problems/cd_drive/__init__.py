"""Twelve measured CD drives, read from bottom to top.

drive        the drive and the disc: printed tables, actuator, optics, responses
laboratory   the drive on a virtual bench, and what experiments on it identify
uncertainty  sets of plants that contain the twelve drives
control      robust controllers, their margins, and bounds that no controller beats
diagnosis    surface defects: found, told apart, estimated
tolerance    strategies that keep the loop while a defect passes, and how well they do
operation    the loop is closed, jumps tracks, changes its controller, and is closed again when lost

A problem's name leads to its file: ``cd/focus/fault-filter`` is ``fault_filter.py``, or
``problem.py`` in the folder ``fault_filter``, in one of these rooms.
"""
