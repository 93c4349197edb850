"""The pages in NiceGUI: that of one stand, the list of all, and what draws them."""
