"""``flea stand``: the folder of a stand of your own, made and checked."""
