"""The recorder and the clips that it cuts."""
