"""Problems that measure the workbench itself: times as ratios within one run, of first answers in
seconds.
"""
