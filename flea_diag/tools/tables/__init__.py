"""Tables of others, in any format that people keep recordings in."""
