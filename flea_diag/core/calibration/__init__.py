"""Frozen calibration; parameters, noise and limits identified from nominal runs."""
