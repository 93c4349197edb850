"""What a simulated machine is: values of its parts, read from a file of its own."""
