"""What is believed of a results folder that somebody else has made, and what is refused."""
