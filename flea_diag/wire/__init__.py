"""What crosses a process: records, their codec, topics and bags."""
