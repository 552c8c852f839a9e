"""Whether regions of responses that are estimated from records contain the true plants."""
