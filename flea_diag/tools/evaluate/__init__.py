"""``flea evaluate``: the runs of a campaign, diagnosed and scored."""
