"""The arena: diagnosers of others on the runs of a campaign, each in a process of its own."""
