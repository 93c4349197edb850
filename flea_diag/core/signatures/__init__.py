"""The fault signature matrix: initial, sampled, of the relations; diagnosability."""
