"""Whether regions of responses that are estimated from records hold the true plants."""
