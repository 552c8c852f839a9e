"""Start-up of a loop, track jumps, change of its controller, and recovery when it is lost."""
