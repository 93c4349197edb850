"""The live run of ``scripts/run``: its processes, their domain, the summary at the end."""
